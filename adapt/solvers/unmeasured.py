"""Replacements for unmeasured angles in each solver: values at rest, weight 0, a large SD, gap 0.

Rows and problems have the boolean ``measured``; all that a solver derives from it is here.
"""

import numpy as np
from jaxtyping import Bool, Float

from motions.arrays import Array, xp
from motions.rhythm import REST_DEG
from motions.rotations import DEG

_MEASURED_SD_RAD = 1.0 / float(DEG)
"""SD of a measured angle: one degree, so that |y|^2 of a projection is in deg^2."""

UNMEASURED_SD = 1000.0
"""SD of an unmeasured angle relative to a measured one: the angle takes any value that closes the chain."""

HELD_SD, LOOSELY_HELD_SD = 30.0, 100.0
"""SDs that hold an unmeasured angle to its previous value, relative to a measured one: first the smaller SD, then the
larger. The smaller one is loose enough for eight projections to settle the angle, and tight enough that rounding does
not decide it. In 63 simulated adaptations with two unmeasured angles, 44 converge with the first SD, 18 with the
second."""

UNMEASURED_WEIGHT = 1e-8
"""Weight of an unmeasured angle relative to the largest, which damps a Newton step: constraints determine the angle."""

_WIDER = 2.0
"""Factor on the offsets of starting points in unmeasured angles: a raised arm is up to 80 degrees from rest."""


def at_rest(
    angles: Float[np.ndarray, " 6 *batch"], measured: Bool[np.ndarray, " *any"]
) -> Float[np.ndarray, " 6 *batch"]:
    """Replace unmeasured angles (rad) by those of the arm at rest."""
    rest = (REST_DEG / DEG).astype(angles.dtype).reshape(6, *(1,) * (angles.ndim - 1))
    return np.where(measured, angles, rest)


def angle_weights(measured: Bool[Array, " 6 *batch"]) -> Float[Array, " 6 *batch"]:
    """Compute W of J = 1/2 sum W_i (q_i - s_i)^2 in deg^2 with q in rad; 0 for an unmeasured angle."""
    count = xp.maximum(xp.sum(measured, axis=0), 1)
    return xp.where(measured, 2.0 * DEG**2 / count[None], 0.0)


def have_weight(weights: Float[Array, " 6 *batch"]) -> Bool[Array, " 6 *batch"]:
    """Return the mask of measured angles from W, all that a compiled adaptation gets; False everywhere where w is 0."""
    return weights > 0.0


def damped(weights: list[Array], scale: Array) -> list[Array]:
    """Compute W of a Newton step; ``scale`` is the largest weight."""
    return [xp.maximum(w, UNMEASURED_WEIGHT * scale) for w in weights]


def sd_rad(measured: Bool[np.ndarray, "6 rows"], unmeasured_sd: float) -> Float[np.ndarray, "6 rows"]:
    """Compute the SDs S of a projection."""
    return _MEASURED_SD_RAD * np.where(measured, 1.0, unmeasured_sd)


def gap(
    angles: Float[np.ndarray, "6 rows"], target: Float[np.ndarray, "6 rows"], measured: Bool[np.ndarray, "6 rows"]
) -> Float[np.ndarray, "6 rows"]:
    """Compute q - s, 0 for an unmeasured angle."""
    return np.where(measured, angles - target, 0.0)


def around(
    angles: Float[np.ndarray, "6 rows"], offset_deg: Float[np.ndarray, "6"], measured: Bool[np.ndarray, "6 rows"]
) -> Float[np.ndarray, "6 rows"]:
    """Compute starting points (rad) at an offset to the angles."""
    return angles + np.where(measured, 1.0, _WIDER) * offset_deg[:, None] / DEG
