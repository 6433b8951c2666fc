"""Posture fits of any chain: projections onto the constraints; Newton steps where projections cycle."""

from functools import partial

import jax
import numpy as np
from jaxtyping import Bool, Float

from adapt.engine.batching import refit, take_problems
from adapt.solvers import status
from adapt.solvers.newton.postures import OFFSETS_DEG
from adapt.solvers.objective import mean_square_deg2
from adapt.solvers.projection.nearest_posture import NO_CHANNELS, THERE, Nearest, closed, nearest_postures
from adapt.solvers.solution import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE, PostureSolution, put_lower
from adapt.solvers.unmeasured import HELD_SD, angle_weights, gap
from models.effects import NO_ACTIVE_EFFECTS, ActiveEffects, AnyGirdle
from models.girdle import Girdle
from motions.rotations import DEG

_HERE = np.inf
"""Tolerance at which no projection is made: everything is computed at the starting point."""

_MORE_STARTS = 2
"""Number of places around the measured angles from which every fit starts too: the nearest local minimum may not be the
lowest."""

_ROUNDS = 8
"""Largest number of rounds of projections until an unmeasured angle stays."""

_MOST_STEPS = 60
"""Largest number of Newton steps; from the end of the projections the hardest posture that was tried takes 13."""

_DIFFERENCE_DEG = 1e-3
"""Step of central differences: rounding and truncation of the slope are both some 1e-9 of it."""

_LEAST_CURVATURE = 1e-6
"""Smallest curvature of the distance along the constraints in a step. The curvature is 1 where the constraints are
straight, and 1e-5 where an unmeasured angle turns the conoid with hardly any change of its length."""

_SAME = 1e-12
"""Relative rounding of the merit: a smaller rise does not reject a step."""

_SHORTEST = 2.0**-8
"""Smallest share of a step that is tried: a step that does not descend at any share ends the search."""


def fit_postures(
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None = None,
) -> PostureSolution:
    """Find the closed posture nearest to the measured angles (rad): from ``start`` alone, or else from the angles and
    places around them. An unmeasured angle begins at its value in ``angles``."""
    found = fit_from(girdle, angles, measured, start)
    for number, offset in enumerate(OFFSETS_DEG if start is None else ()):
        place, again = angles + offset[:, None] / DEG, ~found.converged | (number < _MORE_STARTS)
        refit(found, again, fit_from, girdle, angles, measured, place, put=put_lower)
    return refit(found, ~found.converged, _by_newton, girdle, angles, measured, found.angles, put=put_lower)


def fit_from(
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None,
) -> PostureSolution:
    """Find the nearest closed posture reached by projections from one starting point. An unmeasured angle is projected
    anew from its last value, until it stays."""
    found = _projected(girdle, angles, measured, start, THERE)[0]
    free = ~measured.all(axis=0) & measured.any(axis=0)
    for _ in range(_ROUNDS):
        refit(found, free & ~found.converged, _anew, girdle, angles, measured, found.angles)
    return found


def _anew(girdle: AnyGirdle, angles, measured, here) -> PostureSolution:
    return _projected(girdle, np.where(measured, angles, here), measured, here, THERE)[0]


def close_chains(
    girdle: AnyGirdle, start: Float[np.ndarray, "6 problems"]
) -> tuple[Float[np.ndarray, "6 problems"], Float[np.ndarray, "3 problems"]]:
    """Find the angles (rad) near ``start`` where each chain is closed or, if it cannot close, least open, and A1-A3
    there, mm."""
    plain, active = _parts_of(girdle)
    return closed(plain, active.effects, _strengths(active, start.shape[1]), start)


def _by_newton(girdle: AnyGirdle, angles, measured, start) -> PostureSolution:
    """Find the nearest closed posture x of measured angles s by Newton's method where projections cycle.

    Projections cycle where the constraints bend by more than the gap. r = x - s + B'y is 0 at the posture, and dr/dx
    along the constraints is the Hessian of the distance there. Each step goes across to the constraints and along them
    to the smallest distance, as far as |x - s|^2 / 2 + penalty |g| falls, and costs some 15 evaluations. The target of
    an unmeasured angle is its current value.
    """
    x = np.array(start)
    found, near = _here(girdle, angles, measured, x)
    for _ in range(_MOST_STEPS):
        going = ~found.converged & np.isfinite(near.y).all(axis=0) & measured.any(axis=0)
        if not going.any():
            break
        some, s, known, here = take_problems((girdle, angles, measured, x), going)
        new = _newton_step(some, s, known, here, take_problems(near, going))
        if (new == here).all():
            break
        x[:, going] = new
        found, near = _here(girdle, angles, measured, x)
    return found


