"""List of the files that a run wrote into its folder, by which the next run knows which files are the user's own."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from motions.files import file_names

RECORD = "run.json"

LIST = "girdle.sha256"
"""Name of the list. It has one line per file, ``HASH  NAME``, as ``sha256sum -c`` reads it, for all files of the run
but itself. The next run removes the listed files; hence a name that nobody gives to a list of their own data."""

DATA = ("motions.csv", "truth.csv")
"""Files of ``girdle simulate``, which other runs read."""

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")

_TABLES = ("fits.csv", "summary.csv", "parameters.csv", "heldout.csv")
WRITTEN_BY: dict[str, tuple[str, ...]] = {
    "fit": _TABLES[:2],
    "adapt": (*_TABLES, "positions.csv", "report.html"),
    "diagnose": (
        *(*_TABLES, "positions.csv", "report.html", "diagnosis.json"),
        *(f"{name}.svg" for name in ("budget", "inclusion", "gap_heatmap", "gaps")),
    ),
    "trust": (*_TABLES, *(f"{name}.csv" for name in ("trust", "uncertainty", "plausibility", "contact", "weights"))),
    "muscles": (
        *(*_TABLES, "report.html", "muscle_arms.svg"),
        *(f"{name}.csv" for name in ("muscle_arms", "muscles", "balance", "muscle_lines")),
    ),
    "simulate": DATA,
}
"""Files of a run by its command, without ``RECORD`` and models."""


@dataclass(frozen=True)
class Written:
    """Files that a run wrote into a folder, by their names relative to the folder."""

    folder: Path
    hashes: dict[str, frozenset[str]]
    """SHA-256 of each file: two where a run was killed while it replaced files, none where no hash was recorded."""

    def is_there(self, name: str) -> bool:
        """Check whether the file is still the one that the run wrote."""
        known = self.hashes.get(name)
        return known is not None and (not known or sha256(self.folder / name) in known)

    def lines(self, names: Iterable[str]) -> Iterator[bytes]:
        """Format some of the files as lines of ``LIST``."""
        return (f"{one}  {name}\n".encode() for name in names for one in sorted(self.hashes[name]))


def last_written(folder: Path) -> Written:
    """Read which files the last run wrote into the folder; without a list, those that the command of the run writes."""
    path = folder / LIST
    if not path.is_file():
        return Written(folder, dict.fromkeys(_unlisted(folder), frozenset()))
    hashes: dict[str, set[str]] = {}
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        found = _LINE.fullmatch(line)
        if found and not Path(found[2]).is_absolute() and ".." not in Path(found[2]).parts:
            hashes.setdefault(found[2], set()).add(found[1])
    return Written(folder, {name: frozenset(known) for name, known in hashes.items()})


def _unlisted(folder: Path) -> list[str]:
    """Return the files of a version that left a record and no list."""
    try:
        command = json.loads((folder / RECORD).read_bytes())["command"]
        return [RECORD, *WRITTEN_BY[command], *(_unlisted_models(folder) if command == "adapt" else ())]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return []


def _unlisted_models(folder: Path) -> list[str]:
    rows = pd.read_csv(folder / "parameters.csv", usecols=["model", "subject"], dtype=str)
    return [f"models/{name}.toml" for name in file_names(rows["model"] + "_" + rows["subject"])]


def listed(folder: Path, names: Iterable[str]) -> list[bytes]:
    """Format files below the folder as lines of ``LIST``."""
    return [f"{sha256(folder / name)}  {name}\n".encode() for name in names]


def files_below(folder: Path, below: str = "") -> Iterator[str]:
    """Yield the names of the files below a folder, relative to it, in order. A million names take 0.1 GB, as paths ten
    times as much."""
    for name in sorted(one.name for one in (folder / below).iterdir()):
        if (folder / below / name).is_dir():
            yield from files_below(folder, f"{below}{name}/")
        else:
            yield f"{below}{name}"


def sha256(path: Path) -> str | None:
    """Hash a file with SHA-256, in hexadecimal; None for a file that cannot be read, and for a pipe.

    A file that cannot be read is reported among the inputs that were left out; a pipe can be read only once.
    """
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return None
