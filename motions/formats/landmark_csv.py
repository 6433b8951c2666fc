"""Positions of landmarks in a CSV file: columns IJ_x_mm, IJ_y_mm, ... (or _m, _cm), one row a posture or frame."""

import re
from pathlib import Path

import numpy as np

from motions.errors import InputError
from motions.formats.text import numbers
from motions.landmarks.markers import Markers
from motions.motion_csv.rows import read_table

ROW_COLUMNS = ("subject", "motion", "posture", "side")
"""What a file may say of each row."""

_COORDINATE = re.compile(r"(?P<name>.+)_(?P<axis>[xyz])_(?P<unit>mm|cm|m)")


def holds_positions(columns: list[str]) -> bool:
    """Tell whether a CSV file with these columns is one of positions: a motion file has the clavicle's angles too."""
    return "clavicle_y_deg" not in columns and any(_COORDINATE.fullmatch(column) for column in columns)


def read_landmark_csv(path: Path) -> Markers:
    """Read all markers of the file; an empty cell or nan is a gap.

    InputError if a marker has only some of its coordinates, columns stand there twice or units differ.
    """
    file = str(path)
    table = read_table(path)
    found = {column: match for column in table.columns if (match := _COORDINATE.fullmatch(column))}
    names = list(dict.fromkeys(match["name"] for match in found.values()))
    units = list(dict.fromkeys(match["unit"] for match in found.values()))
    if len(units) != 1:
        cause = f"positions are in {' and in '.join(units)}" if units else "there are no columns such as IJ_x_mm"
        raise InputError(file, 1, cause, "Name the columns MARKER_x_mm, MARKER_y_mm and MARKER_z_mm, all in one unit")
    wanted = [f"{name}_{axis}_{units[0]}" for name in names for axis in "xyz"]
    for column in wanted:
        if column not in found:
            raise InputError(file, 1, f"column {column} is missing", "Give x, y and z of each marker")
    cells = np.array([[row.cells[column] for column in wanted] for row in table.rows], dtype=object)
    values = numbers(cells, [row.line for row in table.rows], file)
    rows = {
        column: [row.cells[column].strip() for row in table.rows] for column in ROW_COLUMNS if column in table.columns
    }
    return Markers(file, tuple(names), values.T.reshape(len(names), 3, -1), units[0], rows)
