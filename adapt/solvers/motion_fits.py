"""Posture fits of the rows of motions, with given girdles or from the optima of adaptations. Solutions are followed
from posture to posture along each motion, to keep them on one branch; jumps between branches are marked."""

import itertools
from collections.abc import Callable
from functools import partial

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import put_problems, refit, take_problems
from adapt.solvers import newton, status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.objective import mean_square_deg2
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems
from adapt.solvers.projection.postures import fit_from
from adapt.solvers.rows import PostureRows
from adapt.solvers.solution import PostureSolution
from adapt.solvers.unmeasured import angle_weights
from models.effects import AnyGirdle
from models.girdle import Girdle
from motions.arrays import ByType

SAME_BRANCH_RAD = ByType(1e-6, 1e-4)
"""Difference below which two solutions are the same: converged ones agree to 1e-9 rad, in float32 to 2e-6."""

_TRACKING_STEPS, _SHORT_TRACKING_STEPS = 4, 16
"""Numbers of steps from one posture to the next, along the straight line between their measured angles."""

_MOST_RISE, _FREE_RISE_DEG2 = 1.15, 1.0
"""Largest mean J of a motion on one branch, relative to its independent fits and beyond: of 300 simulated subjects and
six sets following raises it by up to 5 %. A posture that is measured wrongly, by 90 degrees in one angle or by a turn,
leads the postures after it away and raises it by 30 % or more."""


def fit_rows(rows: PostureRows, girdle: Girdle) -> PostureSolution:
    """Fit every row with its girdle, on one branch along each motion where there is one."""
    chain = rows.active_effects.on(girdle)
    fitted = fit_batch(chain, rows.angles, rows.measured)
    return follow_motions(fitted, chain, rows.angles, rows.measured, rows.previous)


def rows_of_optima(rows: PostureRows, data: Problems, adapted: Adapted) -> PostureSolution:
    """Return the postures of the optima, on which E = D + w mean(J) is based, with their jumps marked.

    Postures without an optimum, or of an optimum that does not determine them (w = 0), are fitted with the final
    girdle, to show which postures cause the failure.
    """
    subjects, models = len(rows.subjects), data.counted.shape[1] // len(rows.subjects)
    one = rows.unpacked(np.indices(rows.counted.shape))
    posture, problem = np.tile(one[0], models), np.concatenate([one[1] + k * subjects for k in range(models)])
    rows = rows.repeated(models, data.angles.dtype)
    chain = data.girdles_at(adapted.theta_mm, posture, problem)
    fitted = _at_optimum(rows, adapted, posture, problem)
    without = ~((adapted.code[problem] == status.CONVERGED) & np.isfinite(fitted.multipliers).all(axis=0))
    refit(fitted, without, fit_batch, chain, rows.angles, rows.measured, fitted.angles)
    return follow_motions(fitted, chain, rows.angles, rows.measured, rows.previous, may_move=without)


def _at_optimum(rows: PostureRows, adapted: Adapted, posture, problem) -> PostureSolution:
    def at(values: np.ndarray) -> np.ndarray:
        return np.array(values[..., posture, problem])

    angles = at(adapted.angles)
    return PostureSolution(
        angles=angles,
        multipliers=at(adapted.multipliers),
        residual_mm=at(adapted.residual_mm),
        stationarity=at(adapted.stationarity),
        j_deg2=mean_square_deg2(angles, rows.angles, angle_weights(rows.measured)),
        iterations=adapted.iterations[problem],
        code=np.full(len(problem), status.CONVERGED),
        jump=np.zeros(len(problem), bool),
    )


def follow_motions(
    fitted: PostureSolution,
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    previous: Int[np.ndarray, " problems"],
    may_move: bool | Bool[np.ndarray, " problems"] = True,
) -> PostureSolution:
    """Bring the fits onto one branch along each motion, where there is one, and mark jumps where there is not.

    ``previous`` is the problem of the previous posture, or -1 at the start of a motion. Two neighbours are on one
    branch when continuation from one leads to the other. A motion with a jump is followed outward from its best posture
    (lowest J): where continuation succeeds, its solution replaces the independent fit, unless the motion then fits
    clearly worse (``_MOST_RISE``). Continuation runs in float64.
    ``may_move``: True for postures that may change; motions with any other posture keep all their fits.
    """
    problem, same_rad = (girdle, angles.astype(float), measured), SAME_BRANCH_RAD.for_dtype_of(angles)
    fitted = jax.tree.map(np.copy, fitted)
    fitted.jump[:] = _breaks(fitted, problem, previous, same_rad)
    held = ~np.broadcast_to(may_move, previous.shape)
    with_jump = [one for one in _motions_of(previous) if fitted.jump[one].any() and not held[one].any()]
    if with_jump:
        independent = jax.tree.map(np.copy, fitted)
        _follow_from_best(fitted, problem, with_jump)
        for one in with_jump:
            if _fit_clearly_worse(fitted.j_deg2[one], independent.j_deg2[one]):
                put_problems(fitted, one, take_problems(independent, one))
        moved = np.concatenate(with_jump)
        of_moved = np.where(np.isin(np.arange(len(previous)), moved), previous, -1)
        fitted.jump[moved] = _breaks(fitted, problem, of_moved, same_rad)[moved]
    return fitted


