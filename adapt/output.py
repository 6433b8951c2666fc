"""Writing the results of a run: each file whole or not at all, and a record that is enough to repeat it."""

import hashlib
import importlib.metadata
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from adapt.fit import OFFSETS_SEED
from models.parameters import FOLDER
from motions.errors import InputError
from motions.files import write_whole

_VERSIONS_OF = ("girdle", "jax", "jaxlib", "numpy", "pandas")


def prepare_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, made if it is not there; InputError before any work is done if it cannot be written to."""
    folder = Path(path)
    probe = folder / ".girdle-write-test"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        cause = f"the output folder cannot be written to ({error.strerror})"
        raise InputError(str(folder), None, cause, "Give a folder of your own with --out") from error
    return folder


def write_table(table: pd.DataFrame, path: Path) -> None:
    """CSV with every digit that the numbers have; an empty cell is 'no value'."""
    write_whole(path, table.to_csv(index=False, lineterminator="\n"))


def write_json(record: dict[str, object], path: Path) -> None:
    """Strict JSON: what is not a finite number must be null by now."""
    write_whole(path, json.dumps(record, indent=2, allow_nan=False) + "\n")


def run_key(motions: Sequence[Path], models: Sequence[str], options: dict[str, object]) -> str:
    """One word for everything that the results of a run depend on."""
    record = _inputs(motions, models) | {"options": options, "versions": _versions()}
    return hashlib.sha256(json.dumps(record).encode()).hexdigest()[:16]


def write_run(
    folder: Path,
    command: str,
    motions: Sequence[Path],
    models: Sequence[str],
    options: dict[str, object],
    left_out: Sequence[InputError] = (),
) -> None:
    """``run.json``: inputs with their SHA-256, what was left out of them and why, models, options, seeds, versions."""
    inputs = _inputs(motions, models)
    record = {
        "command": command,
        "motions": inputs["motions"],
        "left_out": [str(error) for error in left_out],
        "models": inputs["models"],
        "options": options,
        "seeds": {"posture_fit_starts": OFFSETS_SEED},
        "versions": _versions(),
    }
    write_whole(folder / "run.json", json.dumps(record, indent=2) + "\n")


def _inputs(motions: Sequence[Path], models: Sequence[str]) -> dict[str, object]:
    return {
        "motions": [{"path": str(path), "sha256": _sha256(path)} for path in motions],
        "models": [{"name": name, "sha256": _sha256(_model_file(name))} for name in models],
    }


def _versions() -> dict[str, str]:
    own = {name: importlib.metadata.version(name) for name in _VERSIONS_OF}
    return {"python": sys.version.split()[0]} | own


def _model_file(name: str) -> Path:
    shipped = FOLDER / f"{name}.toml"
    return shipped if shipped.exists() else Path(name)


def _sha256(path: Path) -> str | None:
    """None for what cannot be read, which then is among what was left out."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
