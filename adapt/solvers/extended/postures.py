"""Posture fits with effects at work, by projections onto the constraints: the fast path of ``fit_batch`` with them."""

import jax
import numpy as np
from jaxtyping import Float

from adapt.solvers.batched.posture import SweptPostures
from adapt.solvers.extended.nearest_posture import NO_CHANNELS, nearest_postures
from adapt.solvers.reference.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from models.effects import NO_ACTIVE_EFFECTS, AnyGirdle
from models.girdle import Girdle
from motions.rotations import DEG


def fit_extended(
    girdle: AnyGirdle,
    target: Float[np.ndarray, "6 problems"],
    weights: Float[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None,
) -> SweptPostures:
    """Find the nearest closed posture of each problem, rad; one with unmeasured angles is left unconverged."""
    count = target.shape[1]
    plain, active = (
        (girdle, NO_ACTIVE_EFFECTS) if isinstance(girdle, Girdle) else (girdle.girdle, girdle.active_effects)
    )
    base = jax.tree.map(lambda x: np.ascontiguousarray(x, float), plain)
    strengths = [np.broadcast_to(np.asarray(one), (len(one), count)) for one in active.strengths]
    every = np.concatenate(strengths) if strengths else np.zeros((NO_CHANNELS, count))
    first = None if start is None else np.asarray(start) * float(DEG)
    target_deg = np.asarray(target) * float(DEG)
    near = nearest_postures(base, active.effects, every, target_deg, np.ones((6, count)), first, True)
    apart = near.angles_deg - target_deg
    per_deg2 = weights.max(axis=0) / float(DEG) ** 2
    stationarity = per_deg2 * np.abs(apart + np.einsum("kar,kr->ar", near.B, near.y)).max(axis=0)
    closed = near.open_mm <= CONSTRAINT_TOLERANCE_MM
    return SweptPostures(
        near.angles_deg / float(DEG),
        per_deg2 * near.h,
        near.g_mm,
        stationarity,
        0.5 * (weights * (near.angles_deg / float(DEG) - target) ** 2).sum(axis=0),
        np.zeros(count, int),
        closed & (stationarity <= STATIONARITY_TOLERANCE) & (weights > 0.0).all(axis=0),
    )
