"""Reading of the three free coordinates of the girdle, AC_y, AC_z and TS_x (thesis 3.2.2)."""

from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from motions.errors import InputError
from motions.formats.text import numbers
from motions.landmarks.mapping import UNITS_MM
from motions.motion_csv.cells import ELEVATION_REMEDY, LARGEST_ANGLE_DEG
from motions.motion_csv.columns import landmark_columns
from motions.motion_csv.reading import read_motions
from motions.motion_csv.rows import CsvTable, read_table
from motions.table import Motions

FREE_COORDINATES = ("AC_y", "AC_z", "TS_x")
"""Free coordinates in the order of every vector of them, mm, thorax frame."""

COORDINATE_COLUMNS = tuple(f"{name}_mm" for name in FREE_COORDINATES)

_DRIVEN = "driven"
"""Name of a motion that the file does not name."""

_ELEVATION = "humerus_elevation_deg"


def read_free_coordinates(path: Path) -> Motions:
    """Read postures with y and z of AC, and x of TS; the other coordinates of these landmarks may be NaN.

    The file is a motion file with positions of AC and TS, or any CSV with the columns AC_y_mm, AC_z_mm and TS_x_mm (or
    _cm, _m), in the thorax frame of a right shoulder, and optionally subject, motion, posture and
    humerus_elevation_deg. Such a CSV has no angles: they are NaN. Raise InputError if a coordinate is missing.
    """
    table = read_table(path)
    if {*landmark_columns("AC"), *landmark_columns("TS"), "subject", "clavicle_y_deg"} <= set(table.columns):
        return _checked(read_motions(path), path)
    return _of_table(table, path)


def coordinates_mm(motions: Motions) -> Float[np.ndarray, "3 postures"]:
    """Return AC_y, AC_z and TS_x from the positions of AC and TS."""
    AC, TS = motions.landmarks_mm["AC"], motions.landmarks_mm["TS"]
    return np.stack([AC[:, 1], AC[:, 2], TS[:, 0]])


def _checked(motions: Motions, path: Path) -> Motions:
    missing = np.flatnonzero(np.isnan(coordinates_mm(motions)).any(axis=0))
    if len(missing):
        k = missing[0]
        cause = f"AC or TS was not measured in {motions.subject[k]}, {motions.motion[k]} {motions.posture[k]}"
        raise InputError(str(path), None, cause, "Delete the posture, or give its AC and TS")
    return motions


def _of_table(table: CsvTable, path: Path) -> Motions:
    file, columns = str(path), set(table.columns)
    unit = next((u for u in UNITS_MM if all(f"{name}_{u}" in columns for name in FREE_COORDINATES)), None)
    if unit is None:
        cause = f"columns {', '.join(COORDINATE_COLUMNS)} are needed"
        remedy = "Give the three coordinates, or a motion file with positions of AC and TS; angles take --inverse"
        raise InputError(file, 1, cause, remedy)
    rows = table.rows
    lines = [row.line for row in rows]
    cells = np.array([[row.cells[f"{name}_{unit}"] for name in FREE_COORDINATES] for row in rows], dtype=object)
    mm = UNITS_MM[unit] * numbers(cells, lines, file)
    if np.isnan(mm).any():
        line = lines[int(np.argmax(np.isnan(mm).any(axis=1)))]
        raise InputError(file, line, "a coordinate is empty", "Give all three, or delete the row")
    nan = np.full(len(rows), np.nan)
    subject = [row.cells.get("subject", "").strip() or path.stem for row in rows]
    motion = [row.cells.get("motion", "").strip() or _DRIVEN for row in rows]
    return Motions(
        subject=np.array(subject),
        motion=np.array(motion),
        posture=_postures(table, subject, motion, file),
        humerus_elevation_deg=_elevation_deg(table, file),
        angles_deg=np.full((len(rows), 6), np.nan),
        landmarks_mm={"AC": np.stack([nan, mm[:, 0], mm[:, 1]], axis=1), "TS": np.stack([mm[:, 2], nan, nan], axis=1)},
        extra=pd.DataFrame(index=pd.RangeIndex(len(rows))),
    )


def _postures(table: CsvTable, subject: list[str], motion: list[str], file: str) -> np.ndarray:
    """Return the numbers of the postures; where the file has none, number the rows of a motion from 1.

    Raise InputError if a motion has the same number twice, or a cell is no whole number.
    """
    counts: dict[tuple[str, str], int] = {}
    found, lines = [], dict[tuple[str, str, int], int]()
    for row, *whose in zip(table.rows, subject, motion, strict=True):
        key = (whose[0], whose[1])
        counts[key] = counts.get(key, 0) + 1
        text = row.cells.get("posture", "").strip() or str(counts[key])
        if not text.isascii() or not text.isdecimal():
            raise InputError(file, row.line, f"posture is {text!r}", "Number the postures of a motion 1, 2, 3, ...")
        if (*key, int(text)) in lines:
            cause = f"posture {text} of motion {key[1]!r} stands here and in line {lines[(*key, int(text))]}"
            raise InputError(file, row.line, cause, "Delete one of the two rows or give it another number")
        lines[(*key, int(text))] = row.line
        found.append(int(text))
    return np.array(found, int)


def _elevation_deg(table: CsvTable, file: str) -> Float[np.ndarray, " rows"]:
    lines = [row.line for row in table.rows]
    cells = np.array([[row.cells.get(_ELEVATION, "")] for row in table.rows], dtype=object)
    found = numbers(cells, lines, file)[:, 0]
    wrong = (found < 0.0) | (found > LARGEST_ANGLE_DEG)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(file, lines[k], f"{_ELEVATION} is {found[k]:g}", ELEVATION_REMEDY)
    return found
