"""What each solver puts in the place of an angle that was not measured: rest, no weight, a large SD, no gap.

Rows and problems have the boolean ``measured``; all that a solver makes of it is here.
"""

import numpy as np
from jaxtyping import Bool, Float

from motions.arrays import Array, xp
from motions.rhythm import REST_DEG
from motions.rotations import DEG

_MEASURED_SD_RAD = 1.0 / float(DEG)
"""A degree, so that |y|^2 of a projection is in deg^2."""

UNMEASURED_SD = 1000.0
"""Beside 1 of a measured angle: an angle that was not measured is whatever closes the chain."""

HELD_SD, LOOSELY_HELD_SD = 30.0, 100.0
"""It holds to where it was, so little that eight projections settle it, and not so little that rounding does the rest;
then less. Of 63 simulated adaptations with two such angles 44 end with the first, 18 with the second."""

UNMEASURED_WEIGHT = 1e-8
"""Relative damping in a Newton step: it settles where the constraints put it."""

_WIDER = 2.0
"""Times as far are its starts from rest: a raised arm is up to 80 degrees off."""


def at_rest(
    angles: Float[np.ndarray, " 6 *batch"], measured: Bool[np.ndarray, " *any"]
) -> Float[np.ndarray, " 6 *batch"]:
    """Replace angles (rad) that were not measured by those of the arm at rest."""
    rest = (REST_DEG / DEG).astype(angles.dtype).reshape(6, *(1,) * (angles.ndim - 1))
    return np.where(measured, angles, rest)


def angle_weights(measured: Bool[Array, " 6 *batch"]) -> Float[Array, " 6 *batch"]:
    """Compute W of J = 1/2 sum W_i (q_i - s_i)^2 in deg^2 with q in rad; 0 for an angle that was not measured."""
    count = xp.maximum(xp.sum(measured, axis=0), 1)
    return xp.where(measured, 2.0 * DEG**2 / count[None], 0.0)


def have_weight(weights: Float[Array, " 6 *batch"]) -> Bool[Array, " 6 *batch"]:
    """Tell which angles were measured from W, which is all that a compiled adaptation gets; none where w is 0."""
    return weights > 0.0


def damped(weights: list[Array], scale: Array) -> list[Array]:
    """Give W of a Newton step; ``scale`` is the largest."""
    return [xp.maximum(w, UNMEASURED_WEIGHT * scale) for w in weights]


def sd_rad(measured: Bool[np.ndarray, "6 rows"], unmeasured_sd: float) -> Float[np.ndarray, "6 rows"]:
    """Give S of a projection."""
    return _MEASURED_SD_RAD * np.where(measured, 1.0, unmeasured_sd)


def gap(
    angles: Float[np.ndarray, "6 rows"], target: Float[np.ndarray, "6 rows"], measured: Bool[np.ndarray, "6 rows"]
) -> Float[np.ndarray, "6 rows"]:
    """Compute q - s, 0 for an angle that was not measured."""
    return np.where(measured, angles - target, 0.0)


def around(
    angles: Float[np.ndarray, "6 rows"], offset_deg: Float[np.ndarray, "6"], measured: Bool[np.ndarray, "6 rows"]
) -> Float[np.ndarray, "6 rows"]:
    """Place starts (rad) at an offset to the angles."""
    return angles + np.where(measured, 1.0, _WIDER) * offset_deg[:, None] / DEG
