"""Names of the columns of a motion file."""

from motions.table import ANGLES, LANDMARKS

ANGLE_COLUMNS = tuple(f"{angle}_deg" for angle in ANGLES)
REQUIRED = ("subject", "motion", "posture", "humerus_elevation_deg", *ANGLE_COLUMNS)

SIDE = "side"
"""Optional column with the measured side, ``left`` or ``right``. After reading, every shoulder is a right one."""

SIDE_MEASURED = "side_measured"
"""Extra column that keeps the measured side after the angles were mirrored to a right shoulder."""


def landmark_columns(name: str) -> tuple[str, str, str]:
    """Return the names of the three columns of a landmark's position in the thorax frame, mm."""
    return f"{name}_x_mm", f"{name}_y_mm", f"{name}_z_mm"


LANDMARK_COLUMNS = tuple(column for name in LANDMARKS for column in landmark_columns(name))
KNOWN = frozenset((*REQUIRED, *LANDMARK_COLUMNS, SIDE))
"""Columns that are interpreted; all other columns are extra."""
