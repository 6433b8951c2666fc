"""Lowest of several local minima of F, from several starts and from the minima of the same person's other problems."""

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import put_problems, take_problems
from adapt.own_bones.most_probable import (
    STARTS_MM,
    Posterior,
    Prior,
    Rows,
    most_probable,
    of_problems,
    staged,
    take_found,
)
from adapt.own_bones.scales import informative
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.projection.nearest_posture import nearest_by_numbers
from models.girdle import Girdle

_AS_GOOD_AS_NOISE = 1.0
"""Factor on the mean F of noise alone; a first start that reaches this value needs no other start. With a
factor of 1.3, 15 of 180 adaptations of the shipped subjects and their folds end in a higher minimum than with all
starts; with 1.0, 3 do."""

_APART_SDS = 0.3
"""Starts whose u is within this distance of the lowest minimum so far are left out. Among 1112 second and third starts
of shipped and measured persons and folds with six sets, 168 are as near, and none of these leads lower. No start up to
1 SD away leads lower; 19 starts up to 2 SDs away do."""

_MOST_KIN, _KIN_STEPS = 3, 150
"""Number of starts from the minima of other folds of the same person, taken by the lowest F at the start, and their
largest number of steps. For 53 of 441 measured persons and folds with six sets such starts lower F, by up to 106 nats.
With one start 25 of the 53 are missed, with two 16, with three 8. With 60 steps few are lower."""

_FIRST_STEPS = 160
"""Largest number of steps of the first start. Where a posture on the way is at the limit of what its chain can reach,
A1-A3 have no slope: the steps leave the local minimum and wander, while other starts do not. The limit
changes the end of one of 604 problems of measured and simulated subjects with six sets."""

_POSTURE_ROUNDS = 4
"""Largest number of restarts for a person with a posture in the higher of two local minima, from the lower one."""

_LOWER_DEG2 = 1e-6
"""Decrease of a posture's squared differences (deg^2) up to which a new posture fit counts as the same minimum."""


def with_lowest_postures(
    rows: Rows, problem: Int[np.ndarray, " rows"], prior: Prior, kin: Int[np.ndarray, " problems"]
) -> Posterior:
    """Find the most probable girdles, and restart where a posture has a better fit in another local minimum.

    ``kin``: number of the person, shared by problems with other postures of the same person.
    """
    found, left = _from_starts(rows, problem, prior, kin), np.arange(len(prior.noise_deg))
    for _ in range(_POSTURE_ROUNDS):
        some, number = of_problems(rows, problem, left)
        girdle = Girdle.of_numbers(prior.numbers_at(found.u)[:, left[number]])
        fresh = fit_batch(some.active_effects.on(girdle), some.angles, some.measured)
        near = take_problems(found.nearest, np.isin(problem, left))
        lower = fresh.converged & (fresh.j_deg2 * some.measured.sum(axis=0) < (near.y**2).sum(axis=0) - _LOWER_DEG2)
        again = np.unique(number[lower])
        if not len(again):
            break
        left, start = left[again], np.where(lower, fresh.angles, near.angles)[:, np.isin(number, again)]
        some, number = of_problems(rows, problem, left)
        _put(found, problem, left, most_probable(some, number, take_problems(prior, left), found.u[:, left], start))
    return found


