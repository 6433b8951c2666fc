"""Marker positions in a .trc file (Motion Analysis, OpenSim): five lines of header, then tab-separated columns.

Not read with trc-data-reader: its 0.4.1 splits lines at any white space, so that an empty cell, which is how a .trc
writes a gap, shifts all markers to its right by one place without a word.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError, warn_input
from motions.files import read_text
from motions.formats.gaps import zeros_as_gaps
from motions.formats.text import numbers
from motions.landmarks.markers import Markers

_EXPORT = "Export the trial again as .trc"
_NAMES_LINE, _FIRST_DATA_LINE = 4, 6
"""From 1: the names of the markers; below X1 Y1 Z1 ... come the data, mostly after a blank line."""


def read_trc(path: Path) -> Markers:
    """Read all markers of a .trc file; an empty cell, nan or a marker at exactly (0, 0, 0) is a gap.

    InputError if the file is none, has not the markers that its header says, or ends within a line. InputWarning if it
    has not the frames that its header says: programs that crop a trial often leave that number as it was.
    """
    file = str(path)
    text = read_text(path, _EXPORT)
    lines = text.splitlines()
    if len(lines) < _FIRST_DATA_LINE or not lines[0].startswith("PathFileType"):
        raise InputError(file, None, "this is not a .trc file", _EXPORT)
    header = dict(zip(*map(_header_cells, lines[1:3]), strict=False))
    names = [name.strip() for name in lines[_NAMES_LINE - 1].split("\t")]
    if names[0] != "Frame#":
        raise InputError(file, _NAMES_LINE, "the line does not start with Frame#", _EXPORT)
    markers = _marker_names(names, file)
    table = _table(lines, 2 + 3 * len(markers), file)
    said = _said(header, "NumMarkers", file)
    if said != len(markers):
        raise _miscounted(file, "NumMarkers", said, len(markers), "markers")
    said = _said(header, "NumFrames", file)
    if said != len(table):
        found = _miscounted(file, "NumFrames", said, len(table), "frames")
        if len(table) < said and not text.endswith("\n"):
            raise found
        warn_input(found)
    positions = table[:, 2:].T.reshape(len(markers), 3, -1)
    return Markers(file, tuple(markers), zeros_as_gaps(positions), header.get("Units"), {})


def _header_cells(line: str) -> list[str]:
    """The words, or numbers, of the header: between tabs, where an empty one keeps its place; else between blanks."""
    return [cell.strip() for cell in line.split("\t")] if "\t" in line else line.split()


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


def _said(header: dict[str, str], key: str, file: str) -> int:
    said = header.get(key, "")
    if not said.isdigit():
        raise InputError(file, 3, f"the header does not say {key}", _EXPORT)
    return int(said)


def _miscounted(file: str, key: str, said: int, found: int, what: str) -> InputError:
    cause = f"the header says {said} {what} ({key}) but the file has {found}"
    return InputError(file, 3, cause, f"Export it again if it was cut off; if it is complete, write {found} for {key}")
