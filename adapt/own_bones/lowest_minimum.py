"""The most probable girdle among several minima of F: from several starts, and from where the person's others ended."""

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
"""Times the F that noise alone leaves, on average. With 1.3 15 of 180 adaptations of the shipped subjects and their
parts end in a higher minimum than with all starts, with 1.0 3 do."""

_APART_SDS = 0.3
"""A start whose u is no farther from the lowest end so far leads there too. Of 1112 second and third starts of
shipped and measured persons and parts with six sets 168 are as near, and none of them leads lower; of those up to 1 SD
away none does, of those up to 2 SDs 19."""

_MOST_KIN, _KIN_STEPS = 3, 150
"""Starts from where other parts of the same person ended: so many of the lowest F there, with so many steps. Of 441
measured persons and parts with six sets 53 end lower for some of them, by up to 106 nats; with one such start 25 of
these do not, with two 16, with three 8. With 60 steps few do."""

_FIRST_STEPS = 160
"""Of the first start. Where a posture on the way is as far as its chain reaches, A1-A3 have no slope there: the steps
leave the local minimum and wander; other starts do not. Of 604 problems of measured and simulated subjects with six
sets one ends elsewhere for it."""

_POSTURE_ROUNDS = 4
"""A person with a posture in the higher of two local minima goes on from the lower one."""

_LOWER_DEG2 = 1e-6
"""A fresh posture fit lower by less than this is the same one."""


def with_lowest_postures(
    rows: Rows, part: Int[np.ndarray, " rows"], prior: Prior, kin: Int[np.ndarray, " problems"]
) -> Posterior:
    """Find the most probable girdles, and again from where a posture fits better elsewhere.

    ``kin``: a number that problems with other postures of the same person share.
    """
    found, left = _from_starts(rows, part, prior, kin), np.arange(len(prior.noise_deg))
    for _ in range(_POSTURE_ROUNDS):
        some, number = of_problems(rows, part, left)
        girdle = Girdle.of_numbers(prior.numbers_at(found.u)[:, left[number]])
        fresh = fit_batch(some.active_effects.on(girdle), some.angles, some.measured)
        near = take_problems(found.nearest, np.isin(part, left))
        lower = fresh.converged & (fresh.j_deg2 * some.measured.sum(axis=0) < (near.y**2).sum(axis=0) - _LOWER_DEG2)
        again = np.unique(number[lower])
        if not len(again):
            break
        left, start = left[again], np.where(lower, fresh.angles, near.angles)[:, np.isin(number, again)]
        some, number = of_problems(rows, part, left)
        _put(found, part, left, most_probable(some, number, take_problems(prior, left), found.u[:, left], start))
    return found


def _from_starts(rows: Rows, part: Int[np.ndarray, " rows"], prior: Prior, kin) -> Posterior:
    """The lowest of what several starts lead to, of persons whom the first does not fit as well as the noise allows."""
    first = staged(rows, part, prior, STARTS_MM[0])
    found = most_probable(rows, part, prior, *first, _FIRST_STEPS)
    allowed = _AS_GOOD_AS_NOISE * np.maximum(informative(rows.measured, part, len(found.F)), 1) * prior.noise_deg**2
    left = np.flatnonzero(~found.settled | (allowed < found.F))
    if len(left):
        (some, number), own = of_problems(rows, part, left), take_problems(prior, left)
        starts = [staged(some, number, own, slacks_mm) for slacks_mm in STARTS_MM[1:]]
        u, angles = (np.concatenate(one, axis=1) for one in zip(*starts, strict=True))
        problems = np.tile(left, len(starts))
        apart = _apart(u, found.u[:, problems])
        of_start = np.concatenate([number + k * len(left) for k in range(len(starts))])
        angles = angles[:, apart[of_start]]
        _keep_lower(found, rows, part, prior, problems[apart], u[:, apart], angles)
        _with_starts_of_kin(found, rows, part, prior, kin, left)
    lost = np.flatnonzero(~found.settled)
    if len(lost):  # no start has led anywhere: the first goes on
        some, number = of_problems(rows, part, lost)
        u, angles = first[0][:, lost], first[1][:, np.isin(part, lost)]
        _put(found, part, lost, most_probable(some, number, take_problems(prior, lost), u, angles))
    return found


def _with_starts_of_kin(found: Posterior, rows: Rows, part: Int[np.ndarray, " rows"], prior: Prior, kin, left) -> None:
    """Start the problems ``left`` from the girdles of their kin with the lowest F."""
    of_left, other = np.nonzero((kin[left, None] == kin) & (left[:, None] != np.arange(len(kin))) & found.settled)
    u = take_problems(prior, left[of_left]).u_of(prior.numbers_at(found.u)[:, other])
    apart = _apart(u, found.u[:, left[of_left]])
    problems, u = left[of_left[apart]], u[:, apart]
    if not len(problems):
        return
    (some, number), own = of_problems(rows, part, problems), take_problems(prior, problems)
    numbers, measured = own.numbers_at(u)[:, number], (some.active_effects, some.angles, some.measured)
    y = nearest_by_numbers(numbers, *measured, some.angles).y
    F = np.bincount(number, (y**2).sum(axis=0), len(problems)) + own.noise_deg**2 * (u**2).sum(axis=0)
    order = np.lexsort((F, problems))  # of a problem, the lowest first
    rank = np.arange(len(order)) - np.searchsorted(problems, problems)
    chosen = np.sort(order[(rank < _MOST_KIN) & np.isfinite(F[order])])
    angles = some.angles[:, np.isin(number, chosen)]
    _keep_lower(found, rows, part, prior, problems[chosen], u[:, chosen], angles, _KIN_STEPS)


def _apart(u: Float[np.ndarray, "n starts"], end: Float[np.ndarray, "n starts"]) -> Bool[np.ndarray, " starts"]:
    """Whether starts are away from where a search ended, or that is at no number."""
    return ~(np.abs(u - end).max(axis=0) <= _APART_SDS)


def _keep_lower(
    found: Posterior, rows: Rows, part: Int[np.ndarray, " rows"], prior: Prior, problems, u, angles, *most_steps: int
) -> None:
    """Start problems, any as often as wanted, and put where the lowest end of each is lower than what was found."""
    if not len(problems):
        return
    some, number = of_problems(rows, part, problems)
    ends = most_probable(some, number, take_problems(prior, problems), u, angles, *most_steps)
    F = np.where(ends.settled, ends.F, np.inf)
    order = np.lexsort((F, problems))
    lowest = order[np.unique(problems[order], return_index=True)[1]]
    lowest = lowest[F[lowest] < np.where(found.settled, found.F, np.inf)[problems[lowest]]]
    _put(found, part, problems[lowest], take_found(ends, number, lowest))


def _put(found: Posterior, part: Int[np.ndarray, " rows"], problems, other: Posterior) -> None:
    """Put the other ends of these problems in their places."""
    put_problems(found.nearest, np.flatnonzero(np.isin(part, problems)), other.nearest)
    put_problems(found._replace(nearest=()), problems, other._replace(nearest=()))  # pyright: ignore[reportArgumentType]
