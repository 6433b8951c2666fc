"""Angles in OpenSim's .mot and .sto files: lines of key=value up to ``endheader``, then columns under their names."""

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from motions.errors import InputError
from motions.files import atomic_write
from motions.formats.text import numbers, plain_lines, read_export, with_points

_END, _UNIT = "endheader", "indegrees"
_ALIASES = {"datarows": "nrows", "nr": "nrows", "datacolumns": "ncolumns", "nc": "ncolumns"}


@dataclass(frozen=True, eq=False)
class AngleTable:
    """Header and columns of a .mot or .sto file, with angles in degrees; NaN means not measured."""

    file: str
    header: dict[str, str]
    columns: dict[str, Float[np.ndarray, " rows"]]
    unit_line: int | None = None
    """Line of the file that says inDegrees."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())))


def read_mot(path: Path) -> AngleTable:
    """Read the file, and convert all columns but time to degrees, as inDegrees in its header says.

    Raise InputError if the file is of another kind, does not say inDegrees, or does not have the rows and columns that
    its header says.
    """
    file = str(path)
    lines = plain_lines(read_export(path, "Export it from OpenSim"))
    ends = [place for place, line in enumerate(lines) if line.strip().lower() == _END]
    if not ends:
        raise InputError(
            file, None, f"there is no line {_END}: this is not a .mot or .sto file", "Export it from OpenSim"
        )
    body = lines[ends[0] + 1 :]
    said = [_key_value(line) for line in lines[: ends[0]]]
    header = dict(said)
    rows = [ends[0] + 2 + place for place, line in enumerate(body) if line.strip()]
    if len(rows) < 2:
        raise InputError(file, None, f"there are no rows under {_END}", "Write the names of the columns, then the rows")
    separator = _separator(lines[rows[0] - 1])
    names = _cells(lines[rows[0] - 1], separator)
    for name in names:
        if names.count(name) > 1:
            raise InputError(file, rows[0], f"column {name!r} stands there twice", "Rename or remove one of them")
    cells = [_cells(lines[row - 1], separator) for row in rows[1:]]
    for row, line in zip(rows[1:], cells, strict=True):
        if len(line) != len(names):
            cause = f"the line has {len(line)} cells where there are {len(names)} columns"
            raise InputError(file, row, cause, "Write nan for what was not measured")
    _check_count(header, "nrows", len(cells), file)
    _check_count(header, "ncolumns", len(names), file)
    table = numbers(np.array(cells if separator == "," else with_points(cells)), rows[1:], file)
    degrees = _degrees(header, file)
    columns = {name: table[:, place] * (1.0 if name == "time" else degrees) for place, name in enumerate(names)}
    unit_line = next(number for number, (key, _) in enumerate(said, 1) if key == _UNIT)
    return AngleTable(file, header, columns, unit_line)


def write_mot(table: AngleTable, path: Path) -> None:
    """Write the file, whole or not at all; reading it gives bitwise equal numbers.

    OpenSim skips lines of the header that it does not know. Raise InputError if the file cannot be written.
    """
    frame = pd.DataFrame(table.columns)
    known = {"version": "1", "nRows": str(len(frame)), "nColumns": str(len(frame.columns)), "inDegrees": "yes"}
    header = "".join(f"{key}={value}\n" for key, value in (known | table.header).items())
    buffer = io.StringIO()
    frame.to_csv(buffer, sep="\t", index=False, na_rep="nan", lineterminator="\n")
    atomic_write(path, f"{path.stem}\n{header}{_END}\n{buffer.getvalue()}")


def _separator(names: str) -> str | None:
    """Find the separator by the line of the names: None for blanks or tabs, as in OpenSim, else a spreadsheet's."""
    return None if len(names.split()) > 1 else next((one for one in ",;" if one in names), None)


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip() for cell in line.split(separator)]


def _key_value(line: str) -> tuple[str, str]:
    """Split a line of the header at =, blanks or tabs; OpenSim and SIMM use different keys, which are unified."""
    key, value = (*re.split(r"[ \t=]+", line.strip(), maxsplit=1), "")[:2]
    key = key.lower()
    return _ALIASES.get(key, key), value.strip()


def _check_count(header: dict[str, str], key: str, found: int, file: str) -> None:
    """Raise InputError if the header says another number; it need not say any."""
    said = header.get(key)
    if said is not None and said != str(found):
        cause = f"the header says {key}={said} but the file has {found}"
        remedy = f"Export it again if it was cut off; if it is complete, write {key}={found}"
        raise InputError(file, None, cause, remedy)


def _degrees(header: dict[str, str], file: str) -> float:
    """Return the number of degrees in the file's unit of angle. Raise InputError if the header does not say it."""
    said = header.get(_UNIT, "").lower()
    if said not in ("yes", "no"):
        cause = "the header does not say whether angles are in degrees"
        raise InputError(file, None, cause, f"Write inDegrees=yes or inDegrees=no above {_END}")
    return 1.0 if said == "yes" else float(np.degrees(1.0))
