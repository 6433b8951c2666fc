"""Posture fits that can be relied on: from several starts, on one branch along a motion, each with a status.

Lanes: every posture of every subject with every girdle is one element of a flat batch.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt import status
from adapt.chunks import in_chunks, in_rounds, lanes_of, with_lanes
from adapt.constraints import ByHand, Constraints, Differentiated
from adapt.kernel import Kernel
from adapt.posture import (
    Postures,
    close_chain,
    evaluated,
    mean_square_deg2,
    objective_weights,
    solve_from_two_starts,
    solve_postures,
)
from adapt.posture_sweep import PostureStart, SweptPostures, closed_nearby, sweep_postures
from models.effects import ExtendedGirdle
from models.girdle import Girdle
from motions.arrays import Array, repeat, xp
from motions.rhythm import REST_DEG
from motions.rotations import DEG

FEWEST_ANGLES = 3
"""A girdle has three degrees of freedom: with fewer measured angles its posture is not determined."""

OPEN_CHAIN_MM = 1e-6
"""A chain still open by more than this after closing it from every start cannot be closed here."""

SAME_BRANCH_RAD = 1e-6
"""Two solutions this close are one: converged ones agree to 1e-9 rad."""

OFFSETS_SEED = 0

_OFFSETS_DEG = np.random.Generator(np.random.PCG64(OFFSETS_SEED)).uniform(-30.0, 30.0, (8, 6))
"""Where else to start from: offsets to the measured angles. Fixed, so that a fit is reproducible."""

_TRACKING_ROUNDS = (10, 40)
"""Most iterations of the fast path in each step of it."""

_TRACKING_STEPS, _SHORT_TRACKING_STEPS = 4, 16
"""A posture is followed to the next one in this many steps along the straight line of measured angles."""


Chain = Girdle | ExtendedGirdle
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


def fit_lanes(
    girdle: Chain,
    angles: Float[np.ndarray, "6 lanes"],
    measured: Bool[np.ndarray, "6 lanes"],
    start: Float[np.ndarray, "6 lanes"] | None = None,
    places: int = 1,
) -> Fitted:
    """The closest closed posture of each lane to its measured angles (rad), with multipliers and status.

    Every lane starts from ``start``, else from its measured angles and from where its chain closes nearest to them, and
    the lower J wins; with more ``places`` (at most 9) also from where it closes from others around, for valleys
    farther off. One that does not converge starts again where it closes from nine other places. A lane whose chain
    closes from nowhere is ``unreachable`` and keeps the angles where it gapes least; one with fewer than three angles,
    or with a girdle that has no numbers (its adaptation failed), is ``invalid``.
    """
    target = np.where(measured, angles, REST_DEG[:, None] / DEG)
    weights = objective_weights(measured)
    determined = (measured.sum(axis=0) >= FEWEST_ANGLES) & np.isfinite(target).all(axis=0) & _finite(girdle)
    target = np.where(determined, target, REST_DEG[:, None] / DEG)
    solved = _solved(girdle, target, weights, start, places)
    fitted = _as_fitted(solved, target, weights)
    fitted.status[~determined] = status.INVALID
    least_open = np.full(len(determined), np.inf)
    for offset in _PLACES_DEG / DEG:
        again = np.flatnonzero(fitted.status == status.NOT_CONVERGED)
        if not len(again):
            return fitted
        part = lanes_of(girdle, again), target[:, again], weights[:, again]
        closed, residual = _few(_close, part[0], part[1] + offset[:, None])
        tried = _as_fitted(_carefully(*part, closed), *part[1:])
        converged = tried.status == status.OK
        _put(fitted, again[converged], _pick(tried, converged))
        open_mm = np.abs(residual).max(axis=0)
        less = ~converged & (open_mm < least_open[again])
        least_open[again[less]] = open_mm[less]
        _put(fitted, again[less], _pick(_unsolved(closed, residual, *part[1:]), less))
    fitted.status[(fitted.status == status.NOT_CONVERGED) & (least_open > OPEN_CHAIN_MM)] = status.UNREACHABLE
    return fitted


def _finite(girdle: Chain) -> Bool[np.ndarray, " lanes"]:
    """Whether every number of the girdle of a lane is one."""
    by_number = [np.isfinite(np.asarray(x)).reshape(-1, np.shape(x)[-1]).all(axis=0) for x in jax.tree.leaves(girdle)]
    return np.all(by_number, axis=0)


def follow_motions(
    fitted: Fitted,
    girdle: Chain,
    angles: Float[np.ndarray, "6 lanes"],
    measured: Bool[np.ndarray, "6 lanes"],
    previous: Int[np.ndarray, " lanes"],
) -> Fitted:
    """The same fits on one branch along each motion, where there is one, and jumps marked where there is not.

    ``previous`` is the lane of the posture before, or -1 at the start of a motion. Two neighbours are on one branch
    when continuation from one leads to the other. A motion with a jump is followed outward from its best posture
    (lowest J): where continuation succeeds, its solution replaces the one found on its own.
    """
    target = np.where(measured, angles, REST_DEG[:, None] / DEG)
    weights = objective_weights(measured)
    problem = girdle, target, weights
    fitted = replace(fitted, **{name: value.copy() for name, value in vars(fitted).items()})
    fitted.jump[:] = _breaks(fitted, problem, previous)
    with_jump = [lanes for lanes in _motions_of(previous) if fitted.jump[lanes].any()]
    if with_jump:
        _follow_from_best(fitted, problem, with_jump)
        moved = np.concatenate(with_jump)
        fitted.jump[moved] = _breaks(fitted, problem, np.where(np.isin(np.arange(len(previous)), moved), previous, -1))[
            moved
        ]
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


def _trackers(girdle: Chain) -> list[Callable[..., Postures]]:
    """The fast path, in shorter steps for what it did not follow; with effects the careful one."""
    if isinstance(girdle, Girdle):
        return [partial(_track_quickly, steps) for steps in (_TRACKING_STEPS, _SHORT_TRACKING_STEPS)]
    return [partial(_few, _track)]


def _breaks(fitted: Fitted, problem, previous) -> Bool[np.ndarray, " lanes"]:
    """Where continuation from the posture before does not lead to this one."""
    after = np.flatnonzero(previous >= 0)
    good = (fitted.status[after] == status.OK) & (fitted.status[previous[after]] == status.OK)
    after, broken = after[good], np.zeros(len(previous), bool)
    for track in _trackers(problem[0]):
        if not len(after):
            break
        tracked = _track_lanes(fitted, problem, previous[after], after, track)
        near = np.abs(tracked.angles - fitted.angles[:, after]).max(axis=0) <= SAME_BRANCH_RAD
        broken[after] = ~near
        after = after[tracked.status != status.OK]
    return broken


def _track_lanes(fitted: Fitted, problem, before, after, track) -> Fitted:
    girdle, target, weights = problem
    part = lanes_of((girdle, target, weights), after)
    start = target[:, before], fitted.angles[:, before]
    return _as_fitted(track(*part, *start), *part[1:])


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


def _as_fitted(solved: Postures, target, weights) -> Fitted:
    j = np.asarray(mean_square_deg2(solved.angles, target, weights))
    words = np.where(np.asarray(solved.converged) & np.isfinite(j), status.OK, status.NOT_CONVERGED).astype("U16")
    return Fitted(
        np.array(solved.angles),
        np.array(solved.multipliers),
        np.array(solved.residual_mm),
        np.array(solved.stationarity),
        j.copy(),
        words,
        np.zeros(len(j), bool),
    )


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


def _solved(girdle: Chain, target, weights, start, places: int) -> Postures:
    """From ``start`` or from two starts: the fast path, and the careful one for the lanes that need it."""
    if not isinstance(girdle, Girdle):
        return _carefully(girdle, target, weights, start)
    own: Girdle = jax.tree.map(np.ascontiguousarray, girdle)  # once, instead of in each call of a kernel
    part: Any
    if start is None:
        quick, sure = _quickly(own, target, weights, [np.zeros(6), *_OFFSETS_DEG[: places - 1]])
        far = np.asarray(mean_square_deg2(quick.angles, target, weights)) >= _FAR_DEG2
        again = np.flatnonzero(~sure | far) if places < _FAR_PLACES else np.array([], int)
        if len(again):
            part = lanes_of((own, target, weights), again)
            others, _ = _quickly(part[0], part[1], part[2], _OFFSETS_DEG[places - 1 : _FAR_PLACES - 1], near=False)
            quick = _with_lower(quick, again, others, part)
    else:
        quick = _swept(own, target, weights, start)
    left = np.flatnonzero(~quick.converged)
    if not len(left):
        return quick
    part = lanes_of((own, target, weights), left)
    careful = _carefully(part[0], part[1], part[2], None if start is None else start[:, left])
    return _with_lower(quick, left, careful, part)


def _with_lower(found: Postures, lanes, other: Postures, problem: tuple[Girdle, Array, Array]) -> Postures:
    """The other fits of these lanes in their places, where they converged and are lower."""
    before, after = (mean_square_deg2(x.angles, *problem[1:]) for x in (lanes_of(found, lanes), other))
    better = np.asarray(other.converged & ~(found.converged[lanes] & (before <= after)))
    return with_lanes(found, lanes[better], lanes_of(other, better))


def _carefully(girdle: Chain, target, weights, start) -> Postures:
    if start is None:
        return _few(_solve_twice, girdle, target, weights)
    return _few(_solve, girdle, target, weights, start)


def _few(function, girdle: Chain, *arrays) -> Any:
    """The careful path. With effects there are no derivatives by hand, which numpy needs."""
    at_once = _FEW_AT_ONCE if isinstance(girdle, Girdle) else 0
    return in_chunks(function, _FEW_LANES, girdle, *arrays, at_once=at_once)


def _quickly(
    girdle: Girdle, target, weights, offsets_deg, near: bool = True
) -> tuple[Postures, Bool[np.ndarray, " lanes"]]:
    """The lowest of several starts, and where it is sure: the nearest two converged, and none found another valley.

    The measured angles (``near``), and where the chain closes from these offsets to them.
    """
    around = [nearby_kernel(girdle, target + offset[:, None]) for offset in np.asarray(offsets_deg) / DEG]
    starts = [target, *around] if near else around
    found = [_swept(girdle, target, weights, x) for x in starts]
    j = np.stack([np.where(x.converged, mean_square_deg2(x.angles, target, weights), np.inf) for x in found])
    lowest = np.argmin(j, axis=0)
    apart = np.where(np.isfinite(j), j, -np.inf).max(axis=0) > j.min(axis=0) + _SAME_DEG2
    best = found[0]
    for k, other in enumerate(found[1:], 1):
        best = jax.tree.map(lambda x, y, at=lowest == k: np.where(at, y, x), best, other)
    return best, np.asarray(np.isfinite(j[:2]).all(axis=0) & ~apart)


def _swept(girdle: Girdle, target, weights, start) -> Postures:
    """The fast path, judged by the conditions of ``adapt.posture`` with g and its feet computed anew."""
    lanes = start.shape[1]
    first = PostureStart(start, np.zeros((3, lanes)), np.zeros(lanes, bool))
    return _as_postures(in_rounds(postures_kernel, _ROUNDS, (girdle, target, weights), first))


def _as_postures(swept: SweptPostures) -> Postures:
    rest = np.zeros_like(swept.stationarity)
    return Postures(
        swept.angles, swept.multipliers, swept.residual_mm, swept.stationarity, rest, rest + np.inf, swept.iterations
    )


_FEW_LANES = 64
"""Postures in a chunk of the careful path, which is long to compile."""

_FEW_AT_ONCE = 512
"""Postures up to which numpy does the careful path: 2 ms each, a tenth of that compiled, which takes 12 s once."""

_ROUNDS = (10, 10, 40, 400)
"""Most iterations of the fast path in each round: 9 of 10 postures need one round, 99 of 100 two."""

_SAME_DEG2 = 1e-6
"""Two optima whose J differ by less are one."""

_FAR_DEG2, _FAR_PLACES = 200.0, 3
"""From such a J on (14 deg rms) valleys are many, and which one a path ends in is chance: it starts from more places.
Measured postures leave 64 with R2 as it is; with das3, which does not close at rest, 440."""

_PLACES_DEG = np.stack([np.zeros(6), *_OFFSETS_DEG])
"""Where a chain is closed from before a fit, as offsets to the measured angles."""


def _numbers_of_girdle() -> Girdle:
    scalars = {"ts_distance_mm", "ai_distance_mm", "conoid_length_mm"}
    return Girdle(**{one.name: "" if one.name in scalars else "3" for one in fields(Girdle)})  # type: ignore[arg-type]


GIRDLE: Any = _numbers_of_girdle()
"""Shapes of a girdle's numbers, for ``adapt.kernel``."""

