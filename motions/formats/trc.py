"""Marker positions in a .trc file (Motion Analysis, OpenSim): five lines of header, then tab-separated columns.

Not read with trc-data-reader: its 0.4.1 splits lines at any white space, so that an empty cell, which is how a .trc
writes a gap, shifts all markers to its right by one place without a word.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError
from motions.files import read_text
from motions.formats.gaps import zeros_as_gaps
from motions.formats.text import numbers
from motions.landmarks.markers import Markers

_EXPORT = "Export the trial again as .trc"
_NAMES_LINE, _FIRST_DATA_LINE = 4, 6
"""From 1: the names of the markers; below X1 Y1 Z1 ... come the data, mostly after a blank line."""


def read_trc(path: Path) -> Markers:
    """Read all markers of a .trc file; an empty cell, nan or a marker at exactly (0, 0, 0) is a gap.

    InputError if the file is none, or if it has not the frames and markers that its header says.
    """
    file = str(path)
    lines = read_text(path, _EXPORT).splitlines()
    if len(lines) < _FIRST_DATA_LINE or not lines[0].startswith("PathFileType"):
        raise InputError(file, None, "this is not a .trc file", _EXPORT)
    header = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    names = [name.strip() for name in lines[_NAMES_LINE - 1].split("\t")]
    if names[0] != "Frame#":
        raise InputError(file, _NAMES_LINE, "the line does not start with Frame#", _EXPORT)
    markers = _marker_names(names, file)
    table = _table(lines, 2 + 3 * len(markers), file)
    _check_count(header, "NumMarkers", len(markers), "markers", file)
    _check_count(header, "NumFrames", len(table), "frames", file)
    positions = table[:, 2:].T.reshape(len(markers), 3, -1)
    return Markers(file, tuple(markers), zeros_as_gaps(positions), header.get("Units"), {})


def _marker_names(names: list[str], file: str) -> list[str]:
    """The names over the X columns: Frame#, Time, IJ, '', '', PX, '', '', ..."""
    row = names[2:]
    while row and not row[-1]:
        row.pop()
    if any(row[place] for place in range(len(row)) if place % 3) or not all(row[::3]):
        cause = "the names of the markers do not stand over every third column"
        raise InputError(file, _NAMES_LINE, cause, "Each name is followed by two empty cells, all separated by tabs")
    return row[::3]


def _table(lines: list[str], columns: int, file: str) -> Float[np.ndarray, "frames columns"]:
    """The data as numbers; an empty cell between two tabs keeps its place."""
    rows = [row for row, line in enumerate(lines, 1) if row >= _FIRST_DATA_LINE and line.strip()]
    if not rows:
        raise InputError(file, None, "there are no frames under the header", _EXPORT)
    table = []
    for row in rows:
        cells = lines[row - 1].split("\t")
        if any(cell.strip() for cell in cells[columns:]):
            cause = f"the line has more than the {columns} cells of the header"
            raise InputError(file, row, cause, "Look for a marker without a name, or a surplus tab")
        if len(cells) < columns:
            cause = f"the line has {len(cells)} cells and ends before the {columns} of the header"
            raise InputError(file, row, cause, "Export it again if it was cut off; a gap is an empty cell with its tab")
        table.append(cells[:columns])
    return numbers(np.array(table, dtype=object), rows, file)


def _check_count(header: dict[str, str], key: str, found: int, what: str, file: str) -> None:
    """InputError if the header says another number than the file has."""
    said = header.get(key, "")
    if not said.isdigit():
        raise InputError(file, 3, f"the header does not say {key}", _EXPORT)
    if int(said) != found:
        cause = f"the header says {said} {what} ({key}) but the file has {found}"
        remedy = f"Export it again if it was cut off; if it is complete, write {found} for {key}"
        raise InputError(file, 3, cause, remedy)
