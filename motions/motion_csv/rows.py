"""Reading of a CSV file as rows of text with their line numbers, and errors of a file as a whole."""

import csv
import difflib
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from motions.errors import InputError, listed
from motions.files import read_text
from motions.motion_csv.columns import ANGLE_COLUMNS, KNOWN, REQUIRED, SIDE, SIDE_MEASURED, landmark_columns
from motions.table import LANDMARKS

_SAVE_AS = "Save the table as comma-separated text (CSV, UTF-8) with decimal points"
_CONVERTED = (".c3d", ".trc", ".mot", ".sto")
"""Extensions of the files that ``girdle convert`` turns into motion files."""

_SAYS_SEPARATOR = "sep="
"""Beginning of a first line in which a spreadsheet names the separator."""

_SEPARATORS = {",": "comma", ";": "semicolon"}
"""Separators of cells, and their names in messages. Spreadsheets of countries with a decimal comma write semicolons; a
comma in a number is then a decimal comma."""

_OF_NUMBERS = ("_deg", "_mm")
"""Endings of the names of columns with decimal numbers."""

_NEAR = 0.93
"""Minimum similarity (``difflib``) of a suggested column: it allows a wrong letter, but no missing unit."""

_MOST_NAMED = 20
"""Maximum number of columns in a message."""


@dataclass(frozen=True, slots=True)
class Row:
    """Line of data: file as the user named it, line counted from 1, and the text under each column."""

    file: str
    line: int
    cells: dict[str, str]

    def error(self, cause: str, remedy: str) -> InputError:
        """Make an error about this line, which names the subject, because the whole subject is left out."""
        return InputError(self.file, self.line, f"subject {self.cells['subject']!r}: {cause}", remedy)


@dataclass(frozen=True, slots=True)
class CsvTable:
    """CSV file: the names of its columns, each once, and its rows that are not blank."""

    columns: tuple[str, ...]
    rows: list[Row]


def iterate_rows(path: Path) -> Iterator[Row]:
    """Yield the rows of a motion file that are not blank, one at a time.

    Raise InputError if the file as a whole cannot be used; rows yielded before this must then not be used either.
    """
    if path.suffix.lower() in _CONVERTED:
        cause = f"a {path.suffix.lower()} file is no motion file"
        raise InputError(str(path), None, cause, f"Make one of it: girdle convert {path} {path.stem}.csv")
    yield from _table_rows(path, _check_header)[1]


def read_table(path: Path, check_header: Callable[[list[str], str, int], None] | None = None) -> CsvTable:
    """Read any CSV file.

    Raise InputError if the file as a whole cannot be used. ``check_header`` replaces the default check of the header.
    """
    columns, rows = _table_rows(path, check_header or _check_names)
    return CsvTable(tuple(name for name in columns if name), list(rows))


def _table_rows(path: Path, check_header: Callable[[list[str], str, int], None]) -> tuple[list[str], Iterator[Row]]:
    file, text = str(path), _lines(path)  # closed below on an error: a stored error would keep the file open
    try:
        begin, separator = _begin(text)
        lines = _split(chain(begin, text), file, separator)
        header_line, header = next(lines, (None, []))
        if header_line is None:
            raise InputError(file, None, "the file is empty", "Give a file with a header and rows")
        columns = [name.strip() for name in header]
        check_header(columns, file, header_line)
    except InputError:
        text.close()
        raise

    def rows() -> Iterator[Row]:
        line = None
        with closing(text):
            for line, cells in lines:
                yield _row(file, line, columns, cells, separator)
        if line is None:
            raise InputError(file, None, "there are no rows under the header", "Add one row for each posture")

    return columns, rows()


def _lines(path: Path) -> Generator[str, None, None]:
    """Yield the lines of a text file with their line ends, one at a time."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            for line in file:
                if "\0" in line:
                    break
                yield line
            else:
                return
    except (OSError, UnicodeDecodeError):
        pass
    read_text(path, _SAVE_AS)  # raises the error with cause and line


def _begin(text: Iterator[str]) -> tuple[list[str], str]:
    """Read to the end of the header line, and find the separator; a line that names the separator is made blank."""
    begin: list[str] = []
    for line in text:
        says_separator = line.lstrip('"').lower().startswith(_SAYS_SEPARATOR)
        begin.append("\n" if says_separator else line)
        if line.strip() and not says_separator:
            break
    return begin, max(_SEPARATORS, key=begin[-1].count) if begin else ","


def _split(text: Iterator[str], file: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each line that is not blank, with the number of the line on which they start.

    The standard ``csv`` reader is used rather than pandas, because only ``csv`` gives the line of a row after blank
    lines or line breaks in quotes.
    """
    for start, cells in cells_of_lines(text, file, separator):
        if any(map(str.strip, cells)):
            yield start, cells


