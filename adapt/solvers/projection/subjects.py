"""Whole subjects of any chain by damped Gauss-Newton steps: adaptations, adaptations with subject-level sizes of
effects, and the curvature at the optimum. Each problem is a group of its own
(``adapt.solvers.projection.grouped_problems``)."""

from dataclasses import replace
from functools import partial

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import refit
from adapt.solvers import status
from adapt.solvers.newton.subject import SubjectProblem
from adapt.solvers.projection.gauss_newton import End, minimise
from adapt.solvers.projection.grouped_problems import GroupedProblems, Shared, acting
from adapt.solvers.projection.nearest_posture import NO_CHANNELS, Nearest, strengths_of
from adapt.solvers.projection.thorax_term import Thorax
from adapt.solvers.solution import (
    CONSTRAINT_TOLERANCE_MM,
    STATIONARITY_TOLERANCE,
    THETA_TOLERANCE,
    SubjectSolution,
)
from adapt.solvers.unmeasured import HELD_SD, LOOSELY_HELD_SD, gap, have_weight
from models.adapted_parameters import ADAPTED
from models.effects import NO_ACTIVE_EFFECTS, ActiveEffects
from motions.rotations import DEG

_MOST_STEPS = 200
"""Largest number of steps; most problems take 5 to 20."""

_ROUNDS = 8
"""Largest number of rounds for problems that have not converged. Most often their postures, projected once more, become
as near as they can be; unmeasured angles begin anew at their last values until they stay."""

_MOST_STEPS_OF_SIZES = 400
"""Largest number of steps with sizes: of measured shoulders with three to five causes half take fewer than 140, the
hardest 350."""

_SETTLED = 1e-20
"""Predicted decrease of E, mm^2, at which the sizes have converged. At a larger tolerance rounding decides where the
search ends (1e-8 leaves 3e-4 of a size); rounding of the slope leaves 1e-24."""

_LEAST_WEIGHT = 1e-9
"""Smallest weight of |v|^2 in E: with w = 0 no data inform the sizes, and they stay at the mean."""

_MOST_ROUNDS, _AT_REST_RAD = 40, 1e-12
"""Largest number of rounds for unmeasured angles at a shifted parameter, and the change at which they stay; the hardest
case that was tried takes 12 rounds."""

_STEP_MM = 1e-3
"""Step of the differences of the slope. Truncation, proportional to its square times third derivatives, is 1e-8 of the
second derivatives; rounding of the slope is 1e-11."""


def fit_subjects(
    problem: SubjectProblem,
    theta: Float[np.ndarray, "adapted problems"],
    angles: Float[np.ndarray, "6 postures problems"],
    active_effects: ActiveEffects = NO_ACTIVE_EFFECTS,
) -> SubjectSolution:
    """Find the optimum of each problem reached from this start (mm, rad); check ``converged``."""
    found = _unsolved(theta, angles)
    some_free = np.any(~have_weight(problem.weights) & problem.counted, axis=(0, 1))
    for unmeasured_sd, which in ((HELD_SD, True), (LOOSELY_HELD_SD, some_free)):
        for _ in range(_ROUNDS):
            further = partial(_further, unmeasured_sd)
            refit(found, ~found.converged & which, further, problem, active_effects, found)
    return found


def _further(
    unmeasured_sd: float, problem: SubjectProblem, active_effects: ActiveEffects, before: SubjectSolution
) -> SubjectSolution:
    end = _steps(problem, active_effects, before.theta, before.angles, unmeasured_sd)
    return _solution(problem, end, before.angles, before.iterations)


def _unsolved(theta, angles) -> SubjectSolution:
    """Return the start as a solution that has not converged."""
    _, postures, count = angles.shape
    return SubjectSolution(
        theta=np.array(theta, float),
        angles=np.array(angles, float),
        multipliers=np.zeros((3, postures, count)),
        residual_mm=np.zeros((3, postures, count)),
        stationarity=np.zeros((postures, count)),
        slope=np.full((len(ADAPTED), count), np.inf),
        iterations=np.zeros(count, int),
        code=np.full(count, status.UNCONVERGED),
    )


