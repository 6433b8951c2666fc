"""Publishing of a run: its files take their places together, those of the previous run go; a folder holds one run."""

import errno
import json
import re
from collections.abc import Iterable
from pathlib import Path

from adapt.output.written_files import DATA, LIST, RECORD, WRITTEN_BY, Written, files_below, last_written, listed
from motions.errors import InputError, warn_input
from motions.files import atomic_write_pieces

Inputs = dict[str, list[dict[str, str | None]]]
"""Entries of run.json for the motion files and the models, by "motions" and "models"."""

UNFINISHED = "unfinished"
"""Folder below the results for the chunk files in progress: ``unfinished/KEY/NUMBER.npz``."""

_CHUNK_FILE = re.compile(r"unfinished/[0-9a-f]{16}/[0-9]{7}\.npz")


def publish(staged: Path, folder: Path) -> None:
    """Move every file of ``staged`` to its place below ``folder``, and remove the files of the previous run.

    No file of the user is replaced or removed: a file that no run wrote, or that was changed since, is renamed, with an
    InputWarning. Files that the run reads stay, and so do simulated motions. Before anything has changed, InputError
    if a file of the run would replace one that it reads, and OSError if a folder stands where a file should be, or a
    file where a folder should be.
    """
    places = _places(staged, folder)
    before, names = last_written(folder), list(files_below(staged))
    new = listed(staged, names)
    read = _inputs_below(json.loads((staged / RECORD).read_bytes()), folder)
    _refuse_inputs(names, read, folder)
    old = [name for name in before.hashes if not (staged / name).exists()]
    stay = [name for name in old if name in DATA or {Path(name), *Path(name).parents} & read]
    # A run killed from here on leaves only files that the list names, so the next run knows them.
    atomic_write_pieces(folder / LIST, [*new, *before.lines(before.hashes)])
    _keep_aside(before, names)
    for path, place in places.items():
        path.replace(place)
    _remove(before, set(old).difference(stay))
    atomic_write_pieces(folder / LIST, [*new, *before.lines(stay)])
    _remove_unfinished(folder)


def _places(staged: Path, folder: Path) -> dict[Path, Path]:
    """Return the place of each file; a folder that does not exist yet moves in one step, however many files it has."""
    paths: list[Path] = []
    for child in staged.iterdir():
        there = child.is_dir() and (folder / child.name).is_dir()
        paths += [child / name for name in files_below(child)] if there else [child]
    places = {path: folder / path.relative_to(staged) for path in paths}
    for path, place in places.items():
        if place.is_dir() or (path.is_dir() and place.exists()):  # checked before the first file is replaced
            raise FileExistsError(errno.EEXIST, f"{place.name} is a {'folder' if place.is_dir() else 'file'}")
        place.parent.mkdir(exist_ok=True)
    return places


def refuse_inputs_of(inputs: Inputs, command: str, folder: Path) -> None:
    """Raise InputError if a file that the command writes would replace one that it reads."""
    _refuse_inputs(WRITTEN_BY[command], _inputs_below(inputs, folder), folder)


def _inputs_below(inputs: Inputs, folder: Path) -> set[Path]:
    """Return the files and folders below ``folder`` that a run reads, relative to ``folder``, by its record."""
    paths = [one["path"] for one in inputs["motions"]] + [one["name"] for one in inputs["models"]]
    home, resolved = folder.resolve(), (Path(path).resolve() for path in paths if path)
    return {path.relative_to(home) for path in resolved if path.is_relative_to(home)}


def _refuse_inputs(names: Iterable[str], read: set[Path], folder: Path) -> None:
    """Raise InputError if a file of the run would replace one that it has read."""
    for name in names:
        if {Path(name), *Path(name).parents} & read and (folder / name).exists():
            cause = f"this run reads {name} in this folder and would replace it"
            raise InputError(str(folder), None, cause, "Give another folder with --out")


def _keep_aside(before: Written, names: Iterable[str]) -> None:
    """Rename the user's own files where a file is to be put, with a warning."""
    for name in names:
        place = before.folder / name
        if place.is_file() and not before.is_there(name):
            kept = _free_name(place)
            place.rename(kept)
            cause = "no run wrote this file, or it was changed since"
            warn_input(InputError(str(place), None, cause, f"It is kept as {kept.name}"))


def _free_name(place: Path) -> Path:
    number = 1
    while (kept := place.with_name(f"{place.name}.kept{number}")).exists():
        number += 1
    return kept


def _remove(before: Written, names: Iterable[str]) -> None:
    """Remove files of the previous run, and folders that are then empty; files that were changed since are renamed."""
    _keep_aside(before, names)
    for name in names:
        place = before.folder / name
        place.unlink(missing_ok=True)
        if place.parent != before.folder:
            _remove_if_empty(place.parent)


def _remove_unfinished(folder: Path) -> None:
    """Remove the chunk files of stopped runs in this folder, and nothing else that may be there."""
    home = folder / UNFINISHED
    for path in home.glob("*/*"):
        if _CHUNK_FILE.fullmatch(path.relative_to(folder).as_posix()):
            path.unlink()
    for place in (*home.glob("*"), home):
        _remove_if_empty(place)


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
