# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportReturnType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""A batch of any size, part by part: a part holds all that a chunk of subjects adds to the tables of ``girdle adapt``.

A part is one zip file, written whole or not at all. Parts wait in ``unfinished/KEY`` below the folder of the results;
a run that was stopped goes on with those that are there, and when all are there they become the tables.
"""

import io
import json
import shutil
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from adapt.api import adapt_subjects
from adapt.solvers import status
from adapt.solvers.status import EXPLANATION
from adapt.tables.results import Tables, as_csv
from models.effects.amplitudes import Amplitudes
from models.person.family import AnyModel
from motions.files import atomic_write_bytes, atomic_write_pieces
from motions.table import Motions

FOLDER = "unfinished"
"""Below the folder of the results, while it is."""

LANES = 512
"""Subjects times models of a part: two of the chunks that stay in a core's cache, and 0.3 GB of memory. Parts of 1024
took 100 000 subjects 3 % less time and a tenth more memory."""

MOST_SHOWN = 400
"""Subjects of which the report of a run of several parts is made."""

_STATES = (0, 1)
"""Of the column ``adapted``."""


@dataclass(frozen=True)
class Work:
    """What is done with every chunk."""

    models: tuple[AnyModel, ...]
    weight: float
    reading: str
    shown: frozenset[str]
    """The subjects of the report."""
    held_out: frozenset[str]
    """The subjects whose gap is looked at on what was held out, too."""
    float32: bool = False
    effects: Amplitudes = field(default_factory=dict)
    """A dict, which can be sent to a worker."""
    thorax_downweighting: float = 1.0

    def part(self, motions: Motions) -> bytes:
        """Compute the part of these subjects; it is the same wherever it is made."""
        dtype = np.float32 if self.float32 else np.float64
        result = adapt_subjects(
            motions,
            self.models,
            self.weight,
            self.reading,
            held_out=self.held_out,
            dtype=dtype,
            effects=self.effects,
            thorax_downweighting=self.thorax_downweighting,
        )
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as file:
            for k, model in enumerate(self.models):
                fits = result.fits[result.fits["model"] == model.name]
                for state in _STATES:
                    rows = fits[fits["adapted"] == state]
                    text, shown = as_csv(rows), rows["subject"].isin(self.shown)
                    file.writestr(f"fits{state}/{k}.csv", text)
                    file.writestr(f"shown{state}/{k}.csv", text if bool(shown.all()) else as_csv(rows[shown]))
                    file.writestr(f"summary{state}/{k}.csv", as_csv(result.subjects[model.name, state]))
                for name, table in (("parameters", result.parameters), ("heldout", result.heldout)):
                    file.writestr(f"{name}/{k}.csv", as_csv(table[table["model"] == model.name]))
            file.writestr("failed.json", json.dumps(not_adapted(result)))
        return content.getvalue()


Chunks = Iterator[tuple[int, Motions]]

Maker = Callable[[Work, Chunks], Iterable[tuple[int, bytes]]]
"""Makes the parts of numbered chunks, in any order."""


def one_after_another(work: Work, chunks: Chunks) -> Iterator[tuple[int, bytes]]:
    """Make the parts one after another in this process, on every device that JAX sees."""
    for number, motions in chunks:
        yield number, work.part(motions)


class Parts:
    """The parts of one run, made and to be made."""

    def __init__(self, folder: Path, key: str):
        """``key`` tells runs apart: parts of another one are removed."""
        self._home = folder / FOLDER / key
        for other in self._home.parent.glob("*"):
            if other != self._home:
                shutil.rmtree(other)
        self._home.mkdir(parents=True, exist_ok=True)

    def make(self, work: Work, chunks: Iterable[Motions], maker: Maker, progress: Callable[[str], None]) -> Motions:
        """Make every part that is not there yet, and return the motions that the report shows."""
        shown: list[Motions] = []
        done = 0

        def missing() -> Chunks:
            nonlocal done
            for number, motions in enumerate(chunks):
                shown.append(motions.select(np.isin(motions.subject, list(work.shown))))
                done += len(motions.subjects)
                if not self._path(number).exists():
                    progress(f"adaptation, {done} subjects")
                    yield number, replace(motions, rejected=())

        for number, part in maker(work, missing()):
            atomic_write_bytes(self._path(number), part)
        return Motions.concatenate(shown)

    def merge(self, folder: Path, models: Sequence[AnyModel]) -> tuple[Tables, dict[str, str]]:
        """Write fits.csv, parameters.csv, heldout.csv and summary.csv. The tables, fits only of the subjects that the
        report shows; and by subject what failed."""
        states = [(state, k) for state in _STATES for k in range(len(models))]
        with ExitStack() as stack:
            parts = [stack.enter_context(zipfile.ZipFile(path)) for path in sorted(self._home.glob("*.zip"))]
            parameters, heldout = ([f"{n}/{k}.csv" for k in range(len(models))] for n in ("parameters", "heldout"))
            atomic_write_pieces(folder / "fits.csv", _joined(parts, [f"fits{state}/{k}.csv" for state, k in states]))
            atomic_write_pieces(folder / "parameters.csv", _joined(parts, parameters))
            atomic_write_pieces(folder / "heldout.csv", _joined(parts, heldout))
            tables = Tables(
                fits=_table(parts, [f"shown{state}/{k}.csv" for state, k in states]),
                parameters=_table(parts, parameters),
                heldout=_table(parts, heldout),
                subjects={(models[k].name, s): _table(parts, [f"summary{s}/{k}.csv"]) for s, k in states},
            )
            failed = {subject: why for part in parts for subject, why in json.loads(part.read("failed.json")).items()}
        atomic_write_pieces(folder / "summary.csv", _pieces(tables.summary))
        return tables, failed

    def remove(self) -> None:
        """Remove the parts of the run, to be called when all files are there."""
        shutil.rmtree(self._home.parent)

    def _path(self, number: int) -> Path:
        return self._home / f"{number:07d}.zip"


def not_adapted(result: Tables) -> dict[str, str]:
    """Say by subject what failed of its adaptation or of the posture fits after it."""
    failed = failed_subjects(result.fits[result.fits["adapted"] == 1])
    for subject, word in zip(result.parameters["subject"], result.parameters["status"], strict=True):
        if word != status.OK:
            failed[subject] = f"adaptation {word}" + (f": {EXPLANATION[word]}" if word in EXPLANATION else "")
    return failed


def failed_subjects(fits: pd.DataFrame) -> dict[str, str]:
    """Say by subject how many of its posture fits failed, and how; subjects without a failure are left out."""
    bad = fits[fits["status"] != status.OK]
    return {
        subject: f"{len(rows)} posture fits {', '.join(sorted(set(rows['status'])))}"
        for subject, rows in bad.groupby("subject", sort=False)
    }


def _joined(parts: Sequence[zipfile.ZipFile], names: Sequence[str]) -> Iterator[bytes]:
    """One table of these, name by name: a header, then all rows, a part of them in memory at a time."""
    first = True
    for name in names:
        for part in parts:
            header, _, rows = part.read(name).partition(b"\n")
            if first:
                yield header + b"\n"
            first = False
            yield rows


_ROWS = 10_000
"""Of a table that are text at a time: a row as text takes ten times its memory as numbers."""


def _pieces(table: pd.DataFrame) -> Iterator[bytes]:
    for first in range(0, max(1, len(table)), _ROWS):
        text = as_csv(table.iloc[first : first + _ROWS])
        yield (text.partition("\n")[2] if first else text).encode()


def _table(parts: Sequence[zipfile.ZipFile], names: Sequence[str]) -> pd.DataFrame:
    """The same, read. Every number as it was written, names as text."""
    content = io.BytesIO(b"".join(_joined(parts, names)))
    text = dict.fromkeys(("model", "subject", "motion", "status", "held_out"), str)
    return pd.read_csv(content, dtype=text, keep_default_na=False, na_values=[""])
