"""Names of the columns of a motion file, and columns that are not read although they were likely meant to be."""

import re
from collections.abc import Iterable

from motions.table import ANGLES, LANDMARKS

ANGLE_COLUMNS = tuple(f"{angle}_deg" for angle in ANGLES)
REQUIRED = ("subject", "motion", "posture", "humerus_elevation_deg", *ANGLE_COLUMNS)

SIDE = "side"
"""Optional column with the measured side, ``left`` or ``right``. After reading, every shoulder is a right one."""

SIDE_MEASURED = "side_measured"
"""Extra column that keeps the measured side after the angles were mirrored to a right shoulder."""

ESTIMATED = "clavicle_x_estimated"
"""Extra column: ``yes`` where the clavicle's axial rotation is an estimate and not measured."""

ESTIMATE_ZERO = "clavicle_x_zero_at_deg"
"""Extra column: elevation at which this estimate is 0; empty where the humerus was not measured."""

SCAPULA_ROTATED = "scapula_frame"
"""Extra column: name of the mean rotation that converted the scapula frame through AA to the frame through AC."""

CLAVICLE_PLACED = "clavicle_from"
"""Extra column: description of how SC or AC was estimated, where it is an estimated landmark."""

SLIPPED = "slipped"
"""Extra column: landmark outliers of the posture."""

ANGLES_FROM_LANDMARKS = "angles_from_landmarks"
"""Extra column: ``yes`` where the angles were computed from the landmarks whose positions are in the same row, so that
both have the same errors."""

SCAPULA_FROM = "scapula_from"
"""Extra column: states that a cluster, under which skin moves over bone, carried the scapula, and its calibration."""

HUMERUS_PLACED = "humerus_from"
"""Extra column: description of how GH was estimated if nobody marked it; the elevation of the arm depends on GH."""

PLANE, AXIAL, MOTION_ANGLE = "humerus_plane_deg", "humerus_axial_deg", "motion_angle_deg"
"""Extra columns: plane of elevation and axial rotation of the humerus, and the angle that a motion changes."""

PLANE_OF_ELEVATION = "plane_of_elevation_deg"
"""Extra column: plane of elevation of each posture, for the prediction by the rhythm."""

OPTIONAL = frozenset(
    (
        *(SIDE, SIDE_MEASURED, ESTIMATED, ESTIMATE_ZERO, SCAPULA_ROTATED, CLAVICLE_PLACED, SLIPPED),
        *(ANGLES_FROM_LANDMARKS, SCAPULA_FROM, HUMERUS_PLACED, PLANE, AXIAL, MOTION_ANGLE, PLANE_OF_ELEVATION),
    )
)
"""Columns that a motion file may lack, and that change results or checks where it has them."""

_NEARLY = re.compile(rf"({'|'.join(LANDMARKS)})[ _]?[xyz]([ _]?[(\[]?(mm|cm|m|inch)[)\]]?)?", re.IGNORECASE)
"""Name of a position column in another form than ``SC_x_mm``."""


def landmark_columns(name: str) -> tuple[str, str, str]:
    """Return the names of the three columns of a landmark's position in the thorax frame, mm."""
    return f"{name}_x_mm", f"{name}_y_mm", f"{name}_z_mm"


LANDMARK_COLUMNS = tuple(column for name in LANDMARKS for column in landmark_columns(name))
KNOWN = frozenset((*REQUIRED, *LANDMARK_COLUMNS, SIDE))
"""Columns that are interpreted; all other columns are extra."""


def not_read(columns: Iterable[str]) -> list[tuple[str, str]]:
    """List cause and remedy for columns that were likely meant as positions, or as an optional column in small letters.

    ``columns`` are the extra columns of the files.
    """
    columns, found = tuple(columns), []
    if nearly := [name for name in columns if _NEARLY.fullmatch(name.strip())]:
        found.append((nearly, "Positions are SC_x_mm, SC_y_mm, SC_z_mm and so on, in mm"))
    meant = {name: name.casefold() for name in columns if name not in OPTIONAL and name.casefold() in OPTIONAL}
    if meant:
        found.append((meant, f"Write {', '.join(meant.values())} in small letters"))
    return [(f"column {', '.join(names)} is not read", remedy) for names, remedy in found]
