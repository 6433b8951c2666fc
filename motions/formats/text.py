"""Text as programs of laboratories write it: encoding, separators, decimal commas and numbers."""

import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from motions.errors import InputError
from motions.files import read_bytes, refuse_binary
from motions.motion_csv.cells import NOT_MEASURED, to_number
from motions.motion_csv.rows import cells_of_lines

SEPARATORS = ("\t", ";", "|", ",")
"""Separators of the cells of a line; beside another separator, a comma may be a decimal comma."""

_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""Byte order marks at the beginning of a spreadsheet's ``Unicode text``."""

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


class Line(NamedTuple):
    """Line of a table: its number in the file, from 1, and its cells without surrounding blanks."""

    number: int
    cells: list[str]


def read_export(path: Path, remedy: str) -> str:
    """Read a text file in UTF-8, UTF-16 (with its mark) or else Windows-1252, in which older programs write accents.

    Raise InputError if the file cannot be read or is not text; ``remedy`` says how to export it.
    """
    text = decoded(read_bytes(path))
    refuse_binary(text, path, remedy)
    return text


def decoded(content: bytes) -> str:
    """Decode text in UTF-8, UTF-16 or Windows-1252, or in Latin-1 if a byte is undefined in Windows-1252."""
    if content.startswith(_UTF_16):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1") if _UNDEFINED & set(content) else content.decode("cp1252")


_UNDEFINED = {0x81, 0x8D, 0x8F, 0x90, 0x9D}
"""Bytes that are undefined in Windows-1252."""


def plain_lines(text: str) -> list[str]:
    """Split a text at its line ends only; ``str.splitlines`` splits it at other characters too.

    Files that went through two systems have two carriage returns before a line feed.
    """
    return re.split(r"\r*\n|\r", text)


def separator_of(line: str) -> str | None:
    """Find the separator of the cells of a line among SEPARATORS; None for blanks.

    Commas are the separator if there are more of them than cells between tabs or semicolons: then they are no decimal
    ones.
    """
    outside = re.sub(r'"[^"]*"', "", line)
    count = {separator: outside.count(separator) for separator in SEPARATORS}
    surest = max("\t;|", key=lambda separator: count[separator])
    if count[surest] and count[","] <= count[surest] + 1:
        return surest
    return max(count, key=lambda separator: count[separator]) if any(count.values()) else None


def split_lines(text: str, separator: str, file: str) -> list[Line]:
    """Split every line into cells, blank lines included. Raise InputError if quotation marks are not closed."""
    whole = io.StringIO(text.replace("\r\r\n", "\n"), newline="")
    return [Line(start, [cell.strip() for cell in cells]) for start, cells in cells_of_lines(whole, file, separator)]


def with_points(rows: Iterable[Sequence[str]]) -> list[list[str]]:
    """Write decimal commas as points, if no cell has a point: beside points a comma may separate thousands."""
    cells = [list(row) for row in rows]
    if any("." in cell for row in cells for cell in row):
        return cells
    return [[cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell for cell in row] for row in cells]


def is_number(cell: str) -> bool:
    """Check whether a cell is a number, with a point or a comma."""
    try:
        to_number(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def numbers(cells: np.ndarray, rows: Sequence[int], file: str) -> Float[np.ndarray, "rows columns"]:
    """Read the cells as numbers, NaN if one is empty or says 'not measured'. Raise InputError at the first bad cell.

    ``rows`` are the lines of the file in which the rows of the cells stand.
    """
    table = np.empty(cells.shape)
    for place, line in enumerate(cells):
        for column, cell in enumerate(line):
            text = str(cell).strip()
            try:
                table[place, column] = np.nan if text.lower() in NOT_MEASURED else to_number(text)
            except ValueError:
                remedy = "Write numbers with a decimal point, nothing between thousands; a gap is an empty cell or nan"
                raise InputError(file, rows[place], f"{text!r} is not a number", remedy) from None
            if np.isinf(table[place, column]):
                raise InputError(file, rows[place], f"{text!r} is infinite", "Empty the cell of what was not measured")
    return table
