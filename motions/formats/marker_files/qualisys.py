"""Trajectories in a TSV file of Qualisys Track Manager (docs.qualisys.com, Motion data (.tsv)).

The file has lines of a key and its value (``NO_OF_FRAMES``, ``NO_OF_MARKERS``, ``FREQUENCY``, ``DATA_INCLUDED``),
``MARKER_NAMES`` with the names, optionally ``TRAJECTORY_TYPES`` and names of the columns, then x, y and z of each
marker in mm, optionally after number and time of the frame.
"""

from collections.abc import Sequence
from pathlib import Path

from motions.errors import InputError, warn_input
from motions.formats.marker_files.export_table import Block, ExportTable, markers_of, number_or_none, read_export_table
from motions.formats.text import Line
from motions.landmarks.markers import Markers

UNIT = "mm"
"""Unit that the program writes; the file does not say it."""

_NAMES, _INCLUDED = "marker_names", "data_included"
_KEYS = (
    "file_version",
    "no_of_frames",
    "no_of_cameras",
    "no_of_markers",
    "no_of_bodies",
    "frequency",
    _NAMES,
    _INCLUDED,
)
_EXPORT = "Export it again from QTM as TSV, with 3D data and the header, or as .c3d"


def is_qualisys(head: ExportTable) -> bool:
    """Check whether a file begins as an export of Qualisys."""
    return head.first_words()[:1] != [] and head.first_words()[0] in _KEYS


def read_qualisys(path: Path) -> Markers:
    """Read the trajectories, their names and rate.

    Raise InputError if the file holds other data than 3D, or if its header is broken. Issue an InputWarning if the
    header says another number of frames.
    """
    table = read_export_table(path)
    words = table.first_words()
    said = {word: line.cells[1:] for word, line in zip(words, table.lines, strict=True) if word}
    included = said.get(_INCLUDED, ["3D"])[:1]
    if _NAMES not in words or included != ["3D"]:
        holds = f"holds {' '.join(included)} data" if included != ["3D"] else "has no line MARKER_NAMES"
        raise InputError(table.file, None, f"this Qualisys export {holds}", _EXPORT)
    row = words.index(_NAMES)
    names = _names(table, row, said)
    data = [line for line in _frames(table.lines[row + 1 :], 3 * len(names)) if _is_data(line)]
    lead = _lead(table, data, len(names))
    blocks = [Block(name, _columns(lead + 3 * k)) for k, name in enumerate(names)]
    markers = markers_of(table, blocks, data, lead + 3 * len(names), UNIT, _number(said, "frequency"))
    frames = _number(said, "no_of_frames")
    if frames is not None and frames != len(data):
        cause = f"the header says {frames:g} frames (NO_OF_FRAMES) but the file has {len(data)}"
        warn_input(InputError(table.file, words.index("no_of_frames") + 1, cause, "Export it again if it was cut off"))
    return markers


def _names(table: ExportTable, row: int, said: dict[str, list[str]]) -> list[str]:
    """Return the names of the markers. Raise InputError if the header says another number."""
    names = list(table.lines[row].cells[1:])
    while names and not names[-1]:
        names.pop()
    count = _number(said, "no_of_markers")
    if not names or (count is not None and count != len(names)):
        cause = f"the header says {0 if count is None else count:g} markers (NO_OF_MARKERS) but has {len(names)} names"
        raise InputError(table.file, table.lines[row].number, cause, _EXPORT)
    return names


def _frames(lines: Sequence[Line], width: int) -> list[Line]:
    """Return the lines with content, and lines of separators alone between them, in which no marker was seen."""
    known = [k for k, line in enumerate(lines) if any(line.cells)]
    return [line for line in lines[: max(known, default=-1) + 1] if any(line.cells) or len(line.cells) >= width]


def _is_data(line: Line) -> bool:
    """Check whether this is a row of numbers, and not TRAJECTORY_TYPES or the names of the columns."""
    word = line.cells[0].casefold()
    return word not in ("trajectory_types", "frame") and not any(
        cell.endswith((" X", " Y", " Z")) for cell in line.cells
    )


def _lead(table: ExportTable, data: list[Line], markers: int) -> int:
    """Count the columns before the positions: none, or the frame's number and time."""
    if not data:
        return 0
    cells = data[0].cells
    ends_in_tab = all(len(line.cells) == len(cells) and not line.cells[-1] for line in data)
    lead = len(cells) - 3 * markers
    if lead in (1, 3) and ends_in_tab:
        lead -= 1
    if lead not in (0, 2):
        cause = f"the line has {len(data[0].cells)} cells where {markers} markers have {3 * markers}"
        raise InputError(table.file, data[0].number, cause, _EXPORT)
    return lead


def _columns(first: int) -> tuple[int, int, int]:
    return first, first + 1, first + 2


def _number(said: dict[str, list[str]], key: str) -> float | None:
    return number_or_none((said.get(key) or [""])[0])
