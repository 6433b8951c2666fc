"""Writing of the results of a run: each file whole or not at all, and a record that is enough to repeat the run."""

import hashlib
import importlib.metadata
import json
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

import pandas as pd

from adapt.output.publishing import Inputs, publish, refuse_inputs_of
from adapt.output.written_files import RECORD, sha256
from adapt.solvers.newton.postures import OFFSETS_SEED
from adapt.tables.results import as_csv
from models.parameter_sets import FOLDER, model_file
from models.person.family import set_files
from motions.errors import InputError
from motions.files import atomic_write, is_part, part_name

try:
    import fcntl
except ImportError:  # Windows: no lock keeps two runs apart there
    fcntl = None

_VERSIONS_OF = ("girdle", "jax", "jaxlib", "llvmlite", "numpy", "optimistix", "pandas")


def prepare_folder(path: str | os.PathLike[str]) -> Path:
    """Create the folder if it does not exist; InputError, before any work is done, if it is not writable."""
    folder = Path(path)
    probe = folder / part_name()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_text("")
    except OSError as error:
        cause = f"the output folder cannot be written to ({error.strerror})"
        raise InputError(str(folder), None, cause, "Give a folder of your own with --out") from error
    finally:  # an interrupt may come at any moment
        with suppress(OSError):
            probe.unlink(missing_ok=True)
    return folder


@contextmanager
def results_folder(path: str | os.PathLike[str], inputs: Inputs | None = None, command: str = "") -> Iterator[Path]:
    """Prepare the folder and lock it for this run alone; InputError if another run holds the lock.

    Half-written files of a killed run are removed. With ``inputs``, InputError if one of them is a file that the
    command writes there, before hours of work.
    """
    if inputs is not None:
        refuse_inputs_of(inputs, command, Path(path))
    folder = prepare_folder(path)
    lock = _lock(folder)
    try:
        for leftover in folder.iterdir():
            if is_part(leftover):
                _remove(leftover)
        yield folder
    finally:
        if lock is not None:
            os.close(lock)


@contextmanager
def transaction(folder: Path) -> Iterator[Path]:
    """Yield a folder for files that move to ``folder`` together when the block ends without an error.

    The files of the previous run are then removed (``adapt.output.publishing``). If the block fails (the disk is full),
    or is killed, all files of ``folder`` stay as they were.
    """
    staged = folder / part_name()
    try:
        staged.mkdir()
        yield staged
        publish(staged, folder)
    except (OSError, InputError) as error:
        reason = error.cause if isinstance(error, InputError) else f"the files cannot be written ({error.strerror})"
        remedy = "Make room, or give another folder with --out; the results in this one are as they were"
        raise InputError(str(folder), None, reason, remedy) from error
    finally:
        _remove(staged)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _lock(folder: Path) -> int | None:
    """Return a handle that locks the folder until it is closed or its process ends in any way; None without locks."""
    if fcntl is None:
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        cause = "another run is writing to this folder"
        remedy = "Wait until it has ended, or give another folder with --out"
        raise InputError(str(folder), None, cause, remedy) from error
    except OSError:
        pass  # a file system without locks, as some network file systems
    return handle


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a table as CSV (``adapt.tables.results.as_csv``)."""
    atomic_write(path, as_csv(table))


def write_json(record: dict[str, object], path: Path) -> None:
    """Write strict JSON; numbers that are not finite must already be null."""
    atomic_write(path, json.dumps(record, indent=2, allow_nan=False) + "\n")


def inputs_record(motions: Sequence[Path], models: Sequence[str]) -> Inputs:
    """Record the input files of a run with their SHA-256.

    Record them before they are read: they can change during the run. Paths are absolute, so that the run can be
    repeated from another folder.
    """
    files = [model_file(name) for name in models]
    return {
        "motions": [{"path": str(path.absolute()), "sha256": sha256(path)} for path in motions],
        "models": [
            {"name": name if file.parent == FOLDER else str(file.absolute()), "sha256": model_sha256(file)}
            for name, file in zip(models, files, strict=True)
        ],
    }


def run_key(inputs: Inputs, options: dict[str, object]) -> str:
    """Hash all that the results of a run depend on to a key of 16 hexadecimal digits.

    A pipe has no hash: its run has a random key.
    """
    record = inputs | {"options": options, "versions": versions()}
    if any(file["sha256"] is None for files in inputs.values() for file in files):
        record["once"] = uuid4().hex
    return hashlib.sha256(json.dumps(record).encode()).hexdigest()[:16]


def write_run(
    folder: Path,
    command: str,
    inputs: Inputs,
    options: dict[str, object],
    left_out: Sequence[InputError] = (),
) -> None:
    """Write ``run.json``: inputs (from ``inputs_record``), inputs left out with the reasons, options, seeds, versions.

    The options have the names of the command's parameters: ``adapt.output.repeat`` passes them to it again.
    """
    record = {
        "command": command,
        **inputs,
        "left_out": [str(error) for error in left_out],
        "options": options,
        "seeds": {"posture_fit_starts": OFFSETS_SEED},
        "versions": versions(),
    }
    write_json(record, folder / RECORD)


def versions() -> dict[str, str]:
    """Return the versions of everything that the last digits of a result depend on, except the machine."""
    return {"python": sys.version.split()[0]} | {name: _version(name) for name in _VERSIONS_OF}


def _version(library: str) -> str:
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:  # llvmlite may be missing (``adapt.engine.kernel``)
        return "none"


def model_sha256(path: Path) -> str | None:
    """Hash the file of a parameter set, or a folder with one file per subject: names and contents together."""
    if not path.is_dir():
        return sha256(path)
    listed = [f"{file.name} {sha256(file)}" for file in set_files(path)]
    return hashlib.sha256("\n".join(listed).encode()).hexdigest()
