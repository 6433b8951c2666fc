"""Positions of landmarks under one header: columns IJ_x_mm, IJ_y_mm, ... or similar, one row per posture or frame.

Commas, semicolons, tabs or blanks separate the cells. A column has a marker, x, y or z in either case, and the unit if
the file says it: ``IJ_x_mm``, ``IJ X [mm]``, ``IJ.x (m)``, ``IJ x / mm``, ``IJ_mm_x``, ``IJ_x``, ``IJX``, ``X_IJ``.
Without letters, ``IJ_1``, ``IJ_2`` and ``IJ_3`` are x, y and z, as MATLAB writes the columns of a matrix. Titles may
stand above the header, a line of units below it.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from motions.errors import InputError
from motions.formats.marker_files.export_table import Block, ExportTable, markers_of, read_export_table
from motions.formats.text import Line
from motions.landmarks.mapping import MARKERS, UNIT_WORDS, UNITS_MM
from motions.landmarks.markers import Markers

ROW_COLUMNS = ("subject", "motion", "posture", "side")
"""Columns with information about a row."""

_UNIT = r"(?:[\s_./]*(?:in\s+)?[\[(]?(?P<unit>" + "|".join((*UNITS_MM, *UNIT_WORDS)) + r")[\])]?)?"
_OURS = "|".join(MARKERS)
_FORMS = tuple(
    re.compile(form, re.IGNORECASE)
    for form in (
        r"(?P<name>.*[^\s_.:-])[\s_.:-]+(?P<unit>mm|cm)[\s_.:-]+(?P<axis>[xyz])",
        rf"(?P<name>.*[^\s_.:/-])(?:[\s_.:/-]+[\[(]?|[\[(])(?P<axis>[xyz])[\])]?{_UNIT}",
        rf"(?P<name>{_OURS})(?P<axis>[xyz]){_UNIT}",
        rf"(?P<axis>[xyz])[\s_.:(-]*(?P<name>{_OURS})\)?{_UNIT}",
    )
)
"""Forms of a column's name. The last two, with nothing between name and axis, and with the axis first, are only for
landmarks with their names here."""

_NUMBERED = re.compile(r"(?P<name>.*[^\s_])_(?P<axis>[123])(?P<unit>)")
_AXES = {"1": "x", "2": "y", "3": "z"}

_FEWEST_NUMBERED = 4
"""Minimum number of markers with three numbered columns in a table of positions: the markers of the thorax."""

_BONES = ("clavicle", "scapula", "humerus")
"""Bones whose x, y and z are angles (``clavicle_y``), even if the unit is left out."""


def holds_positions(columns: Iterable[str]) -> bool:
    """Check whether a table with these columns holds positions and, unlike a motion file, no angles of the clavicle."""
    columns = list(columns)
    return "clavicle_y_deg" not in columns and len(_coordinates(columns)) > 1  # a title may end in x, y or z


def has_header(head: ExportTable) -> bool:
    """Check whether a line of the head is the header of positions, with or without titles above it."""
    return any(holds_positions(line.cells) for line in head.lines)


def read_landmark_table(path: Path) -> Markers:
    """Read all markers of the file; an empty cell or nan is a gap.

    Raise InputError if a marker has only some of its coordinates, a column appears twice or units differ.
    """
    table = read_export_table(path)
    place, header = next((k, line) for k, line in enumerate(table.lines) if holds_positions(line.cells))
    _check_names(table.file, header.number, header.cells)
    found = _coordinates(header.cells)
    unit = _unit(table.file, header.number, found.values())
    names = dict.fromkeys(match["name"] for match in found.values())
    blocks = [_block(table, header.number, header.cells, name, found) for name in names]
    data = [line for line in table.lines[place + 1 :] if any(line.cells)]
    if unit is None and data and (unit := _unit_below(data[0], blocks)):
        data = data[1:]
    markers = markers_of(table, blocks, data, len(header.cells), unit, None)
    return replace(markers, rows=_rows(header.cells, [line.cells for line in data]))


def _coordinates(columns: Sequence[str]) -> dict[str, re.Match[str]]:
    """Return the columns that are coordinates; numbered ones only if no column has a letter for the axis."""
    found = {column: match for column in columns if (match := _coordinate(column))}
    if found:
        return found
    numbered = {column: match for column in columns if (match := _NUMBERED.fullmatch(column))}
    names = [match["name"] for match in numbered.values()]
    whole = {name for name in names if names.count(name) == len(_AXES)}
    return {c: m for c, m in numbered.items() if m["name"] in whole} if len(whole) >= _FEWEST_NUMBERED else {}


def _coordinate(column: str) -> re.Match[str] | None:
    match = next((match for form in _FORMS if (match := form.fullmatch(column))), None)
    return None if match is None or match["name"].casefold() in _BONES else match


def _axis(match: re.Match[str]) -> str:
    return _AXES.get(match["axis"], match["axis"].lower())


def _check_names(file: str, line: int, columns: list[str]) -> None:
    repeated = [name for name in columns if name and columns.count(name) > 1]
    if repeated:
        raise InputError(file, line, f"column {repeated[0]!r} stands there twice", "Rename or remove one of them")


def _unit(file: str, line: int, found: Iterable[re.Match[str]]) -> str | None:
    """Return the unit of all columns; None if none says it. Raise InputError if units differ."""
    units = list(dict.fromkeys((match["unit"] or "").lower() for match in found))
    if len(units) != 1:
        cause = f"positions are in {' and in '.join(unit or 'no unit' for unit in units)}"
        raise InputError(
            file, line, cause, "Name the columns MARKER_x_mm, MARKER_y_mm and MARKER_z_mm, all in one unit"
        )
    return units[0] or None


def _unit_below(line: Line, blocks: list[Block]) -> str | None:
    """Return the unit in the line under the header if it is a line of units; None if it is a row of numbers."""
    words = {line.cells[k].strip("[]()").lower() for block in blocks for k in block.columns if k < len(line.cells)}
    (word,) = words if len(words) == 1 else ("",)
    return word if word in (*UNITS_MM, *UNIT_WORDS) else None


def _block(table: ExportTable, line: int, columns: list[str], name: str, found: dict[str, re.Match[str]]) -> Block:
    own = [column for column, match in found.items() if match["name"] == name]
    places = []
    for axis in "xyz":
        mine = [column for column in own if _axis(found[column]) == axis]
        if len(mine) != 1:
            like = own[0][: found[own[0]].start("axis")] + axis + own[0][found[own[0]].end("axis") :]
            cause = f"column {like} is missing" if not mine else f"columns {' and '.join(mine)} are one coordinate"
            raise InputError(table.file, line, cause, "Give x, y and z of each marker, once")
        places.append(columns.index(mine[0]))
    return Block(name, (places[0], places[1], places[2]))


def _rows(columns: list[str], data: Sequence[list[str]]) -> dict[str, list[str]]:
    """Return the information about each row, by the names in ``ROW_COLUMNS``."""
    places = {column.casefold(): k for k, column in reversed(list(enumerate(columns)))}
    return {key: [cells[places[key]] for cells in data] for key in ROW_COLUMNS if key in places}
