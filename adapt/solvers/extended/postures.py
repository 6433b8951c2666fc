"""Posture fits with effects at work, by projections onto the constraints: the fast path of ``fit_batch`` with them;
and by Newton steps where projections go round in circles."""

import jax
import numpy as np
from jaxtyping import Float

from adapt.engine.batching import put_problems, take_problems
from adapt.solvers.batched.posture import SweptPostures
from adapt.solvers.extended.nearest_posture import NO_CHANNELS, THERE_DEG, Nearest, nearest_postures
from adapt.solvers.reference.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from models.effects import NO_ACTIVE_EFFECTS, AnyGirdle
from models.girdle import Girdle
from motions.rotations import DEG

_HERE_DEG = np.inf
"""No projection moves farther: everything is computed where the search starts."""

FREE_SD = 30.0
"""Of an angle that was not measured, in a projection, beside 1 of one that was: it holds to where it was, so little
that ``_ROUNDS`` settle it, and not so little that rounding does the rest."""

_ROUNDS = 8

_MOST_STEPS = 60
"""Of Newton; from where projections stop the hardest posture of those that were tried takes 13."""

_DIFFERENCE_DEG = 1e-3
"""Of central differences: rounding and what is left out of the slope are both some 1e-9 of it."""

_LEAST_CURVATURE = 1e-6
"""Of the distance along the constraints, in a step; 1 where they are straight, and 1e-5 where an angle that was not
measured turns the conoid hardly longer."""

_SAME = 1e-12
"""Relative rounding of the merit: a step that changes it by less is no step up."""

_SHORTEST = 2.0**-8
"""Of a step: one that leads down nowhere along it ends the search."""


