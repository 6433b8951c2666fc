"""Table of marker positions as capture software exports it: the parts that all kinds of headers share."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from motions.errors import InputError
from motions.files import read_bytes
from motions.formats.gaps import zeros_as_gaps
from motions.formats.text import (
    Line,
    decoded,
    numbers,
    plain_lines,
    read_export,
    separator_of,
    split_lines,
    with_points,
)
from motions.landmarks.markers import Markers

ENDINGS = (".csv", ".tsv", ".txt")
"""Extensions of the files that may hold such a table."""

EXPORT = "Export it again as CSV, TSV, .c3d or .trc"

_SAYS_SEPARATOR = re.compile(r'\ufeff?"?sep=(.)"?', re.IGNORECASE)
"""First line in which a spreadsheet names the separator."""

_HEAD_BYTES, _HEAD_LINES = 2**18, 40
"""Bytes and lines read to tell the kinds of tables apart: a header has fewer lines, of a few hundred names each."""


class ExportTable(NamedTuple):
    """Lines of a text file, blank ones included."""

    file: str
    lines: list[Line]

    def columns(self) -> list[str]:
        """Return the cells of the first line that is not blank and does not name the separator."""
        return next((line.cells for line in self.lines if any(line.cells)), [])

    def first_words(self) -> list[str]:
        """Return the first cell of every line, without case."""
        return [line.cells[0].casefold() if line.cells else "" for line in self.lines]


class Block(NamedTuple):
    """Marker, and the columns of its x, y and z."""

    name: str
    columns: tuple[int, int, int]


def read_head(path: Path) -> ExportTable:
    """Read the first lines of a text file, which tell the kind of table. Raise InputError if it cannot be read."""
    text, separator = _separated(decoded(read_bytes(path, _HEAD_BYTES)))
    lines = plain_lines(text)[:_HEAD_LINES]
    return ExportTable(str(path), [Line(k, _cells(line, separator)) for k, line in enumerate(lines, 1)])


def read_export_table(path: Path) -> ExportTable:
    """Read all lines of a text file as cells. Raise InputError if the file is no text."""
    text, separator = _separated(read_export(path, EXPORT))
    return ExportTable(str(path), split_lines(text, separator, str(path)))


def markers_of(
    table: ExportTable,
    blocks: Sequence[Block],
    data: Sequence[Line],
    width: int,
    unit: str | None,
    rate_hz: float | None,
) -> Markers:
    """Read the positions in the columns of the blocks; ``width`` is the number of cells of the header.

    Raise InputError if there are no rows, a line has more or fewer cells, or a cell is no number.
    """
    if not data:
        raise InputError(table.file, None, "there are no rows under the header", EXPORT)
    columns = [column for block in blocks for column in block.columns]
    for line in data:
        _check_width(table.file, line, max(columns) + 1, width)
    cells = with_points([[line.cells[column] for column in columns] for line in data])
    values = numbers(np.array(cells, dtype=object), [line.number for line in data], table.file)
    positions = zeros_as_gaps(values.T.reshape(len(blocks), 3, -1))
    return Markers(table.file, tuple(block.name for block in blocks), positions, unit, {}, rate_hz)


def number_or_none(text: str) -> float | None:
    """Read the number that a header says, such as a rate; None if it says none."""
    match = re.match(r"\d+(?:[.,]\d+)?", text)
    return float(match[0].replace(",", ".")) if match and len(match[0]) < 20 else None


def _separated(text: str) -> tuple[str, str]:
    """Return the text and its separator.

    The first line may name the separator. Else it is the separator of the line with most separators, because a title
    has none. If only blanks separate the cells, they are replaced by tabs.
    """
    lines = plain_lines(text)[:_HEAD_LINES]
    if said := _SAYS_SEPARATOR.fullmatch(lines[0].rstrip(",;\t ")):
        return text[len(lines[0]) :], said[1]
    found = [(line.count(separator), separator) for line in lines if (separator := separator_of(line)) is not None]
    if found:
        return text, max(found)[1]
    return re.sub(r"(?<=\S)[ ]+(?=\S)", "\t", text), "\t"


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _check_width(file: str, line: Line, needed: int, width: int) -> None:
    if len(line.cells) < needed:
        cause = f"the line has {len(line.cells)} cells and ends before the {width} of the header"
        remedy = "Export it again if it was cut off; a gap is an empty cell with its separator"
        raise InputError(file, line.number, cause, remedy)
    if any(line.cells[width:]):
        cause = f"the line has {len(line.cells)} cells where the header has {width}"
        remedy = "Look for decimal commas in a table with commas between its cells, or for a marker without a name"
        raise InputError(file, line.number, cause, remedy)
