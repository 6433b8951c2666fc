"""Marker positions in a .trc file (Motion Analysis, OpenSim): five lines of header, then columns.

The package trc-data-reader is not used: its version 0.4.1 splits lines at any white space, so that an empty cell, with
which a .trc writes a gap, silently shifts all markers to its right by one place.
"""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError, warn_input
from motions.formats.gaps import zeros_as_gaps
from motions.formats.marker_files.export_table import number_or_none
from motions.formats.text import Line, numbers, plain_lines, read_export, with_points
from motions.landmarks.markers import Markers

_EXPORT = "Export the trial again as .trc"
_HEADER_LINES = 4
"""Number of header lines: path, keys, values, names of the markers. Below X1 Y1 Z1 ... come the data. Blank lines are
not counted."""

_AXIS = re.compile(r"[XYZ]\d*", re.IGNORECASE)

_SEPARATORS = ("\t", ";", ",")
"""Separators of cells, the surest first; blanks separate the cells of a line without any of them."""


def read_trc(path: Path) -> Markers:
    """Read all markers of a .trc file; an empty cell, nan or a marker at exactly (0, 0, 0) is a gap.

    Tabs, semicolons, commas or blanks separate the cells. Raise InputError if the file is no .trc file, does not have
    the markers that its header says, or ends within a line. Issue an InputWarning if it does not have the frames that
    its header says: programs that crop a trial often leave that number unchanged.
    """
    file = str(path)
    text = read_export(path, _EXPORT)
    numbered = [Line(number, _cells(line)) for number, line in enumerate(plain_lines(text), 1)]
    lines = [line for line in numbered if any(line.cells)]
    if len(lines) <= _HEADER_LINES or not text.lstrip().startswith("PathFileType"):
        raise InputError(file, None, "this is not a .trc file", _EXPORT)
    header, names = dict(zip(lines[1].cells, lines[2].cells, strict=False)), lines[_HEADER_LINES - 1]
    if not names.cells[0].startswith("Frame"):
        raise InputError(file, names.number, "the line does not start with Frame#", _EXPORT)
    said = _said(header, "NumMarkers", file)
    markers = _marker_names(names, said, file)
    if said != len(markers):
        raise _miscounted(file, "NumMarkers", said, len(markers), "markers")
    has_axes = any(_AXIS.fullmatch(cell) for cell in lines[_HEADER_LINES].cells)
    table = _table(lines[_HEADER_LINES + has_axes :], 2 + 3 * len(markers), file)
    said = _said(header, "NumFrames", file)
    if said != len(table):
        found = _miscounted(file, "NumFrames", said, len(table), "frames")
        if len(table) < said and not text.endswith(("\n", "\r")):
            raise found
        warn_input(found)
    positions = table[:, 2:].T.reshape(len(markers), 3, -1)
    rate_hz = number_or_none(header.get("DataRate", ""))
    return Markers(file, tuple(markers), zeros_as_gaps(positions), header.get("Units"), {}, rate_hz)


def _cells(line: str) -> list[str]:
    """Split a line into cells; tabs, semicolons and commas may enclose an empty cell, which blanks cannot."""
    separator = next((one for one in _SEPARATORS if one in line), None)
    if separator == "," and len(line.split()) > 1 and not any(_has_separators(word) for word in line.split()):
        separator = None
    return [cell.strip() for cell in line.split(separator)]


def _has_separators(word: str) -> bool:
    """Check whether commas in a word separate cells: a number has at most one, inside."""
    return word.count(",") > 1 or word.startswith(",") or word.endswith(",")


def _marker_names(names: Line, said: int, file: str) -> list[str]:
    """Return the names over the X columns (Frame#, Time, IJ, '', '', PX, '', '', ...), or side by side.

    Raise InputError if they do not stand over every third column, and are not as many as the header says.
    """
    row = names.cells[2:]
    while row and not row[-1]:
        row.pop()
    named = [name for name in row if name]
    if row[::3] != named and len(named) != said:
        cause = (
            f"the header says {said} markers (NumMarkers), and {len(named)} names do not stand over every third column"
        )
        raise InputError(file, names.number, cause, "Each name is followed by two empty cells, all separated by tabs")
    return named


def _table(rows: list[Line], columns: int, file: str) -> Float[np.ndarray, "frames columns"]:
    """Read the data as numbers; an empty cell between two tabs keeps its place."""
    if not rows:
        raise InputError(file, None, "there are no frames under the header", _EXPORT)
    for number, cells in rows:
        if any(cells[columns:]):
            cause = f"the line has more than the {columns} cells of the header"
            raise InputError(file, number, cause, "Look for a marker without a name, or a surplus tab")
        if len(cells) < columns:
            cause = f"the line has {len(cells)} cells and ends before the {columns} of the header"
            remedy = "Export it again if it was cut off; a gap is an empty cell with its tab"
            raise InputError(file, number, cause, remedy)
    cells = with_points([line.cells[:columns] for line in rows])
    return numbers(np.array(cells, dtype=object), [line.number for line in rows], file)


def _said(header: dict[str, str], key: str, file: str) -> int:
    """Read a count from the header; some programs write it with decimals."""
    said = re.fullmatch(r"(\d{1,9})(?:[.,]0*)?", header.get(key, ""))
    if said is None:
        raise InputError(file, 3, f"the header does not say {key}", _EXPORT)
    return int(said[1])


def _miscounted(file: str, key: str, said: int, found: int, what: str) -> InputError:
    cause = f"the header says {said} {what} ({key}) but the file has {found}"
    return InputError(file, 3, cause, f"Export it again if it was cut off; if it is complete, write {found} for {key}")
