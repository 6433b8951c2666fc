"""Prediction of measured motions by the published rhythm, from the measured posture with the lowest arm."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from motions.motion_csv.columns import MOTION_ANGLE, PLANE_OF_ELEVATION
from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.table import Motions

PLANES_DEG = {
    "abduction": 0.0,
    "frontal_elevation": 0.0,
    "scapular_elevation": 40.0,
    "forward_flexion": 90.0,
    "sagittal_elevation": 90.0,
}
"""Plane of elevation by the name of the motion: 0 is abduction, 90 forward flexion. The scapular plane is 40 degrees in
front of the frontal plane (Ludewig 2009, doi 10.2106/JBJS.G.01483)."""

HORIZONTAL = "horizontal_flexion"
"""Motion whose ``motion_angle_deg`` is the plane except for the sign, which differs between studies."""


@dataclass(frozen=True)
class Predicted:
    """Angles that the rhythm predicts for every posture."""

    angles_deg: Float[np.ndarray, "postures 6"]
    """Angles in the order of ``ANGLES``; NaN where the plane or the elevation is unknown."""
    scored: Bool[np.ndarray, " postures"]
    """True where a posture is predicted and did not provide the angles at rest."""


def planes_of_elevation_deg(motions: Motions) -> Float[np.ndarray, " postures"]:
    """Return the plane of elevation of each posture from its column or, without a number there, from the motion's name.

    For ``horizontal_flexion`` the plane is the absolute value of ``motion_angle_deg``. NaN where the plane is unknown.
    """
    read, angle = (_column(motions, name) for name in (PLANE_OF_ELEVATION, MOTION_ANGLE))
    mapped = np.array([PLANES_DEG.get(name, np.nan) for name in motions.motion.tolist()])
    mapped = np.where(motions.motion == HORIZONTAL, np.abs(angle), mapped)
    return np.where(np.isfinite(read), read, mapped)


def _column(motions: Motions, name: str) -> Float[np.ndarray, " postures"]:
    if name not in motions.extra:
        return np.full(len(motions.posture), np.nan)
    return np.asarray(pd.to_numeric(motions.extra[name], errors="coerce"), float)


def predict_from_lowest(motions: Motions, measured_rest: bool = True) -> Predicted:
    """Predict ``ANGLES`` of every posture by ``girdle_angles_deg`` from the subject's angles at rest.

    The angles at rest are the mean of the subject's postures with the lowest elevation; ``REST_DEG`` replaces angles
    not measured there. These postures are not scored. Without ``measured_rest``, all subjects rest at ``REST_DEG``, and
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
