"""Trajectories in a table of Vicon (Nexus, Tracker: File > Export ASCII), or with its two header rows.

The section has a line ``Trajectories``, one with the rate, names of markers over every third column,
``Frame, Sub Frame, X, Y, Z``, their units, and one row per frame up to a blank line. Other sections (``Devices``,
``Model Outputs``) may stand before and after it, and velocities (``X'``) beside the positions. A table without the
first two lines is read as well, and so are two rows of names and of x, y, z as pandas writes them.
"""

from pathlib import Path

from motions.errors import InputError
from motions.formats.marker_files.export_table import Block, ExportTable, markers_of, number_or_none, read_export_table
from motions.formats.text import Line
from motions.landmarks.markers import Markers

SECTION = "trajectories"
_OTHER_SECTIONS = ("devices", "joints", "segments", "model outputs", "events", "trajectory count")
_FRAME = ("frame", "field #", "field")

_MOST_LEADING = 3
"""Maximum number of columns before the first marker: numbers of the frame, and its time."""

_FEWEST = 4
"""Minimum number of markers under a row without a column of frames: the markers of the thorax."""

_EXPORT = "Export it again from Nexus as ASCII, with Trajectories switched on, or as .c3d"


def is_vicon(head: ExportTable) -> bool:
    """Check whether a file begins as an export of Vicon, or has its two header rows."""
    words = head.first_words()
    begins = next((word for word in words if word), "")
    return begins in (SECTION, *_OTHER_SECTIONS) or any(_is_axes(line) for line in head.lines[1:])


def read_vicon(path: Path) -> Markers:
    """Read the trajectories, their names, unit and rate. Raise InputError if there are none or the header is broken."""
    table = read_export_table(path)
    words = table.first_words()
    start = words.index(SECTION) if SECTION in words else 0
    axes = next((k for k in range(start + 1, len(table.lines)) if _is_axes(table.lines[k])), None)
    if axes is None or (start == 0 and words[0] in _OTHER_SECTIONS):
        there = ", ".join(dict.fromkeys(word for word in words if word in _OTHER_SECTIONS)) or "no rows of positions"
        raise InputError(table.file, None, f"this Vicon export has {there} and no Trajectories", _EXPORT)
    header = table.lines[axes]
    blocks = _blocks(table.file, table.lines[axes - 1], header)
    unit = _unit(table, axes + 1, blocks)
    data = _data(table, axes + (1 if unit is None else 2))
    rate = table.lines[start + 1].cells if words[start] == SECTION else []
    return markers_of(table, blocks, data, len(header.cells), unit, number_or_none(rate[0]) if rate else None)


def _is_axes(line: Line) -> bool:
    """Check whether this is the row Frame, Sub Frame, X, Y, Z, ..., or a row of nothing but X, Y, Z, ..."""
    cells = [cell.casefold() for cell in line.cells]
    lead = next((k for k in range(_MOST_LEADING + 1) if cells[k : k + 3] == ["x", "y", "z"]), None)
    if lead is None:
        return False
    rest = [cell for cell in cells[lead:] if cell]
    return cells[0] in _FRAME or (len(rest) >= 3 * _FEWEST and rest == ["x", "y", "z"] * (len(rest) // 3))


def _blocks(file: str, names: Line, axes: Line) -> list[Block]:
    """Make a block for each name, with the first X, Y and Z under it; X', Y' and Z' are velocities."""
    lead = [cell.casefold() for cell in axes.cells].index("x")
    before = [*names.cells[:1], *names.cells]
    starts = [k for k, name in enumerate(names.cells) if name and k >= lead and (k == lead or name != before[k])]
    if starts[:1] != [lead]:
        raise InputError(file, names.number, "the first marker has no name over its X", _EXPORT)
    return [
        _block(file, axes, names.cells[start], start, end)
        for start, end in zip(starts, [*starts[1:], len(axes.cells)], strict=True)
    ]


def _block(file: str, axes: Line, name: str, start: int, end: int) -> Block:
    under = [cell.casefold() for cell in axes.cells[start:end]]
    if under[:3] != ["x", "y", "z"] or under.count("x") > 1:
        cause = f"under marker {name!r} stand {', '.join(axes.cells[start:end]) or 'no columns'}, not X, Y and Z"
        raise InputError(file, axes.number, cause, "Give each marker its name over its X; " + _EXPORT)
    return Block(name, (start, start + 1, start + 2))


def _unit(table: ExportTable, row: int, blocks: list[Block]) -> str | None:
    """Return the unit of the positions; None if the row already holds numbers."""
    cells = table.lines[row].cells if row < len(table.lines) else []
    if cells and cells[0]:  # the number of a frame
        return None
    units = list(dict.fromkeys(cells[k] for block in blocks for k in block.columns if k < len(cells)))
    if len(units) > 1:
        cause = f"positions are in {' and in '.join(unit or 'no unit' for unit in units)}"
        raise InputError(table.file, table.lines[row].number, cause, _EXPORT)
    return units[0] if units else ""


def _data(table: ExportTable, start: int) -> list[Line]:
    """Return the rows up to a blank line."""
    end = next((k for k in range(start, len(table.lines)) if not any(table.lines[k].cells)), len(table.lines))
    return table.lines[start:end]
