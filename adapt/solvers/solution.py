"""How a fit ends: the tolerances of an optimum, and the solutions of postures and of subjects with their status.

A posture minimises J(q) subject to g(q) = 0, a subject E(theta, q) subject to g(q_p, theta) = 0 and bounds on theta. At
an optimum the chain is closed, |g| = 0, and dJ/dq + G' lambda = 0, dE/dtheta = 0 in what is free. Every solver judges
its own end by these conditions, with g and the closest points computed anew. The last axis is the problem.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt.engine.batching import put_problems, take_problems
from adapt.solvers import status

CONSTRAINT_TOLERANCE_MM = 1e-9
"""|g| of a converged posture. Rounding in the distance to an ellipsoid of 400 mm leaves about 1e-12 mm."""

STATIONARITY_TOLERANCE = 1e-10
"""|dJ/dq + G' lambda| of a converged posture, deg^2 per degree. Rounding leaves about 1e-13."""

THETA_TOLERANCE = 1e-8
"""|dE/dtheta| of a converged free parameter: mm^2 (of E) a mm. A parameter 1 mm away would change E by 1e-8."""


class PostureSolution(NamedTuple):
    """Posture fits of a batch of problems."""

    angles: Float[np.ndarray, "6 problems"]
    """q, rad."""
    multipliers: Float[np.ndarray, "3 problems"]
    """lambda of A1-A3: what one millimetre of each constraint costs, deg^2 a mm."""
    residual_mm: Float[np.ndarray, "3 problems"]
    """g(q)."""
    stationarity: Float[np.ndarray, " problems"]
    """max |dJ/dq + G' lambda|, deg^2 a degree."""
    j_deg2: Float[np.ndarray, " problems"]
    iterations: Int[np.ndarray, " problems"]
    code: Int[np.ndarray, " problems"]
    """Of ``status.WORDS``."""
    jump: Bool[np.ndarray, " problems"]
    """True where the posture is not on the branch of the posture before it in its motion."""

    @property
    def status(self) -> Shaped[np.ndarray, " problems"]:
        """How each fit ended, in a word."""
        return status.WORDS[self.code]

    @property
    def converged(self) -> Bool[np.ndarray, " problems"]:
        """Closed chain and stationary J, both to tolerance."""
        return self.code == status.CONVERGED


def put_lower(found: PostureSolution, problems: Int[np.ndarray, " again"], other: PostureSolution) -> None:
    """Put the other fits of these problems in their places where they converged and are lower."""
    lower = other.converged & ~(found.converged[problems] & (found.j_deg2[problems] <= other.j_deg2))
    put_problems(found, problems[lower], take_problems(other, lower))


class SubjectSolution(NamedTuple):
    """Where a kernel ended with whole subjects: adapted parameters and all postures."""

    theta: Float[np.ndarray, "adapted problems"]
    """mm."""
    angles: Float[np.ndarray, "6 postures problems"]
    """rad."""
    multipliers: Float[np.ndarray, "3 postures problems"]
    """Of A1-A3 in E per mm: w / postures times those of the posture fit."""
    residual_mm: Float[np.ndarray, "3 postures problems"]
    stationarity: Float[np.ndarray, "postures problems"]
    """max |dE/dq + G' lambda|, E a degree."""
    slope: Float[np.ndarray, "adapted problems"]
    """dE/dtheta by the envelope theorem: dD/dtheta + sum_p T' lambda. Zero for a parameter held by its bound."""
    iterations: Int[np.ndarray, " problems"]
    code: Int[np.ndarray, " problems"]
    """Of ``status.WORDS``."""

    @property
    def converged(self) -> Bool[np.ndarray, " problems"]:
        """Closed chains, stationary postures and parameters, all to tolerance."""
        return self.code == status.CONVERGED