def _from_starts(rows: Rows, problem: Int[np.ndarray, " rows"], prior: Prior, kin) -> Posterior:
    """Search from the first start, and from the others where it leaves more than the noise; keep the lowest minimum."""
    first = staged(rows, problem, prior, STARTS_MM[0])
    found = most_probable(rows, problem, prior, *first, _FIRST_STEPS)
    allowed = _AS_GOOD_AS_NOISE * np.maximum(informative(rows.measured, problem, len(found.F)), 1) * prior.noise_deg**2
    left = np.flatnonzero(~found.settled | (allowed < found.F))
    if len(left):
        (some, number), own = of_problems(rows, problem, left), take_problems(prior, left)
        starts = [staged(some, number, own, slacks_mm) for slacks_mm in STARTS_MM[1:]]
        u, angles = (np.concatenate(one, axis=1) for one in zip(*starts, strict=True))
        problems = np.tile(left, len(starts))
        apart = _apart(u, found.u[:, problems])
        of_start = np.concatenate([number + k * len(left) for k in range(len(starts))])
        angles = angles[:, apart[of_start]]
        _keep_lower(found, rows, problem, prior, problems[apart], u[:, apart], angles)
        _with_starts_of_kin(found, rows, problem, prior, kin, left)
    lost = np.flatnonzero(~found.settled)
    if len(lost):  # no start has converged: the first continues
        some, number = of_problems(rows, problem, lost)
        u, angles = first[0][:, lost], first[1][:, np.isin(problem, lost)]
        _put(found, problem, lost, most_probable(some, number, take_problems(prior, lost), u, angles))
    return found


def _with_starts_of_kin(
    found: Posterior, rows: Rows, problem: Int[np.ndarray, " rows"], prior: Prior, kin, left
) -> None:
    """Start the problems ``left`` from the girdles of their kin that have the lowest F for them."""
    of_left, other = np.nonzero((kin[left, None] == kin) & (left[:, None] != np.arange(len(kin))) & found.settled)
    u = take_problems(prior, left[of_left]).u_of(prior.numbers_at(found.u)[:, other])
    apart = _apart(u, found.u[:, left[of_left]])
    problems, u = left[of_left[apart]], u[:, apart]
    if not len(problems):
        return
    (some, number), own = of_problems(rows, problem, problems), take_problems(prior, problems)
    numbers, measured = own.numbers_at(u)[:, number], (some.active_effects, some.angles, some.measured)
    y = nearest_by_numbers(numbers, *measured, some.angles).y
    F = np.bincount(number, (y**2).sum(axis=0), len(problems)) + own.noise_deg**2 * (u**2).sum(axis=0)
    order = np.lexsort((F, problems))  # by problem, lowest F first
    rank = np.arange(len(order)) - np.searchsorted(problems, problems)
    chosen = np.sort(order[(rank < _MOST_KIN) & np.isfinite(F[order])])
    angles = some.angles[:, np.isin(number, chosen)]
    _keep_lower(found, rows, problem, prior, problems[chosen], u[:, chosen], angles, _KIN_STEPS)


def _apart(u: Float[np.ndarray, "n starts"], end: Float[np.ndarray, "n starts"]) -> Bool[np.ndarray, " starts"]:
    """Check which starts are away from the end of a search; every start is away from an end that is NaN."""
    return ~(np.abs(u - end).max(axis=0) <= _APART_SDS)


def _keep_lower(
    found: Posterior, rows: Rows, problem: Int[np.ndarray, " rows"], prior: Prior, problems, u, angles, *most_steps: int
) -> None:
    """Search from more starts of ``problems``, which may repeat, and keep ends that are lower than ``found``."""
    if not len(problems):
        return
    some, number = of_problems(rows, problem, problems)
    ends = most_probable(some, number, take_problems(prior, problems), u, angles, *most_steps)
    F = np.where(ends.settled, ends.F, np.inf)
    order = np.lexsort((F, problems))
    lowest = order[np.unique(problems[order], return_index=True)[1]]
    lowest = lowest[F[lowest] < np.where(found.settled, found.F, np.inf)[problems[lowest]]]
    _put(found, problem, problems[lowest], take_found(ends, number, lowest))


def _put(found: Posterior, problem: Int[np.ndarray, " rows"], problems, other: Posterior) -> None:
    """Replace the ends of ``problems`` in ``found`` by ``other``."""
    put_problems(found.nearest, np.flatnonzero(np.isin(problem, problems)), other.nearest)
    put_problems(found._replace(nearest=()), problems, other._replace(nearest=()))  # pyright: ignore[reportArgumentType]
