"""Mapping file of ``girdle convert --write-map``, to be edited: names found in a file, and missing names."""

from pathlib import Path

from models.export.toml import toml_text
from motions.errors import InputError
from motions.files import atomic_write, printable
from motions.formats.angle_table import ELEVATION
from motions.formats.isb import ISB_ANGLES
from motions.formats.marker_files.any_markers import read_markers
from motions.formats.mot import read_mot
from motions.landmarks.mapping import MARKERS, Mapping
from motions.landmarks.markers import Markers, names_of_landmarks, nearest
from motions.table import ANGLES

_OF_ANGLES = (".mot", ".sto")


def write_map(source: Path, target: Path, mapping: Mapping) -> int:
    """Write the mapping file for the source, with missing names as comments; return the number of names found.

    Raise an InputError if the target exists already, or if the source has neither markers nor angles.
    """
    if target.exists():
        raise InputError(str(target), None, "this file is there already", "Name another, or remove it")
    markers = read_markers(source) if source.suffix.lower() not in _OF_ANGLES else None
    if markers is None and source.suffix.lower() not in _OF_ANGLES:
        cause = "a mapping is of markers or of angles, and this file has its columns' names from here"
        raise InputError(str(source), None, cause, "Name a file of markers, or a .mot or .sto file")
    found, text = _of_markers(markers, mapping) if markers is not None else _of_angles(source, mapping)
    atomic_write(target, f"# Your names, for `girdle convert --map`. Written from {printable(source.name)}.\n{text}")
    return found


def _of_markers(markers: Markers, mapping: Mapping) -> tuple[int, str]:
    found = {landmark: _short(markers, name) for landmark, name in names_of_landmarks(markers, mapping).items()}
    said = f"the file says {printable(markers.unit)}" if markers.unit else "the file does not say it: mm, cm, m or inch"
    unit = f"unit = {toml_text(mapping.unit)}" if mapping.unit else f'# unit = "mm"  # {said}'
    names = dict.fromkeys(_short(markers, name) for name in markers.names)
    others = [name for name in names if name not in found.values()]
    lines = [unit, "", "[markers]", *(_line(name, found.get(name, ""), others) for name in MARKERS)]
    lines += _others("markers", others)
    clusters = ["", "# Markers that carry landmarks of static trials (--static):", "# [clusters]"]
    return len(found), "\n".join([*lines, *clusters, '# scapula = ["AMC1", "AMC2", "AMC3"]', ""])


def _of_angles(source: Path, mapping: Mapping) -> tuple[int, str]:
    columns = tuple(read_mot(source).columns)
    isb = any(mapping.column(name) in columns for name in ISB_ANGLES)
    wanted = (ELEVATION, *(ISB_ANGLES if isb else ANGLES))
    found = {name: mapping.column(name) for name in wanted if mapping.column(name) in columns}
    others = [name for name in columns if name not in found.values()]
    lines = ["[columns]", *(_line(name, found.get(name, ""), others) for name in wanted)]
    return len(found), "\n".join([*lines, *_others("columns", others), ""])


def _others(what: str, names: list[str]) -> list[str]:
    return ["", f"# Other {what} of the file:", *(f"# {_quoted(name)}" for name in names)] if names else []


def _short(markers: Markers, name: str) -> str:
    """Remove the person's prefix of a marker name, so that one mapping serves all persons, unless that is ambiguous."""
    short = name.rpartition(":")[2]
    ends = [other for other in dict.fromkeys(markers.names) if other.rpartition(":")[2].casefold() == short.casefold()]
    return short if len(ends) == 1 else name


def _line(name: str, found: str, others: list[str]) -> str:
    """Write a line of the mapping; where no name was found, a comment with the most similar of the other names."""
    if found:
        return f"{name} = {toml_text(found)}"
    return f"# {name} = {_quoted(nearest(name, others))}"


def _quoted(name: str) -> str:
    """Quote a name for a comment of one line."""
    return toml_text(printable(name).replace("\n", "?"))
