"""Many laboratory files, or a folder of them, as one table of motions: their subjects, and the files left out."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from motions.errors import InputError, listed
from motions.formats.any_file import read_any, read_calibration
from motions.formats.spartacus import is_spartacus
from motions.landmarks.clusters.calibration import Calibration
from motions.landmarks.mapping import Mapping
from motions.landmarks.sampled_postures import Labels
from motions.table import Motions

ENDINGS = (".c3d", ".trc", ".mot", ".sto", ".csv", ".tsv")
"""Endings of the files that are read from a folder; a file that ends in .txt has to be named."""

_MOST_NAMED = 5
"""Largest number of folders named in a message."""


def is_folder_of_trials(path: Path) -> bool:
    """Check whether a path is a folder of files, and not a Spartacus checkout, which is one source."""
    return path.is_dir() and not is_spartacus(path)


def first_file(source: Path) -> Path:
    """Return a file itself, or the first file of a folder; raise an InputError if the folder has none."""
    return _files([source], None, ())[0][0]


def read_several(
    sources: Sequence[Path], target: Path, mapping: Mapping, labels: Labels, statics: Sequence[Path]
) -> Motions:
    """Read every file of the sources, including files in subfolders, as one table.

    The subject of a file that does not name one is ``labels.subject``, else the folder of the person with the file,
    else the file's name. A file that cannot be read, or repeats a motion of another file, is named in ``rejected``.
    Raise an InputError if no file is left.
    """
    files = _files(sources, target, statics)
    _check_statics(statics, {folder for _, folder in files}, labels)
    parts: list[Motions] = []
    rejected: list[InputError] = []
    owner: dict[tuple[str, str], Path] = {}
    calibration = cache(lambda folder: calibration_for(folder / "trial", statics, mapping, labels))
    for path, folder in files:
        try:
            part = read_any(path, mapping, replace(labels, folder=folder), calibration(path.parent))
            _check_twice(part, path, owner)
        except InputError as error:
            rejected.append(error)
        else:
            parts.append(part)
    if not parts:
        raise rejected[0]
    motions = Motions.concatenate(parts)
    return replace(motions, rejected=(*motions.rejected, *rejected))


def calibration_for(trial: Path, statics: Sequence[Path], mapping: Mapping, labels: Labels) -> Calibration | None:
    """Read the static trials of a trial; None without any."""
    return read_calibration(static_files(trial, statics), mapping, labels)


def static_files(trial: Path, statics: Sequence[Path]) -> list[Path]:
    """Return the static trials of a trial: paths that exist, else files of these names in the trial's folder."""
    return [path if path.exists() else trial.parent / path for path in statics]


def _files(sources: Sequence[Path], target: Path | None, statics: Sequence[Path]) -> list[tuple[Path, str]]:
    """List every file with the name of its person's folder, which is empty where all files lie in one folder."""
    found: list[tuple[Path, str]] = []
    named = [path for path in sources if not is_folder_of_trials(path)]
    several = len({path.resolve().parent for path in named}) > 1
    for source in sources:
        if source in named:
            found.append((source, source.resolve().parent.name if several else ""))
            continue
        own = [path for path in sorted(source.rglob("*")) if _is_trial(path.relative_to(source), path)]
        for path in own:
            inside = path.relative_to(source).parts
            found.append((path, inside[0] if len(inside) > 1 else ""))
    apart = {path.resolve() for path in (target, *statics) if path is not None}
    names = {path.name for path in statics if not path.exists()}
    found = [(path, folder) for path, folder in found if path.resolve() not in apart and path.name not in names]
    if not found:
        cause = f"there are no files that end in {', '.join(ENDINGS)}"
        raise InputError(str(sources[0]), None, cause, "Name a folder of trials, a Spartacus checkout, or files")
    return found


def _is_trial(inside: Path, path: Path) -> bool:
    """Check whether a file is to be read: known ending, no hidden file or folder (a name that begins with a dot)."""
    return path.suffix.lower() in ENDINGS and path.is_file() and not any(part.startswith(".") for part in inside.parts)


def _check_statics(statics: Sequence[Path], folders: set[str], labels: Labels) -> None:
    """Raise an InputError if the static trials of one person would calibrate other persons."""
    shared = [path for path in statics if path.exists()]
    if shared and len(folders) > 1 and not labels.subject:
        cause = f"this static trial is of one person, and the trials are in the folders {_named(folders)}"
        remedy = "Name it without a folder, as --static static.trc, and put one into the folder of each person"
        raise InputError(str(shared[0]), None, cause, remedy)


def _named(folders: set[str]) -> str:
    return listed(sorted(folders - {""}), _MOST_NAMED)


def _check_twice(part: Motions, path: Path, owner: dict[tuple[str, str], Path]) -> None:
    """Raise an InputError if another file has the same motion of a subject; else record this file as the owner."""
    pairs = set(zip(part.subject.tolist(), part.motion.tolist(), strict=True))
    for subject, motion in sorted(pairs):
        if (subject, motion) in owner:
            cause = f"motion {motion!r} of {subject!r} is that of {owner[subject, motion]} too"
            raise InputError(str(path), None, cause, "Give the files different names, or each person a folder")
    owner.update(dict.fromkeys(pairs, path))
