"""What the published rhythm predicts of measured motions from the bones as measured with the arm lowest."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.table import Motions

PLANE_COLUMN = "plane_of_elevation_deg"
"""A column of a motion file that says the plane of each posture."""

PLANES_DEG = {
    "abduction": 0.0,
    "frontal_elevation": 0.0,
    "scapular_elevation": 40.0,
    "forward_flexion": 90.0,
    "sagittal_elevation": 90.0,
}
"""Plane of elevation by the name of the motion, 0 abduction, 90 forward flexion. The scapular plane is 40 degrees in
front of the frontal one (Ludewig 2009, doi 10.2106/JBJS.G.01483)."""

HORIZONTAL = "horizontal_flexion"
"""Its ``motion_angle_deg`` is the plane, but for its sign: studies count it to either side."""


@dataclass(frozen=True)
class Predicted:
    """The rhythm's angles of every posture."""

    angles_deg: Float[np.ndarray, "postures 6"]
    """ANGLES; NaN where the plane or the elevation is not known."""
    scored: Bool[np.ndarray, " postures"]
    """Predicted, and not among those that gave the angles at rest."""


def planes_of_elevation_deg(motions: Motions) -> Float[np.ndarray, " postures"]:
    """Read the plane of elevation of each posture from its column or, without a number there, map it from the motion.

    Of ``horizontal_flexion`` it is the size of ``motion_angle_deg``. NaN where nothing says it.
    """
    read, angle = (_column(motions, name) for name in (PLANE_COLUMN, "motion_angle_deg"))
    mapped = np.array([PLANES_DEG.get(name, np.nan) for name in motions.motion.tolist()])
    mapped = np.where(motions.motion == HORIZONTAL, np.abs(angle), mapped)
    return np.where(np.isfinite(read), read, mapped)


def _column(motions: Motions, name: str) -> Float[np.ndarray, " postures"]:
    if name not in motions.extra:
        return np.full(len(motions.posture), np.nan)
    return np.asarray(pd.to_numeric(motions.extra[name], errors="coerce"), float)


def predict_from_lowest(motions: Motions, measured_rest: bool = True) -> Predicted:
    """Predict ANGLES of every posture by ``girdle_angles_deg`` from the subject's angles at rest.

    At rest are the subject's postures with the lowest elevation; several are averaged, and an angle not measured there
    is that of ``REST_DEG``. They are not scored. Without ``measured_rest`` all subjects rest as ``REST_DEG`` says, and
    the same postures are scored.
    """
    plane, elevation = planes_of_elevation_deg(motions), motions.humerus_elevation_deg
    lowest = np.zeros(len(elevation), bool)
    rest = np.tile(REST_DEG, (len(elevation), 1))
    for name in motions.subjects:
        mine = (motions.subject == name) & np.isfinite(elevation)
        if not mine.any():
            continue
        low = mine & (elevation == elevation[mine].min())
        lowest |= low
        if measured_rest:
            rest[motions.subject == name] = _average(motions.angles_deg[low])
    known = np.isfinite(plane) & np.isfinite(elevation)
    angles = np.full(motions.angles_deg.shape, np.nan)
    coefficients = np.repeat(COEFFICIENTS[..., None], known.sum(), axis=-1)
    angles[known] = girdle_angles_deg(rest[known].T, plane[known], elevation[known], coefficients).T
    return Predicted(angles, known & ~lowest)


def _average(angles_deg: Float[np.ndarray, "postures 6"]) -> Float[np.ndarray, "6"]:
    count = np.isfinite(angles_deg).sum(axis=0)
    return np.where(count > 0, np.nansum(angles_deg, axis=0) / np.maximum(count, 1), REST_DEG)
