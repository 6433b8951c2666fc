"""Solutions of posture fits and adaptations, with their status and the tolerances of convergence.

A posture fit minimises J(q) subject to g(q) = 0, an adaptation E(theta, q) subject to g(q_p, theta) = 0 and bounds on
theta. At an optimum the chain is closed, g = 0, and dJ/dq + G' lambda = 0; for the free parameters dE/dtheta = 0. Every
solver tests its convergence by these conditions, with g and the closest points computed anew. The last axis is the
problem.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt.engine.batching import put_problems, take_problems
from adapt.solvers import status

CONSTRAINT_TOLERANCE_MM = 1e-9
"""Tolerance of |g|. Rounding in the distance to an ellipsoid of 400 mm leaves about 1e-12 mm."""

STATIONARITY_TOLERANCE = 1e-10
"""Tolerance of |dJ/dq + G' lambda|, deg^2 per degree. Rounding leaves about 1e-13."""

THETA_TOLERANCE = 1e-8
"""Tolerance of |dE/dtheta| for a free parameter, mm^2 (of E) per mm. A parameter 1 mm away would change E by 1e-8."""


class PostureSolution(NamedTuple):
    """Posture fits of a batch of problems."""

    angles: Float[np.ndarray, "6 problems"]
    """Angles q, rad."""
    multipliers: Float[np.ndarray, "3 problems"]
    """Lagrange multipliers lambda of A1-A3: cost of one millimetre of each constraint, deg^2 per mm."""
    residual_mm: Float[np.ndarray, "3 problems"]
    """Constraint violation g(q)."""
    stationarity: Float[np.ndarray, " problems"]
    """max |dJ/dq + G' lambda|, deg^2 per degree."""
    j_deg2: Float[np.ndarray, " problems"]
    iterations: Int[np.ndarray, " problems"]
    code: Int[np.ndarray, " problems"]
    """Index into ``status.WORDS``."""
    jump: Bool[np.ndarray, " problems"]
    """True where the posture is not on the branch of the previous posture of its motion."""

    @property
    def status(self) -> Shaped[np.ndarray, " problems"]:
        """Status word of each fit."""
        return status.WORDS[self.code]

    @property
    def converged(self) -> Bool[np.ndarray, " problems"]:
        """True where the chain is closed and J is stationary, both to tolerance."""
        return self.code == status.CONVERGED


def put_lower(found: PostureSolution, problems: Int[np.ndarray, " again"], other: PostureSolution) -> None:
    """Replace fits of these problems by converged fits of ``other`` where the old fit has a higher J or did not
    converge."""
    lower = other.converged & ~(found.converged[problems] & (found.j_deg2[problems] <= other.j_deg2))
    put_problems(found, problems[lower], take_problems(other, lower))


class SubjectSolution(NamedTuple):
    """Solutions of a kernel for whole subjects: adapted parameters and all postures."""

    theta: Float[np.ndarray, "adapted problems"]
    """Adapted parameters, mm."""
    angles: Float[np.ndarray, "6 postures problems"]
    """Angles of the postures, rad."""
    multipliers: Float[np.ndarray, "3 postures problems"]
    """Multipliers of A1-A3 in E, per mm: w / postures times the multipliers of the posture fit."""
    residual_mm: Float[np.ndarray, "3 postures problems"]
    stationarity: Float[np.ndarray, "postures problems"]
    """max |dE/dq + G' lambda|, E per degree."""
    slope: Float[np.ndarray, "adapted problems"]
    """dE/dtheta by the envelope theorem: dD/dtheta + sum_p T' lambda. Zero for a parameter held by its bound."""
    iterations: Int[np.ndarray, " problems"]
    code: Int[np.ndarray, " problems"]
    """Index into ``status.WORDS``."""

    @property
    def converged(self) -> Bool[np.ndarray, " problems"]:
        """True where chains are closed, and postures and parameters stationary, all to tolerance."""
        return self.code == status.CONVERGED
