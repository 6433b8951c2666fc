"""Second derivatives of E with effects at work, by central differences of its exact slope: no compilation."""

import numpy as np
from jaxtyping import Float

from adapt.solvers.batched.subject import Fixed
from adapt.solvers.extended.problem_rows import parts_of, rows_of
from models.adapted_parameters import ADAPTED
from models.effects import ActiveEffects
from motions.rotations import DEG

_STEP_MM = 1e-3
"""Truncation goes with its square times third derivatives, 1e-8 of the second ones; rounding of the slope is 1e-11."""


def motion_curvature(
    fixed: Fixed,
    active_effects: ActiveEffects,
    theta: Float[np.ndarray, "adapted problems"],
) -> tuple[Float[np.ndarray, "adapted adapted problems"], Float[np.ndarray, "6 postures adapted problems"]]:
    """Compute d2(w mean J)/dtheta2, and dq/dtheta of every posture, rad a mm; 0 for postures that do not count."""
    parts = parts_of(fixed, active_effects)
    problem, posture = rows_of(fixed)
    near_deg = parts.nearest(theta.T, parts.strengths).angles_deg
    n, (_, postures, count) = len(ADAPTED), fixed.problem.measured.shape
    hessian, moved = np.zeros((n, n, count)), np.zeros((6, postures, n, count))
    for k in range(n):
        ends = []
        for sign in (1.0, -1.0):
            shifted = theta.T.copy()
            shifted[:, k] += sign * _STEP_MM
            near = parts.nearest(shifted, parts.strengths, near_deg)
            slope = 2.0 * parts.weights * np.einsum("kir,kr->ir", near.by_theta, near.y)
            ends.append((parts.sums(slope), near.angles_deg))
        hessian[:, k] = (ends[0][0] - ends[1][0]) / (2.0 * _STEP_MM)
        moved[:, posture, k, problem] = (ends[0][1] - ends[1][1]) / (2.0 * _STEP_MM * float(DEG))
    return 0.5 * (hessian + np.swapaxes(hessian, 0, 1)), moved