def _steps(problem: SubjectProblem, active_effects: ActiveEffects, theta, angles, unmeasured_sd: float) -> End:
    """Take the steps of an adaptation in which every unmeasured angle is loosely held to its start."""
    grouped = as_grouped(problem, active_effects)
    count, start = theta.shape[1], _of_rows(problem, angles)
    none = np.zeros((0, count))
    nothing = Shared(np.zeros((0, 0, count), int), np.zeros((0, 0, start.shape[1])), none, none)

    def finished(_, slope: Float[np.ndarray, "adapted problems"]) -> Bool[np.ndarray, " problems"]:
        return np.abs(slope).max(axis=0) <= THETA_TOLERANCE

    grouped = replace(grouped, angles=np.where(grouped.measured, grouped.angles, start), unmeasured_sd=unmeasured_sd)
    return minimise(grouped, nothing, theta, np.zeros((0, count)), finished, _MOST_STEPS, start)


def _solution(problem: SubjectProblem, end: End, angles, iterations: Int[np.ndarray, " problems"]) -> SubjectSolution:
    """Return the end of the steps as a solution, with its optimality conditions; padding keeps its ``angles``."""
    near, weights, places = end.nearest, row_weights(problem), _rows(problem)
    target, measured = (_of_rows(problem, x) for x in (problem.angles, have_weight(problem.weights)))
    moved = gap(near.angles, target, measured) + np.einsum("kar,kr->ar", near.B, near.y) / float(DEG) ** 2
    found = _unsolved(end.theta_mm, angles)
    for whole, rows in (
        (found.angles, near.angles),
        (found.multipliers, 2.0 * weights * near.h),
        (found.residual_mm, near.g_mm),
        (found.stationarity, 2.0 * weights * float(DEG) * np.abs(moved).max(axis=0)),
    ):
        whole[..., *places] = rows
    closed = np.abs(found.residual_mm).max(axis=(0, 1)) <= CONSTRAINT_TOLERANCE_MM
    still = found.stationarity.max(axis=0) <= STATIONARITY_TOLERANCE
    converged = closed & still & (np.abs(end.slope) <= THETA_TOLERANCE).all(axis=0)
    return found._replace(
        slope=end.slope,
        iterations=iterations + end.steps,
        code=np.where(converged, status.CONVERGED, status.UNCONVERGED),
    )


def fit_sizes(
    problem: SubjectProblem,
    theta: Float[np.ndarray, "adapted problems"],
    angles: Float[np.ndarray, "6 postures problems"],
    active_effects: ActiveEffects,
) -> tuple[
    Float[np.ndarray, "sizes problems"],
    Float[np.ndarray, "adapted problems"],
    Float[np.ndarray, " problems"],
    Bool[np.ndarray, " problems"],
]:
    """Find sizes of effects that differ between persons, together with the adapted parameters, from this start
    (mm, rad).

        min over theta and v of E = D + w (mean(J_p) + |v|^2 / (6 n)),   sizes = mean + SD v

    for n postures with six measured angles each. A size one SD off counts as much as one degree in one angle of one
    posture. If the SDs are SDs between persons over the SD of the noise, the result is the posterior mode for white
    noise, with D in place of the prior of the parameters. Return v, theta, E without the term of v, and which problems
    have converged.
    """
    grouped = as_grouped(problem, active_effects)
    columns = [_of_rows(problem, one) for one in active_effects.own]
    shape = sum(map(len, columns)), len(grouped.group)
    scale = np.broadcast_to(1.0 / np.sqrt(weight_of_sizes(grouped)), shape)
    channels, strengths = acting(strengths_of(columns))
    shared = Shared(np.repeat(channels[..., None], shape[1], axis=2), strengths, scale, np.zeros(shape))
    start = _of_rows(problem, angles)

    def finished(gain, _) -> Bool[np.ndarray, " problems"]:
        return gain < _SETTLED

    end = minimise(grouped, shared, theta, np.zeros(shape), finished, _MOST_STEPS_OF_SIZES, start)
    return end.amplitude, end.theta_mm, end.E, end.settled