def cells_of_lines(text: Iterable[str], file: str, separator: str = ",") -> Iterator[tuple[int, list[str]]]:
    """Split every line, blank ones included, and yield its cells with the number of the line on which it starts.

    Raise InputError if quotation marks are not closed.
    """
    reader = csv.reader(text, delimiter=separator, strict=True)
    while True:
        start = reader.line_num + 1
        try:
            cells = next(reader, None)
        except csv.Error as error:
            cause = f"the line cannot be split into cells ({error})"
            raise InputError(file, start, cause, "Look for a quotation mark that is not closed") from error
        if cells is None:
            return
        yield start, cells


def _check_header(columns: list[str], file: str, line: int) -> None:
    """Raise InputError for a missing or repeated column, another separator, or a landmark without all coordinates."""

    def error(cause: str, remedy: str) -> InputError:
        return InputError(file, line, cause, remedy)

    missing = [name for name in REQUIRED if name not in columns]
    for separator, word in (("\t", "tabs"), ("|", "bars"), (" ", "blanks")):
        if any(separator in name and sum(one in name for one in missing) > 1 for name in columns):
            raise error(f"the cells are separated by {word}, not by commas or semicolons", _SAVE_AS)
    if missing:
        raise error(*_missing(missing, columns))
    _check_names(columns, file, line)
    for name in LANDMARKS:
        absent = [column for column in landmark_columns(name) if column not in columns]
        if 0 < len(absent) < 3:
            remedy = "Give x, y and z of the landmark, or none of them"
            raise error(f"landmark {name} has no column {' and no column '.join(absent)}", remedy)
    if SIDE in columns and SIDE_MEASURED in columns:
        cause = f"there are both {SIDE} and {SIDE_MEASURED}, so the angles were mirrored before"
        raise error(cause, f"Remove the column {SIDE}")


def _missing(missing: list[str], columns: Sequence[str]) -> tuple[str, str]:
    """Write cause and remedy for missing columns: similar names to rename, or that cells of an angle may be empty."""
    several = len(missing) > 1
    cause = f"columns {', '.join(missing)} are missing" if several else f"column {missing[0]} is missing"
    by_letters = {_letters(name): name for name in columns if name not in KNOWN}
    near = [
        by_letters[one]
        for name in missing
        for one in difflib.get_close_matches(_letters(name), by_letters, n=1, cutoff=_NEAR)
    ]
    if near:
        return cause, f"Rename {', '.join(dict.fromkeys(near))}"
    if "model" in columns and {"clavicle_y_simulated_deg", "conoid_length_mm_model"} & set(columns):
        return cause, "This is a table of results: give the motion file, which run.json beside it names"
    if not set(ANGLE_COLUMNS) & set(columns) and any(name.endswith(("_x_mm", "_x_cm", "_x_m")) for name in columns):
        return cause, "These are positions of landmarks: girdle convert makes a motion file of them"
    angle = any(name.endswith("_deg") for name in missing)
    others = [name for name in columns if name and name not in KNOWN]
    add = f"Add {'them' if several else 'it'} to the header"
    add += f", or rename {'theirs' if several else 'its own'} among {listed(others, _MOST_NAMED)}" if others else ""
    return cause, f"{add}; leave the cells of an angle empty where it was not measured" if angle else add


def _letters(name: str) -> str:
    """Return the letters and digits of a name in lower case."""
    return "".join(c for c in name.lower() if c.isalnum())


def _check_names(columns: list[str], file: str, line: int) -> None:
    """Raise InputError if two columns have the same name."""
    repeated = [name for name in columns if name and columns.count(name) > 1]
    if repeated:
        cause = f"column {repeated[0]!r} stands there twice"
        raise InputError(file, line, cause, "Rename or remove one of them")


def _row(file: str, line: int, columns: list[str], cells: list[str], separator: str) -> Row:
    """Return the cells under their columns, stripping blanks round cells that are interpreted."""
    surplus, word = any(map(str.strip, cells[len(columns) :])), _SEPARATORS[separator]
    if len(cells) < len(columns) or surplus:
        cause = f"the line has {len(cells)} cells where the header has {len(columns)}"
        remedy = (
            f"Remove the surplus {word}{'; decimals are written with a point' if separator == ',' else ''}"
            if surplus
            else f"Complete the line; a cell that was not measured is empty but keeps its {word}"
        )
        raise InputError(file, line, cause, remedy)
    named = {name: cell.strip() if name in KNOWN else cell for name, cell in zip(columns, cells, strict=False)}
    if separator != ",":
        numbers = {name: cell for name, cell in named.items() if name.endswith(_OF_NUMBERS) and "." not in cell}
        named |= {name: cell.replace(",", ".") for name, cell in numbers.items()}
    if "" in named:
        if any(cell.strip() for name, cell in zip(columns, cells, strict=False) if not name):
            raise InputError(
                file, line, "there is a cell under a column without a name", "Name the column or remove it"
            )
        del named[""]
    return Row(file, line, named)
