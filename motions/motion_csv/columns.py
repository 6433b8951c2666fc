"""The names of the columns of a motion file."""

from motions.table import ANGLES, LANDMARKS

ANGLE_COLUMNS = tuple(f"{angle}_deg" for angle in ANGLES)
REQUIRED = ("subject", "motion", "posture", "humerus_elevation_deg", *ANGLE_COLUMNS)

SIDE = "side"
"""Optional: which shoulder was measured, `left` or `right`. What is read is always a right shoulder."""

SIDE_MEASURED = "side_measured"
"""The extra column that keeps the side once the angles are those of a right shoulder."""


def landmark_columns(name: str) -> tuple[str, str, str]:
    """Name the three columns of a landmark's position in the thorax frame, mm."""
    return f"{name}_x_mm", f"{name}_y_mm", f"{name}_z_mm"


LANDMARK_COLUMNS = tuple(column for name in LANDMARKS for column in landmark_columns(name))
KNOWN = frozenset((*REQUIRED, *LANDMARK_COLUMNS, SIDE))
"""Every column that is interpreted; all others are extra."""
