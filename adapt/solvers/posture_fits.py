"""Posture fits that can be relied on: from several starts, on one branch along a motion, each with a status.

Lanes: every posture of every subject with every girdle is one element of a flat batch.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt.engine.batching import as_type, in_chunks, take_problems
from adapt.solvers import status
from adapt.solvers.batched.kernels import OFFSETS_DEG, fitted_from, fitted_from_places, put_lower, tracked
from adapt.solvers.batched.posture import SweptPostures
from adapt.solvers.reference.constraints import ByHand, Constraints, Differentiated
from adapt.solvers.reference.posture import (
    Postures,
    close_chain,
    mean_square_deg2,
    objective_weights,
    solve_postures,
)
from models.effects import ExtendedGirdle
from models.girdle import Girdle
from motions.arrays import Array, ByType
from motions.rhythm import REST_DEG
from motions.rotations import DEG

FEWEST_ANGLES = 3
"""A girdle has three degrees of freedom: with fewer measured angles its posture is not determined."""

OPEN_CHAIN_MM = 1e-6
"""A chain still open by more than this after closing it from every start cannot be closed here."""

SAME_BRANCH_RAD = ByType(1e-6, 1e-4)
"""Two solutions this close are one: converged ones agree to 1e-9 rad, one in float32 to 2e-6."""

_TRACKING_STEPS, _SHORT_TRACKING_STEPS = 4, 16
"""A posture is followed to the next one in this many steps along the straight line of measured angles."""


AnyGirdle = Girdle | ExtendedGirdle
"""A girdle of each lane, with or without effects."""


@dataclass(frozen=True)
class Fitted:
    """Posture fits of B lanes."""

    angles: Float[np.ndarray, "6 lanes"]
    """rad."""
    multipliers: Float[np.ndarray, "3 lanes"]
    """Of A1-A3, deg^2 a mm."""
    residual_mm: Float[np.ndarray, "3 lanes"]
    stationarity: Float[np.ndarray, " lanes"]
    """deg^2 a degree."""
    j_deg2: Float[np.ndarray, " lanes"]
    status: Shaped[np.ndarray, " lanes"]
    jump: Bool[np.ndarray, " lanes"]
    """True where the posture is not on the branch of the posture before it in its motion."""


def fit_batch(
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 lanes"],
    measured: Bool[np.ndarray, "6 lanes"],
    start: Float[np.ndarray, "6 lanes"] | None = None,
    around: bool = False,
) -> Fitted:
    """The closest closed posture of each lane to its measured angles (rad), with multipliers and status.

    Every lane starts from ``start``, else from its measured angles and from where its chain closes nearest to them, and
    the lower J wins; if asked for also from where it closes next to two places ``around``, for valleys farther off. One
    that does not converge starts again where it closes from nine other places. A lane whose chain closes from nowhere
    is ``unreachable`` and keeps the angles where it gapes least; one with fewer than three angles, or with a girdle
    that has no numbers (its adaptation failed), is ``invalid``.

    Angles in float32 are fitted in float32, and in float64 where that does not converge.
    """
    rest = (REST_DEG[:, None] / DEG).astype(angles.dtype)
    target = np.where(measured, angles, rest)
    weights = objective_weights(measured)
    determined = (measured.sum(axis=0) >= FEWEST_ANGLES) & np.isfinite(target).all(axis=0) & _finite(girdle)
    target = np.where(determined, target, rest)
    fitted = _as_fitted(_solved(girdle, target, weights, start, around))
    girdle, target = as_type((girdle, target), float)
    fitted.status[~determined] = status.INVALID
    least_open = np.full(len(determined), np.inf)
    for offset in _PLACES_DEG / DEG:
        again = np.flatnonzero(fitted.status == status.NOT_CONVERGED)
        if not len(again):
            return fitted
        part = take_problems(girdle, again), target[:, again], weights[:, again]
        closed, residual = _in_small_chunks(_close, part[0], part[1] + offset[:, None])
        tried = _as_fitted(_reference_fit(*part, closed))
        converged = tried.status == status.OK
        _put(fitted, again[converged], _pick(tried, converged))
        open_mm = np.abs(residual).max(axis=0)
        less = ~converged & (open_mm < least_open[again])
        least_open[again[less]] = open_mm[less]
        _put(fitted, again[less], _pick(_unsolved(closed, residual, *part[1:]), less))
    fitted.status[(fitted.status == status.NOT_CONVERGED) & (least_open > OPEN_CHAIN_MM)] = status.UNREACHABLE
    return fitted


def _finite(girdle: AnyGirdle) -> Bool[np.ndarray, " lanes"]:
    """Whether every number of the girdle of a lane is one."""
    return np.isfinite(sum(np.sum(x, axis=tuple(range(np.ndim(x) - 1))) for x in jax.tree.leaves(girdle)))


def follow_motions(
    fitted: Fitted,
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 lanes"],
    measured: Bool[np.ndarray, "6 lanes"],
    previous: Int[np.ndarray, " lanes"],
) -> Fitted:
    """The same fits on one branch along each motion, where there is one, and jumps marked where there is not.

    ``previous`` is the lane of the posture before, or -1 at the start of a motion. Two neighbours are on one branch
    when continuation from one leads to the other. A motion with a jump is followed outward from its best posture
    (lowest J): where continuation succeeds, its solution replaces the one found on its own. It is done in float64.
    """
    target = np.where(measured, angles, REST_DEG[:, None] / DEG).astype(float)
    weights = objective_weights(measured)
    problem, same_rad = (girdle, target, weights), SAME_BRANCH_RAD.for_dtype_of(angles)
    fitted = replace(fitted, **{name: value.copy() for name, value in vars(fitted).items()})
    fitted.jump[:] = _breaks(fitted, problem, previous, same_rad)
    with_jump = [lanes for lanes in _motions_of(previous) if fitted.jump[lanes].any()]
    if with_jump:
        _follow_from_best(fitted, problem, with_jump)
        moved = np.concatenate(with_jump)
        of_moved = np.where(np.isin(np.arange(len(previous)), moved), previous, -1)
        fitted.jump[moved] = _breaks(fitted, problem, of_moved, same_rad)[moved]
    return fitted


def _follow_from_best(fitted: Fitted, problem, motions: list[Int[np.ndarray, " postures"]]) -> None:
    """All motions in step, up and down from the best posture of each."""
    orders = []
    for lanes in motions:
        best = int(np.argmin(np.where(fitted.status[lanes] == status.OK, fitted.j_deg2[lanes], np.inf)))
        orders += [list(itertools.pairwise(lanes[best:])), list(itertools.pairwise(lanes[best::-1]))]
    for number in range(max(map(len, orders), default=0)):
        before, after = np.array([order[number] for order in orders if number < len(order)]).T
        for track in _trackers(problem[0]):
            if not len(after):
                break
            tracked = _track_lanes(fitted, problem, before, after, track)
            arrived = tracked.status == status.OK
            _put(fitted, after[arrived], _pick(tracked, arrived))
            before, after = before[~arrived], after[~arrived]


def _trackers(girdle: AnyGirdle) -> list[Callable[..., SweptPostures]]:
    """The fast path, in shorter steps for what it did not follow; with effects the careful one."""
    if isinstance(girdle, Girdle):
        return [partial(tracked, steps) for steps in (_TRACKING_STEPS, _SHORT_TRACKING_STEPS)]
    return [_track_by_reference]


def _breaks(fitted: Fitted, problem, previous, same_rad: float) -> Bool[np.ndarray, " lanes"]:
    """Where continuation from the posture before does not lead to this one."""
    after = np.flatnonzero(previous >= 0)
    good = (fitted.status[after] == status.OK) & (fitted.status[previous[after]] == status.OK)
    after, broken = after[good], np.zeros(len(previous), bool)
    for track in _trackers(problem[0]):
        if not len(after):
            break
        tracked = _track_lanes(fitted, problem, previous[after], after, track)
        near = np.abs(tracked.angles - fitted.angles[:, after]).max(axis=0) <= same_rad
        broken[after] = ~near
        after = after[tracked.status != status.OK]
    return broken


def _track_lanes(fitted: Fitted, problem, before, after, track) -> Fitted:
    girdle, target, weights = problem
    part = take_problems((girdle, target, weights), after)
    return _as_fitted(track(*part, target[:, before], fitted.angles[:, before]))


def _motions_of(previous: Int[np.ndarray, " lanes"]) -> list[Int[np.ndarray, " postures"]]:
    """The lanes of each motion in order."""
    following = {int(p): i for i, p in enumerate(previous) if p >= 0}
    chains = []
    for first in np.flatnonzero(previous < 0):
        chain = [int(first)]
        while chain[-1] in following:
            chain.append(following[chain[-1]])
        chains.append(np.array(chain))
    return chains


_WORDS = np.array([status.NOT_CONVERGED, status.OK], "U16")


def _as_fitted(solved: SweptPostures) -> Fitted:
    words = _WORDS[(solved.converged & np.isfinite(solved.j_deg2)).astype(int)]
    angles, multipliers, residual_mm, stationarity, j_deg2 = (np.require(x, requirements="W") for x in solved[:5])
    return Fitted(angles, multipliers, residual_mm, stationarity, j_deg2, words, np.zeros(len(words), bool))


def _unsolved(closed, residual, target, weights) -> Fitted:
    """Angles where the chain closes, or gapes least, as a fit that did not converge."""
    j = np.asarray(mean_square_deg2(closed, target, weights))
    words = np.full(len(j), status.NOT_CONVERGED, "U16")
    return Fitted(closed, np.zeros_like(residual), residual, np.full_like(j, np.nan), j, words, np.zeros(len(j), bool))


def _pick(fitted: Fitted, lanes) -> Fitted:
    return Fitted(**{name: value[..., lanes] for name, value in vars(fitted).items()})


def _put(fitted: Fitted, lanes, values: Fitted) -> None:
    for name, value in vars(values).items():
        getattr(fitted, name)[..., lanes] = value


def _solved(girdle: AnyGirdle, target, weights, start, around: bool) -> SweptPostures:
    """The fast path, and for the lanes that need it the careful one; after float32 first the fast one in float64."""
    if not isinstance(girdle, Girdle):
        return _reference_fit(girdle, target, weights, start)
    problem = girdle, target, weights
    quick = as_type(fitted_from_places(problem, around) if start is None else fitted_from(problem, start), float)
    left = np.flatnonzero(~quick.converged)
    if len(left):
        girdle, target, weights = take_problems(problem, left)
        start = None if start is None else start[:, left]
        if target.dtype == np.float32:
            girdle, target = as_type((girdle, target), float)
            further = _solved(girdle, target, weights, start, around)
        else:
            further = _reference_fit(girdle, target, weights, start)
        put_lower(quick, left, further)
    return quick


def _reference_fit(girdle: AnyGirdle, target, weights, start) -> SweptPostures:
    """The optimum reached from one start; without one the lower of those from the measured angles and from where the
    chain closes nearest to them (see ``posture.solve_from_two_starts``, which would be another program to compile)."""
    if start is not None:
        return _as_swept(_in_small_chunks(_solve, girdle, target, weights, start), target, weights)
    closed, _ = _in_small_chunks(_close, girdle, target)
    found, other = (_reference_fit(girdle, target, weights, place) for place in (target, closed))
    put_lower(found, np.arange(target.shape[1]), other)
    return found


def _track_by_reference(girdle: AnyGirdle, target, weights, target_before, start) -> SweptPostures:
    """Continuation: follow the solution while the measured angles go straight from one posture to the next."""
    for share in np.arange(1, _TRACKING_STEPS) / _TRACKING_STEPS:
        start = _reference_fit(girdle, target_before + share * (target - target_before), weights, start).angles
    return _reference_fit(girdle, target, weights, start)


def _as_swept(solved: Postures, target, weights) -> SweptPostures:
    return SweptPostures(
        solved.angles,
        solved.multipliers,
        solved.residual_mm,
        solved.stationarity,
        np.asarray(mean_square_deg2(solved.angles, target, weights)),
        solved.iterations,
        np.asarray(solved.converged),
    )


def _in_small_chunks(function, girdle: AnyGirdle, *arrays) -> Any:
    """The careful path. With effects there are no derivatives by hand, which numpy needs."""
    at_once = _SMALL_AT_ONCE if isinstance(girdle, Girdle) else 0
    return in_chunks(function, _SMALL_CHUNK, girdle, *arrays, at_once=at_once)


_SMALL_CHUNK = 64
"""Postures in a chunk of the careful path, which is long to compile."""

_SMALL_AT_ONCE = 512
"""Postures up to which numpy does the careful path: 2 ms each, a tenth of that compiled, which takes 12 s once."""

_PLACES_DEG = np.stack([np.zeros(6), *OFFSETS_DEG])
"""Where a chain is closed from before a fit, as offsets to the measured angles."""


def _constraints(girdle: AnyGirdle) -> Constraints:
    return ByHand(girdle) if isinstance(girdle, Girdle) else Differentiated(girdle.residuals_mm)


@jax.jit
def _solve(girdle: AnyGirdle, target: Array, weights: Array, start: Array) -> Postures:
    return solve_postures(_constraints(girdle), target, weights, start)


@jax.jit
def _close(girdle: AnyGirdle, start: Array) -> tuple[Array, Array]:
    constraints = _constraints(girdle)
    closed = close_chain(constraints, start)
    return closed, constraints.residual(closed)