_LANES = 4096
"""Postures in a chunk of a program of JAX."""

nearby_kernel = Kernel("nearby", closed_nearby, (GIRDLE, "6"), "6", _LANES)

postures_kernel = Kernel(
    "postures",
    sweep_postures,
    (GIRDLE, "6", "6", PostureStart("6", "3", "bool"), ""),
    SweptPostures("6", "3", "3", "", "int", "bool"),
    _LANES,
)


def _constraints(girdle: Chain) -> Constraints:
    return ByHand(girdle) if isinstance(girdle, Girdle) else Differentiated(girdle.residuals_mm)


@jax.jit
def _solve(girdle: Chain, target: Array, weights: Array, start: Array) -> Postures:
    return solve_postures(_constraints(girdle), target, weights, start)


@jax.jit
def _solve_twice(girdle: Chain, target: Array, weights: Array) -> Postures:
    beside = jax.tree.map(lambda x: x[..., None], girdle)
    return solve_from_two_starts(_constraints(beside), target, weights)


@jax.jit
def _close(girdle: Chain, start: Array) -> tuple[Array, Array]:
    constraints = _constraints(girdle)
    closed = close_chain(constraints, start)
    return closed, constraints.residual(closed)


def _track_quickly(steps: int, girdle: Girdle, target, weights, target_before, start) -> Postures:
    """Continuation by the fast path; a lane that failed on the way ends as NaN."""
    lanes = start.shape[1]
    nowhere, arrived = np.zeros(lanes, bool), np.ones(lanes, bool)
    here: Any = PostureStart(start, np.zeros((3, lanes)), nowhere)
    for number in range(1, steps + 1):
        on_the_way = target_before + number / steps * (target - target_before)
        first = PostureStart(here.angles, here.multipliers, nowhere)
        here = in_rounds(postures_kernel, _TRACKING_ROUNDS, (girdle, on_the_way, weights), first)
        arrived &= here.converged
    return _as_postures(here._replace(residual_mm=np.where(arrived, here.residual_mm, np.nan)))


@jax.jit
def _track(girdle: Chain, target: Array, weights: Array, target_before: Array, start: Array) -> Postures:
    """Continuation: follow the solution while the measured angles go straight from one posture to the next."""

    constraints = _constraints(girdle)

    def step(carry):
        number, solved = carry
        on_the_way = target_before + number / _TRACKING_STEPS * (target - target_before)
        return number + 1, solve_postures(constraints, on_the_way, weights, solved.angles)

    first = evaluated(constraints, start, xp.zeros_like(start[:3]), target, weights)
    return repeat(_TRACKING_STEPS, step, (1, first))[1]
