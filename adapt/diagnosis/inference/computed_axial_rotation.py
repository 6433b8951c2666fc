"""Is the clavicle's axial rotation measured, or computed from the other five angles?

Landmarks give the clavicle no third axis; many laboratories estimate its axial rotation as the turn that moves the AC
joint least from a rest posture (van der Helm 1994). Such an estimate is a function of the other angles to the rounding
of the file, which no measurement is. It may differ from the bone's rotation by a constant alone, so no gap shows it.
"""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.shoulders import Shoulders
from motions.rhythm import clavicle_axial_rotation
from motions.rotations import DEG, rotation_from_cardan

ESTIMATE = "clavicle_axial_estimate"

COMPUTED_DEG = 0.1
"""RMS of the measured rotation about the estimate, below which it is one: files have 0.001 to 0.05 deg of rounding, and
rotations measured with pins lie 0.5 to 3 deg off their estimate."""

_RESTS = 12
"""The lowest postures of a subject, each tried as the rest posture of the estimate."""

_FEWEST = 5
"""Postures with all six angles from which a subject says something."""


def estimate_misfit_deg(shoulders: Shoulders) -> Float[np.ndarray, " subjects"]:
    """Compute how far each subject's axial rotation lies from a constant plus its estimate, RMS; the least of rests."""
    elevation = np.nan_to_num(shoulders.motions.humerus_elevation_deg)
    found = np.full(len(shoulders.subjects), np.nan)
    for subject in range(len(found)):
        rows = shoulders.rows_of(subject)
        rows = rows[shoulders.measured[:, rows].all(axis=0)]
        if len(rows) < _FEWEST:
            continue
        rests = rows[np.argsort(elevation[rows], kind="stable")[:_RESTS]]
        angles = shoulders.angles
        found[subject] = float(DEG) * np.min(_misfits(angles[:, rows], angles[:, rests]))
    return found


def _misfits(angles: Float[np.ndarray, "6 rows"], rests: Float[np.ndarray, "6 rests"]) -> list[np.ndarray]:
    """SD of measured less estimated rotation, rad: with the rest posture's own axial rotation, and with zero."""
    found = []
    for rest_clavicle in (rests[:3], rests[:3] * [[1.0], [1.0], [0.0]]):
        R_clavicle, R_scapula = rotation_from_cardan(rest_clavicle), rotation_from_cardan(rests[3:])
        shape = (*angles.shape[1:], *rests.shape[1:])
        every = [np.broadcast_to(R[:, :, None], (3, 3, *shape)) for R in (R_clavicle, R_scapula)]
        bones = [np.broadcast_to(x[..., None], (len(x), *shape)) for x in (angles[:2], angles[3:])]
        apart = angles[2][:, None] - clavicle_axial_rotation(*bones, *every)
        found.append(np.std(apart, axis=0))
    return found


def axial_is_computed(shoulders: Shoulders) -> bool:
    """Tell whether the axial rotation of most subjects is an estimate."""
    misfit = estimate_misfit_deg(shoulders)
    known = misfit[np.isfinite(misfit)]
    return bool(len(known)) and float(np.median(known)) < COMPUTED_DEG