def fit_extended(
    girdle: AnyGirdle,
    target: Float[np.ndarray, "6 problems"],
    weights: Float[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None,
) -> SweptPostures:
    """Find the nearest closed posture of each problem, rad. An angle that was not measured begins at its target, and is
    then projected from where it was, until it stays."""
    found = _projected(girdle, target, weights, start, THERE_DEG)[0]
    for _ in range(_ROUNDS):
        left = np.flatnonzero(~found.converged & (weights == 0.0).any(axis=0) & (weights > 0.0).any(axis=0))
        if not len(left):
            break
        some, W, here = take_problems((girdle, weights, found.angles), left)
        put_problems(found, left, _projected(some, np.where(W > 0.0, target[:, left], here), W, here, THERE_DEG)[0])
    return found


def fit_by_newton(
    girdle: AnyGirdle,
    target: Float[np.ndarray, "6 problems"],
    weights: Float[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"],
) -> SweptPostures:
    """Find the nearest closed posture x of measured angles s where projections go round in circles.

    They do where the constraints bend by more than the gap. r = x - s + B'y is 0 at the posture, and dr/dx along the
    constraints is the Hessian of the distance there: steps across to the constraints and along them to where it is
    least, as far as |x - s|^2 / 2 + penalty |g| falls. A step costs some 15 evaluations. An angle that was not measured
    is where it should be, wherever that is.
    """
    x = np.array(start)
    found, near = _here(girdle, target, weights, x)
    for _ in range(_MOST_STEPS):
        going = ~found.converged & np.isfinite(near.y).all(axis=0) & (weights > 0.0).any(axis=0)
        if not going.any():
            break
        some, s, W, here = take_problems((girdle, target, weights, x), going)
        new = _newton_step(some, s, W, here, near.of(going))
        if (new == here).all():
            break
        x[:, going] = new
        found, near = _here(girdle, target, weights, x)
    return found


def _newton_step(girdle: AnyGirdle, target, weights, x, near: Nearest) -> Float[np.ndarray, "6 problems"]:
    """Step as far as the merit falls; where it does not, stay."""
    B, c, apart = np.moveaxis(near.B, -1, 0), _off(near, x, target, weights), _apart(x, target, weights).T[..., None]
    along = np.swapaxes(np.linalg.svd(B)[2][:, 3:], 1, 2)
    hessian = np.swapaxes(along, 1, 2) @ _slopes(girdle, target, weights, x) @ along
    curvature, axes = np.linalg.eigh(0.5 * (hessian + np.swapaxes(hessian, 1, 2)))
    across = -np.swapaxes(B, 1, 2) @ c.T[..., None]
    downhill = np.swapaxes(axes, 1, 2) @ np.swapaxes(along, 1, 2) @ -(apart + across)
    step = across + along @ axes @ (downhill / np.maximum(np.abs(curvature), _LEAST_CURVATURE)[..., None])
    step = step[..., 0].T
    penalty = 2.0 * np.abs(near.h).max(axis=0) / float(DEG) ** 2
    new, length, least = x.copy(), 1.0, _merit(near, _apart(x, target, weights), penalty)
    left = np.arange(x.shape[1])
    while len(left) and length >= _SHORTEST:
        some, s, W = take_problems((girdle, target, weights), left)
        tried = x[:, left] + length * step[:, left]
        there = _here(some, s, W, tried)[1]
        tried -= np.einsum("kar,kr->ar", there.B, _off(there, tried, s, W))  # back to the constraints
        there = _here(some, s, W, tried)[1]
        lower = _merit(there, _apart(tried, s, W), penalty[left]) <= least[left] * (1.0 + _SAME)
        new[:, left[lower]] = tried[:, lower]
        left, length = left[~lower], 0.5 * length
    return new


def _apart(x, target, weights) -> Float[np.ndarray, "6 problems"]:
    """Compute x - s of the angles that were measured; 0 of the others."""
    return np.where(weights > 0.0, x - target, 0.0)


def _off(near: Nearest, x, target, weights) -> Float[np.ndarray, "3 problems"]:
    """Compute c = V^-1/2 g, rad."""
    return near.y / float(DEG) + np.einsum("kar,ar->kr", near.B, _apart(x, target, weights))


def _merit(near: Nearest, apart, penalty) -> Float[np.ndarray, " problems"]:
    return 0.5 * np.square(apart).sum(axis=0) + penalty * np.abs(near.g_mm).sum(axis=0)


def _slopes(girdle: AnyGirdle, target, weights, x) -> Float[np.ndarray, "problems 6 6"]:
    """dr/dx by central differences."""
    count, h = x.shape[1], _DIFFERENCE_DEG / float(DEG)
    everyone = np.tile(np.arange(count), 12)
    same, s, W = take_problems((girdle, target, weights), everyone)
    moved = x[:, everyone] + np.repeat(np.concatenate([h * np.eye(6), -h * np.eye(6)]), count, axis=0).T
    near = _here(same, s, W, moved)[1]
    r = _apart(moved, s, W) + np.einsum("kar,kr->ar", near.B, near.y) / float(DEG)
    up, down = r.reshape(6, 2, 6, count).transpose(1, 3, 0, 2)
    return np.nan_to_num((up - down) / (2.0 * h))


def _here(girdle: AnyGirdle, target, weights, x) -> tuple[SweptPostures, Nearest]:
    """Compute all where x is, which is the target of what was not measured."""
    return _projected(girdle, np.where(weights > 0.0, target, x), weights, x, _HERE_DEG, 1.0)


def _projected(
    girdle: AnyGirdle, target, weights, start, there_deg: float, free_sd: float = FREE_SD
) -> tuple[SweptPostures, Nearest]:
    """Project until no angle moves by more than that."""
    count = target.shape[1]
    plain, active = (
        (girdle, NO_ACTIVE_EFFECTS) if isinstance(girdle, Girdle) else (girdle.girdle, girdle.active_effects)
    )
    base = jax.tree.map(lambda x: np.ascontiguousarray(x, float), plain)
    strengths = [np.broadcast_to(np.asarray(one), (len(one), count)) for one in active.strengths]
    every = np.concatenate(strengths) if strengths else np.zeros((NO_CHANNELS, count))
    first = None if start is None else np.asarray(start) * float(DEG)
    target_deg = np.asarray(target) * float(DEG)
    sd = np.where(weights > 0.0, 1.0, free_sd)
    near = nearest_postures(base, active.effects, every, target_deg, sd, first, True, there_deg)
    apart = np.where(weights > 0.0, near.angles_deg - target_deg, 0.0)
    per_deg2 = weights.max(axis=0) / float(DEG) ** 2
    stationarity = per_deg2 * np.abs(apart + np.einsum("kar,kr->ar", near.B, near.y)).max(axis=0)
    closed = near.open_mm <= CONSTRAINT_TOLERANCE_MM
    swept = SweptPostures(
        near.angles_deg / float(DEG),
        per_deg2 * near.h,
        near.g_mm,
        stationarity,
        0.5 * (weights * (near.angles_deg / float(DEG) - target) ** 2).sum(axis=0),
        np.zeros(count, int),
        closed & (stationarity <= STATIONARITY_TOLERANCE),
    )
    return swept, near
