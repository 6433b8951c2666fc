"""Named points in a CSV file: landmarks or attachments of a bone, one row per point."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError
from motions.formats.text import numbers
from motions.landmarks.mapping import UNITS_MM
from motions.motion_csv.rows import Row, read_table

SHAPE = "shape"
"""Column with the shape that the points of one name form together."""


@dataclass(frozen=True)
class NamedPoints:
    """Points of one name, in the order of the file, mm, in the file's own frame."""

    points_mm: Float[np.ndarray, "3 points"]
    shape: str
    """Shape; empty if the file does not say it."""
    line: int
    """Line of the first point."""


def read_named_points(path: Path, name_column: str) -> dict[str, NamedPoints]:
    """Read points by name from the columns ``name_column``, x_mm, y_mm, z_mm (or _cm, _m) and optionally shape.

    Raise InputError if a cell is empty or no number, or if the rows of one name have two shapes.
    """
    table, file = read_table(path), str(path)
    unit = next((u for u in UNITS_MM if all(f"{axis}_{u}" in table.columns for axis in "xyz")), None)
    if name_column not in table.columns or unit is None:
        cause = f"columns {name_column}, x_mm, y_mm and z_mm are needed"
        raise InputError(file, 1, cause, "Give one row a point, in mm, cm (x_cm) or m (x_m)")
    lines = [row.line for row in table.rows]
    cells = np.array([[row.cells[f"{axis}_{unit}"] for axis in "xyz"] for row in table.rows], dtype=object)
    mm = UNITS_MM[unit] * numbers(cells, lines, file)
    if np.isnan(mm).any():
        line = lines[int(np.argmax(np.isnan(mm).any(axis=1)))]
        raise InputError(file, line, "a coordinate of the point is empty", "Give x, y and z of each point")
    rows: dict[str, list[int]] = {}
    for k, row in enumerate(table.rows):
        rows.setdefault(_name(row, name_column, file), []).append(k)
    return {
        name: NamedPoints(mm[own].T, _shape([table.rows[k] for k in own], name, file), lines[own[0]])
        for name, own in rows.items()
    }


def read_landmarks(path: Path) -> dict[str, Float[np.ndarray, "3"]]:
    """Read one point per name from the column ``landmark``. Raise InputError if a name appears twice."""
    found = read_named_points(path, "landmark")
    for name, one in found.items():
        if one.points_mm.shape[1] > 1:
            cause = f"landmark {name!r} stands there {one.points_mm.shape[1]} times"
            raise InputError(str(path), one.line, cause, "Give each landmark once: the mean of its measurements")
    return {name: one.points_mm[:, 0] for name, one in found.items()}


def _name(row: Row, column: str, file: str) -> str:
    name = row.cells[column].strip()
    if not name:
        raise InputError(file, row.line, f"the cell of {column} is empty", f"Write the {column}'s name in every row")
    return name


def _shape(rows: list[Row], name: str, file: str) -> str:
    words = {row.cells.get(SHAPE, "").strip() for row in rows} - {""}
    if len(words) > 1:
        cause = f"{name!r} is {' and '.join(sorted(words))}"
        raise InputError(file, rows[0].line, cause, "Give all points of a name one shape")
    return words.pop() if words else ""
