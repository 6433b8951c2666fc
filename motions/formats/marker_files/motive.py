"""Markers in a CSV file of Motive (OptiTrack; docs.optitrack.com, Data Export: CSV).

The first line holds keys and values (``Format Version``, ``Length Units``, ``Export Frame Rate``). Above the row
``Frame, Time (Seconds), X, Y, Z`` stand rows with the type of each column's object, its name, and Position or Rotation.
Only columns of type Marker are measured: rigid bodies and bones have the places where the program expects a marker.
"""

from pathlib import Path

from motions.errors import InputError
from motions.formats.marker_files.export_table import Block, ExportTable, markers_of, number_or_none, read_export_table
from motions.formats.text import Line
from motions.landmarks.markers import Markers

_FIRST = "format version"
_MARKER, _TYPES = "marker", ("marker", "rigid body", "bone", "rigid body marker", "bone marker", "asset marker")
_WITHOUT_NAME = "unlabeled"
"""Beginning of the name of a marker that nobody named."""

_UNITS = {"millimeters": "mm", "centimeters": "cm", "meters": "m"}
_EXPORT = "Export it again from Motive with the header and with Markers switched on"


def is_motive(head: ExportTable) -> bool:
    """Check whether a file begins as an export of Motive."""
    return head.first_words()[:1] == [_FIRST]


def read_motive(path: Path) -> Markers:
    """Read the markers, their names, unit and rate. Raise InputError if there are none or the header is broken."""
    table = read_export_table(path)
    said = _said(table.lines[0])
    axes = next((k for k, line in enumerate(table.lines) if _is_axes(line)), None)
    if axes is None:
        raise InputError(table.file, None, "there is no row Frame, Time (Seconds), X, Y, Z", _EXPORT)
    header = [line for line in table.lines[1:axes] if any(line.cells)]
    kinds = next((k for k, line in enumerate(header) if _type_cells(line)), None)
    if kinds is None or kinds + 1 >= len(header):
        raise InputError(table.file, table.lines[axes].number, "no row above it says what is a Marker", _EXPORT)
    blocks = _blocks(table, header[kinds], header[kinds + 1], header[-1], table.lines[axes])
    unit = said.get("length units", "")
    rate = number_or_none(said.get("export frame rate", said.get("capture frame rate", "")))
    data = [line for line in table.lines[axes + 1 :] if any(line.cells)]
    return markers_of(
        table, blocks, data, len(table.lines[axes].cells), _UNITS.get(unit.casefold(), unit) or None, rate
    )


def _said(line: Line) -> dict[str, str]:
    """Return the values in the first line by their keys."""
    return {key.casefold(): value for key, value in zip(line.cells[::2], line.cells[1::2], strict=False)}


def _is_axes(line: Line) -> bool:
    return len(line.cells) > 2 and line.cells[0].casefold() == "frame" and line.cells[1].casefold().startswith("time")


def _type_cells(line: Line) -> list[str]:
    """Return the types of the columns, if this row has them."""
    return [cell for cell in line.cells[2:] if cell.casefold() in _TYPES]


def _blocks(table: ExportTable, types: Line, names: Line, kinds: Line, axes: Line) -> list[Block]:
    """Make a block for each X, Y, Z of type Marker and kind Position."""

    def is_position(k: int, axis: str) -> bool:
        cells = [line.cells[k].casefold() if k < len(line.cells) else "" for line in (types, kinds, axes)]
        return cells == [_MARKER, "position", axis]

    width = len(axes.cells)
    starts = [k for k in range(2, width - 2) if all(is_position(k + step, axis) for step, axis in enumerate("xyz"))]
    blocks = [Block(names.cells[k] if k < len(names.cells) else "", (k, k + 1, k + 2)) for k in starts]
    there = [kind for kind in dict.fromkeys(_type_cells(types)) if kind.casefold() != _MARKER]
    if not blocks or (there and all(block.name.casefold().startswith(_WITHOUT_NAME) for block in blocks)):
        cause = f"this Motive export has {', '.join(there)} and no positions of Markers" + (
            " with names" if blocks else ""
        )
        raise InputError(table.file, types.number, cause, _EXPORT)
    return blocks