def weight_of_sizes(grouped: GroupedProblems) -> Float[np.ndarray, " problems"]:
    """Compute the weight of |v|^2 in E: that of one degree in one angle of a posture."""
    return np.maximum(grouped.sums(grouped.weights) / grouped.sums(np.ones(len(grouped.weights))), _LEAST_WEIGHT)


def motion_curvature(
    problem: SubjectProblem,
    theta: Float[np.ndarray, "adapted problems"],
    angles: Float[np.ndarray, "6 postures problems"],
    active_effects: ActiveEffects,
) -> tuple[Float[np.ndarray, "adapted adapted problems"], Float[np.ndarray, "6 postures adapted problems"]]:
    """Compute d2(w mean J)/dtheta2 at an optimum, and dq/dtheta of every posture, rad per mm; 0 for padding.

    Central differences of the exact slope of w mean J and of q need no compilation.
    """
    grouped, start = as_grouped(problem, active_effects), _of_rows(problem, angles)
    grouped = replace(grouped, angles=np.where(grouped.measured, grouped.angles, start))
    n, (_, postures, count) = len(ADAPTED), problem.angles.shape
    hessian, moved = np.zeros((n, n, count)), np.zeros((6, postures, n, count))
    posture, number = _rows(problem)
    for k in range(n):
        ends = []
        for sign in (1.0, -1.0):
            shifted = np.array(theta)
            shifted[k] += sign * _STEP_MM
            near = _settled(grouped, shifted, start)
            slope = 2.0 * grouped.weights * np.einsum("kir,kr->ir", near.by_theta, near.y)
            ends.append((grouped.sums(slope), near.angles))
        hessian[:, k] = (ends[0][0] - ends[1][0]) / (2.0 * _STEP_MM)
        moved[:, posture, k, number] = (ends[0][1] - ends[1][1]) / (2.0 * _STEP_MM)
    return 0.5 * (hessian + np.swapaxes(hessian, 0, 1)), moved


def _settled(grouped: GroupedProblems, theta, start) -> Nearest:
    """Find the nearest postures with unmeasured angles at values where they stay: each round holds them to their last
    values."""
    near = grouped.nearest(theta, grouped.strengths, start)
    for _ in range(_MOST_ROUNDS):
        if grouped.measured.all() or np.abs(near.angles - start).max() <= _AT_REST_RAD:
            break
        start = near.angles
        grouped = replace(grouped, angles=np.where(grouped.measured, grouped.angles, start))
        near = grouped.nearest(theta, grouped.strengths, start)
    return near


def as_grouped(problem: SubjectProblem, active_effects: ActiveEffects) -> GroupedProblems:
    """Convert the counted postures to rows, each problem a group of its own."""
    girdle, strengths = jax.tree.map(np.asarray, problem.girdle), active_effects.strengths
    _, number = _rows(problem)
    return GroupedProblems(
        girdle=girdle,
        thorax=Thorax(girdle, problem.points_mm, problem.point_weights, problem.levels_mm),
        bounds_mm=(np.asarray(problem.lower), np.asarray(problem.upper)),
        effects=active_effects.effects,
        strengths=np.concatenate([_of_rows(problem, one) for one in strengths])
        if strengths
        else np.zeros((NO_CHANNELS, len(number))),
        angles=_of_rows(problem, problem.angles),
        measured=_of_rows(problem, have_weight(problem.weights)),
        weights=row_weights(problem),
        problem=number,
        group=np.arange(problem.counted.shape[-1]),
        strengths_are_known=not active_effects.own,
    )


def row_weights(problem: SubjectProblem) -> Float[np.ndarray, " rows"]:
    """Compute the weights of |y|^2 in E, deg^2: the weights of the measured angles."""
    return _of_rows(problem, problem.weights).max(axis=0) / (2.0 * float(DEG) ** 2)


def _rows(problem: SubjectProblem) -> tuple[Int[np.ndarray, " rows"], Int[np.ndarray, " rows"]]:
    """Return posture and problem of every counted row, problem by problem."""
    number, posture = np.nonzero(np.asarray(problem.counted).T)
    return posture, number


def _of_rows(problem: SubjectProblem, values) -> np.ndarray:
    """Select the counted postures of (..., postures, problems) as rows."""
    return np.asarray(values)[..., *_rows(problem)]
