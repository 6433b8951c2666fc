"""Fits on one branch along a motion: solutions followed from posture to posture, and jumps between branches marked."""

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import take_problems
from adapt.solvers import status
from adapt.solvers.batched.posture import SweptPostures
from adapt.solvers.batched.posture_kernels import tracked
from adapt.solvers.extended.postures import fit_extended
from adapt.solvers.posture_fits import Fitted, as_fitted, reference_fit
from adapt.solvers.reference.posture import objective_weights
from models.effects import AnyGirdle
from models.girdle import Girdle
from motions.arrays import ByType
from motions.rhythm import REST_DEG
from motions.rotations import DEG

SAME_BRANCH_RAD = ByType(1e-6, 1e-4)
"""Two solutions this close are one: converged ones agree to 1e-9 rad, one in float32 to 2e-6."""

_TRACKING_STEPS, _SHORT_TRACKING_STEPS = 4, 16
"""A posture is followed to the next one in this many steps along the straight line of measured angles."""


def follow_motions(
    fitted: Fitted,
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    previous: Int[np.ndarray, " problems"],
) -> Fitted:
    """Bring the fits onto one branch along each motion, where there is one, and mark jumps where there is not.

    ``previous`` is the problem of the posture before, or -1 at the start of a motion. Two neighbours are on one branch
    when continuation from one leads to the other. A motion with a jump is followed outward from its best posture
    (lowest J): where continuation succeeds, its solution replaces the one found on its own. It is done in float64.
    """
    problem, fitted = _targets(girdle, angles, measured), mark_jumps(fitted, girdle, angles, measured, previous)
    with_jump = [problems for problems in _motions_of(previous) if fitted.jump[problems].any()]
    if with_jump:
        _follow_from_best(fitted, problem, with_jump)
        moved = np.concatenate(with_jump)
        of_moved = np.where(np.isin(np.arange(len(previous)), moved), previous, -1)
        fitted.jump[moved] = _breaks(fitted, problem, of_moved, SAME_BRANCH_RAD.for_dtype_of(angles))[moved]
    return fitted


def mark_jumps(
    fitted: Fitted,
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    previous: Int[np.ndarray, " problems"],
) -> Fitted:
    """Mark where a fit is not on the branch of the posture before (see :func:`follow_motions`); move none."""
    fitted = fitted.copy()
    fitted.jump[:] = _breaks(fitted, _targets(girdle, angles, measured), previous, SAME_BRANCH_RAD.for_dtype_of(angles))
    return fitted


def _targets(girdle: AnyGirdle, angles, measured):
    """Girdle, target and weights of each problem; an angle that was not measured has that of rest, without weight."""
    target = np.where(measured, angles, REST_DEG[:, None] / DEG).astype(float)
    return girdle, target, objective_weights(measured)


def _follow_from_best(fitted: Fitted, problem, motions: list[Int[np.ndarray, " postures"]]) -> None:
    """All motions in step, up and down from the best posture of each."""
    orders = []
    for problems in motions:
        best = int(np.argmin(np.where(fitted.status[problems] == status.OK, fitted.j_deg2[problems], np.inf)))
        orders += [list(itertools.pairwise(problems[best:])), list(itertools.pairwise(problems[best::-1]))]
    for number in range(max(map(len, orders), default=0)):
        before, after = np.array([order[number] for order in orders if number < len(order)]).T
        for track in _trackers(problem[0]):
            if not len(after):
                break
            tracked = _track(fitted, problem, before, after, track)
            arrived = tracked.status == status.OK
            fitted.put(after[arrived], tracked.take(arrived))
            before, after = before[~arrived], after[~arrived]


def _trackers(girdle: AnyGirdle) -> list[Callable[..., SweptPostures]]:
    """The fast path, in shorter steps for what it did not follow; with effects theirs, then the reference solver."""
    if isinstance(girdle, Girdle):
        return [partial(tracked, steps) for steps in (_TRACKING_STEPS, _SHORT_TRACKING_STEPS)]
    return [partial(_track_straight, fit) for fit in (fit_extended, reference_fit)]


def _breaks(fitted: Fitted, problem, previous, same_rad: float) -> Bool[np.ndarray, " problems"]:
    """Where continuation from the posture before does not lead to this one."""
    after = np.flatnonzero(previous >= 0)
    good = (fitted.status[after] == status.OK) & (fitted.status[previous[after]] == status.OK)
    after, broken = after[good], np.zeros(len(previous), bool)
    for track in _trackers(problem[0]):
        if not len(after):
            break
        tracked = _track(fitted, problem, previous[after], after, track)
        near = np.abs(tracked.angles - fitted.angles[:, after]).max(axis=0) <= same_rad
        broken[after] = ~near
        after = after[tracked.status != status.OK]
    return broken


def _track(fitted: Fitted, problem, before, after, track) -> Fitted:
    girdle, target, weights = problem
    part = take_problems((girdle, target, weights), after)
    return as_fitted(track(*part, target[:, before], fitted.angles[:, before]))


def _motions_of(previous: Int[np.ndarray, " problems"]) -> list[Int[np.ndarray, " postures"]]:
    """The problems of each motion in order."""
    following = {int(p): i for i, p in enumerate(previous) if p >= 0}
    chains = []
    for first in np.flatnonzero(previous < 0):
        chain = [int(first)]
        while chain[-1] in following:
            chain.append(following[chain[-1]])
        chains.append(np.array(chain))
    return chains


def _track_straight(fit: Callable[..., SweptPostures], girdle, target, weights, target_before, start) -> SweptPostures:
    """Continuation: follow the solution while the measured angles go straight from one posture to the next."""
    for fraction in np.arange(1, _TRACKING_STEPS) / _TRACKING_STEPS:
        start = fit(girdle, target_before + fraction * (target - target_before), weights, start).angles
    return fit(girdle, target, weights, start)