def _fit_clearly_worse(followed_deg2: Float[np.ndarray, " postures"], independent_deg2) -> bool:
    """Check whether the mean J of a followed motion is beyond ``_MOST_RISE``; failed postures do not count."""
    both = np.isfinite(followed_deg2) & np.isfinite(independent_deg2)
    rise = followed_deg2[both] - _MOST_RISE * independent_deg2[both] - _FREE_RISE_DEG2
    return bool(rise.sum() > 0.0)


def _follow_from_best(fitted: PostureSolution, problem, motions: list[Int[np.ndarray, " postures"]]) -> None:
    """Follow all motions in parallel, forwards and backwards from the best posture of each."""
    orders = []
    for problems in motions:
        best = int(np.argmin(np.where(fitted.converged[problems], fitted.j_deg2[problems], np.inf)))
        orders += [list(itertools.pairwise(problems[best:])), list(itertools.pairwise(problems[best::-1]))]
    for number in range(max(map(len, orders), default=0)):
        before, after = np.array([order[number] for order in orders if number < len(order)]).T
        for track in _trackers(problem[0]):
            if not len(after):
                break
            tracked = _track(fitted, problem, before, after, track)
            arrived = tracked.converged
            put_problems(fitted, after[arrived], take_problems(tracked, arrived))
            before, after = before[~arrived], after[~arrived]


def _trackers(girdle: AnyGirdle) -> list[Callable[..., PostureSolution]]:
    """Return the continuation functions: steps along the line and, for the chain without effects, shorter steps where
    these fail."""
    if isinstance(girdle, Girdle):
        return [partial(newton.track_postures, steps) for steps in (_TRACKING_STEPS, _SHORT_TRACKING_STEPS)]
    return [_track_by_projections]


def _breaks(fitted: PostureSolution, problem, previous, same_rad: float) -> Bool[np.ndarray, " problems"]:
    """Return where continuation from the previous posture does not lead to this one."""
    after = np.flatnonzero(previous >= 0)
    good = fitted.converged[after] & fitted.converged[previous[after]]
    after, broken = after[good], np.zeros(len(previous), bool)
    for track in _trackers(problem[0]):
        if not len(after):
            break
        tracked = _track(fitted, problem, previous[after], after, track)
        near = np.abs(tracked.angles - fitted.angles[:, after]).max(axis=0) <= same_rad
        broken[after] = ~near
        after = after[~tracked.converged]
    return broken


def _track(fitted: PostureSolution, problem, before, after, track) -> PostureSolution:
    _, target, _ = problem
    tracked = track(*take_problems(problem, after), target[:, before], fitted.angles[:, before])
    tracked.code[~np.isfinite(tracked.j_deg2)] = status.UNCONVERGED
    return tracked


def _motions_of(previous: Int[np.ndarray, " problems"]) -> list[Int[np.ndarray, " postures"]]:
    """List the problems of each motion, in order."""
    following = {int(p): i for i, p in enumerate(previous) if p >= 0}
    chains = []
    for first in np.flatnonzero(previous < 0):
        chain = [int(first)]
        while chain[-1] in following:
            chain.append(following[chain[-1]])
        chains.append(np.array(chain))
    return chains


def _track_by_projections(girdle, angles, measured, angles_before, start) -> PostureSolution:
    """Follow the solution while the measured angles move in a straight line from one posture to the next."""
    for fraction in np.arange(1, _TRACKING_STEPS) / _TRACKING_STEPS:
        start = fit_from(girdle, angles_before + fraction * (angles - angles_before), measured, start).angles
    return fit_from(girdle, angles, measured, start)
