"""Conversion of one row of a motion file to one posture of a right shoulder."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.motion_csv.cells import (
    Side,
    angle_in,
    check_marks,
    elevation_in,
    measured_in,
    name_in,
    side_in,
    whole_number_in,
)
from motions.motion_csv.columns import ANGLE_COLUMNS, KNOWN, SIDE, SIDE_MEASURED, landmark_columns
from motions.motion_csv.rows import Row
from motions.table import FEWEST_ANGLES, LANDMARKS

MIRROR_ANGLES = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
"""Signs that mirror angles: M R M with M = diag(-1, 1, 1), the reflection in the sagittal plane, negates the y and z
angles of R."""

MIRROR_POSITION = np.array([-1.0, 1.0, 1.0])
"""Signs that mirror a position: x of the thorax frame is to the right."""

_FIRST_COLUMNS = tuple((name, landmark_columns(name)[0]) for name in LANDMARKS)


@dataclass(frozen=True, slots=True)
class Posture:
    """Posture of a right shoulder (mirrored if ``side`` is left), and the row that it comes from.

    Angles are in degrees, positions in mm in the thorax frame; NaN means 'not measured'. A landmark without columns in
    the file of the row has no entry.
    """

    row: Row
    side: Side
    subject: str
    motion: str
    number: int
    humerus_elevation_deg: float
    angles_deg: Float[np.ndarray, "6"]
    landmarks_mm: dict[str, Float[np.ndarray, "3"]]

    @property
    def extra(self) -> dict[str, str]:
        """Cells that are not interpreted, in the order of the file, and the side if the file gives it."""
        extra = {SIDE_MEASURED: self.side} if SIDE in self.row.cells else {}
        return extra | {column: cell for column, cell in self.row.cells.items() if column not in KNOWN}


def posture_from_row(row: Row) -> Posture:
    """Read the posture in one row. Raise InputError if a cell cannot be read or too few angles were measured."""
    check_marks(row)
    side = side_in(row)
    left = side == "left"
    angles_deg = _angles_deg(row)
    landmarks_mm = {name: _position_mm(row, name) for name, column in _FIRST_COLUMNS if column in row.cells}
    return Posture(
        row=row,
        side=side,
        subject=name_in(row, "subject"),
        motion=name_in(row, "motion"),
        number=whole_number_in(row, "posture"),
        humerus_elevation_deg=elevation_in(row),
        angles_deg=angles_deg * MIRROR_ANGLES if left else angles_deg,
        landmarks_mm={
            name: position_mm * MIRROR_POSITION if left else position_mm for name, position_mm in landmarks_mm.items()
        },
    )


def _angles_deg(row: Row) -> Float[np.ndarray, "6"]:
    """Read the six angles in degrees, not mirrored. Raise InputError if fewer than three were measured."""
    angles_deg = [angle_in(row, column) for column in ANGLE_COLUMNS]
    measured = sum(not math.isnan(angle) for angle in angles_deg)
    if measured == 0:
        raise row.error("no angle was measured", "Delete the row or fill it in, and the subject is taken")
    if measured < FEWEST_ANGLES:
        cause = f"{measured} of the six angles measured are too few: the girdle has three degrees of freedom"
        raise row.error(cause, "Fill in at least three angles or delete the row")
    return np.array(angles_deg)


def _position_mm(row: Row, name: str) -> Float[np.ndarray, "3"]:
    """Read the position of a landmark in mm, not mirrored. Raise InputError if only some coordinates were measured."""
    position_mm = np.array([measured_in(row, column) for column in landmark_columns(name)])
    if np.isnan(position_mm).any() and not np.isnan(position_mm).all():
        cause = f"landmark {name} has only some of its coordinates"
        raise row.error(cause, "Fill in x, y and z of the landmark, or empty all three cells")
    return position_mm
