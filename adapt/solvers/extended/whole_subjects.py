"""Whole-subject problems with effects at work, by Gauss-Newton steps: the fast path of ``adapt_batch`` with effects.

What does not converge here is left to the reference solver.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from adapt.engine.batching import take_problems
from adapt.solvers.batched.subject import Fixed
from adapt.solvers.extended.gauss_newton import End, minimise
from adapt.solvers.extended.joint_parts import Shared
from adapt.solvers.extended.postures import FREE_SD
from adapt.solvers.extended.problem_rows import parts_of, row_weights, rows_of
from adapt.solvers.reference.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from adapt.solvers.reference.subject import THETA_TOLERANCE, Subject
from models.adapted_parameters import ADAPTED
from models.effects import ActiveEffects
from motions.rotations import DEG

_MOST_STEPS = 200
"""Most take 5 to 20."""

_ROUNDS = 8
"""Each takes on those that have not converged: most often their postures, projected once more, are as near as they can
be; angles that were not measured begin anew where they are, until they stay."""


def solve_extended(
    fixed: Fixed,
    active_effects: ActiveEffects,
    theta: Float[np.ndarray, "adapted problems"],
    angles: Float[np.ndarray, "6 postures problems"],
) -> Subject:
    """Find the optimum of each problem reached from here (rad, mm); look at ``converged``."""
    found, left = _unsolved(theta, angles), np.arange(theta.shape[1])
    for _ in range(_ROUNDS):
        if not len(left):
            break
        some, active = take_problems((fixed, active_effects), left)
        _put(found, left, some, _steps(some, active, found.theta[:, left], found.angles[..., left]))
        left = left[~found.converged[left]]
    return found


def _unsolved(theta, angles) -> Subject:
    """Everything as it stands, nothing converged."""
    _, postures, count = angles.shape
    return Subject(
        theta=np.array(theta, float),
        angles=np.array(angles, float),
        multipliers=np.zeros((3, postures, count)),
        penalty=np.zeros((postures, count)),
        residual_mm=np.zeros((3, postures, count)),
        stationarity=np.zeros((postures, count)),
        slope=np.full((len(ADAPTED), count), np.inf),
        radius_mm=np.zeros(count),
        iterations=np.zeros(count, int),
        converged=np.zeros(count, bool),
    )


def _steps(fixed: Fixed, active_effects: ActiveEffects, theta, angles) -> End:
    problem, posture = rows_of(fixed)
    count, parts = theta.shape[1], parts_of(fixed, active_effects)
    nothing = Shared(np.zeros((0, len(parts.strengths), len(problem))), np.zeros((count, 0)), np.zeros((count, 0)))

    def finished(_, slope: Float[np.ndarray, "parts adapted"]) -> Bool[np.ndarray, " parts"]:
        return np.abs(slope).max(axis=1) <= THETA_TOLERANCE

    start = angles[:, posture, problem] * float(DEG)
    measured = parts.sd == 1.0
    parts = replace(
        parts, measured_deg=np.where(measured, parts.measured_deg, start), sd=np.where(measured, 1.0, FREE_SD)
    )
    return minimise(parts, nothing, theta.T, np.zeros((count, 0)), finished, _MOST_STEPS, start)


def _put(found: Subject, left, fixed: Fixed, end: End) -> None:
    """Write the ends of some problems into their places, with their conditions."""
    problem, posture = rows_of(fixed)
    at = left[problem]
    near, weights = end.nearest, row_weights(fixed)
    measured_deg = np.asarray(fixed.problem.measured)[:, posture, problem] * float(DEG)
    apart = np.where(np.asarray(fixed.problem.weights)[:, posture, problem] > 0.0, near.angles_deg - measured_deg, 0.0)
    moved = apart + np.einsum("kar,kr->ar", near.B, near.y)
    found.theta[:, left] = end.theta_mm.T
    found.angles[:, posture, at] = near.angles_deg / float(DEG)
    found.multipliers[:, posture, at] = 2.0 * weights * near.h
    found.residual_mm[:, posture, at] = near.g_mm
    found.stationarity[posture, at] = 2.0 * weights * np.abs(moved).max(axis=0)
    found.slope[:, left] = end.slope.T
    found.iterations[left] += end.steps
    closed = np.abs(found.residual_mm[..., left]).max(axis=(0, 1)) <= CONSTRAINT_TOLERANCE_MM
    still = found.stationarity[:, left].max(axis=0) <= STATIONARITY_TOLERANCE
    found.converged[left] = closed & still & (np.abs(end.slope) <= THETA_TOLERANCE).all(axis=1)