def _newton_step(girdle: AnyGirdle, angles, measured, x, near: Nearest) -> Float[np.ndarray, "6 problems"]:
    """Take the step as far as the merit falls; stay where it does not fall."""
    B = np.moveaxis(near.B, -1, 0) / float(DEG)  # rows are orthonormal, because every SD is a degree
    c, apart = _off(near, x, angles, measured), gap(x, angles, measured).T[..., None]
    along = np.swapaxes(np.linalg.svd(B)[2][:, 3:], 1, 2)
    hessian = np.swapaxes(along, 1, 2) @ _slopes(girdle, angles, measured, x) @ along
    curvature, axes = np.linalg.eigh(0.5 * (hessian + np.swapaxes(hessian, 1, 2)))
    across = -np.swapaxes(B, 1, 2) @ c.T[..., None]
    downhill = np.swapaxes(axes, 1, 2) @ np.swapaxes(along, 1, 2) @ -(apart + across)
    step = across + along @ axes @ (downhill / np.maximum(np.abs(curvature), _LEAST_CURVATURE)[..., None])
    step = step[..., 0].T
    merit_of = partial(_merit, penalty=2.0 * np.abs(near.h).max(axis=0) / float(DEG) ** 2)
    new, length, least = x.copy(), 1.0, merit_of(near, gap(x, angles, measured))
    left = np.arange(x.shape[1])
    while len(left) and length >= _SHORTEST:
        some, s, known = take_problems((girdle, angles, measured), left)
        tried = x[:, left] + length * step[:, left]
        there = _here(some, s, known, tried)[1]
        tried -= np.einsum("kar,kr->ar", there.B / float(DEG), _off(there, tried, s, known))  # back to the constraints
        there = _here(some, s, known, tried)[1]
        lower = merit_of(there, gap(tried, s, known), left) <= least[left] * (1.0 + _SAME)
        new[:, left[lower]] = tried[:, lower]
        left, length = left[~lower], 0.5 * length
    return new


def _off(near: Nearest, x, angles, measured) -> Float[np.ndarray, "3 problems"]:
    """Compute c = V^-1/2 g, rad."""
    return (near.y + np.einsum("kar,ar->kr", near.B, gap(x, angles, measured))) / float(DEG)


def _merit(near: Nearest, apart, some=slice(None), *, penalty) -> Float[np.ndarray, " problems"]:
    return 0.5 * np.square(apart).sum(axis=0) + penalty[some] * np.abs(near.g_mm).sum(axis=0)


def _slopes(girdle: AnyGirdle, angles, measured, x) -> Float[np.ndarray, "problems 6 6"]:
    """Compute dr/dx by central differences."""
    count, h = x.shape[1], _DIFFERENCE_DEG / float(DEG)
    everyone = np.tile(np.arange(count), 12)
    same, s, known = take_problems((girdle, angles, measured), everyone)
    moved = x[:, everyone] + np.repeat(np.concatenate([h * np.eye(6), -h * np.eye(6)]), count, axis=0).T
    near = _here(same, s, known, moved)[1]
    r = gap(moved, s, known) + np.einsum("kar,kr->ar", near.B, near.y) / float(DEG) ** 2
    up, down = r.reshape(6, 2, 6, count).transpose(1, 3, 0, 2)
    return np.nan_to_num((up - down) / (2.0 * h))


def _here(girdle: AnyGirdle, angles, measured, x) -> tuple[PostureSolution, Nearest]:
    """Compute everything at x, which is also the target of unmeasured angles."""
    return _projected(girdle, np.where(measured, angles, x), measured, x, _HERE, 1.0)


def _projected(
    girdle: AnyGirdle, angles, measured, start, there: float, unmeasured_sd: float = HELD_SD
) -> tuple[PostureSolution, Nearest]:
    """Project until no angle moves by more than ``there`` of its SD."""
    plain, active = _parts_of(girdle)
    every = _strengths(active, angles.shape[1])
    near = nearest_postures(plain, active.effects, every, angles, measured, start, True, there, unmeasured_sd)
    weights = angle_weights(measured)
    moved = gap(near.angles, angles, measured) + np.einsum("kar,kr->ar", near.B, near.y) / float(DEG) ** 2
    stationarity = weights.max(axis=0) / float(DEG) * np.abs(moved).max(axis=0)
    converged = (near.open_mm <= CONSTRAINT_TOLERANCE_MM) & (stationarity <= STATIONARITY_TOLERANCE)
    return PostureSolution(
        near.angles,
        weights.max(axis=0) / float(DEG) ** 2 * near.h,
        near.g_mm,
        stationarity,
        mean_square_deg2(near.angles, angles, weights),
        np.zeros(len(converged), int),
        np.where(converged, status.CONVERGED, status.UNCONVERGED),
        np.zeros(len(converged), bool),
    ), near


def _parts_of(girdle: AnyGirdle) -> tuple[Girdle, ActiveEffects]:
    """Return the girdle without effects, for the engine, and its active effects."""
    plain, active = (
        (girdle, NO_ACTIVE_EFFECTS) if isinstance(girdle, Girdle) else (girdle.girdle, girdle.active_effects)
    )
    return jax.tree.map(lambda x: np.ascontiguousarray(x, float), plain), active


def _strengths(active: ActiveEffects, count: int) -> Float[np.ndarray, "channels problems"]:
    every = [np.broadcast_to(np.asarray(one), (len(one), count)) for one in active.strengths]
    return np.concatenate(every) if every else np.zeros((NO_CHANNELS, count))
