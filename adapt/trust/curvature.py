"""How E curves about an adapted girdle, and how the optimum follows each measured angle. Exact second derivatives.

With the postures eliminated E is a function of theta and of the measured angles s alone. At its optimum

    H = d2E/dtheta2 = H_D + H_J     of the thorax points, D, and of the motion, w mean(J)
    B = d2E/dtheta ds,              dtheta/ds = -H^-1 B

(implicit function theorem; ``adapt.solvers.reference.elimination.eliminate`` gives both, as the 9 x 9 block of each
posture is solved there). Without the curvature of distances and constraints, which a larger residual makes matter, what
is left is information,

    I_D = 2 sum_i share_i d'_i d'_i',   I_J = B W^-1 B'    of the thorax points and of the motion,

never negative in any direction. d'_i: derivative in theta of the distance of point i; W: weights of the angles in E.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from adapt.engine.batching import in_chunks
from adapt.solvers.adaptation import Adapted, ProblemBatch, problem_of
from adapt.solvers.linalg import Factor, matmul, matvec, transpose
from adapt.solvers.objective import ThoraxPoints
from adapt.solvers.reference.constraints import ByHand
from adapt.solvers.reference.elimination import eliminate
from adapt.solvers.reference.subject import Problem, joint
from models.girdle import Girdle

_LANES = 64
"""Subjects in a chunk: second derivatives of 14 postures of each are 130 kB."""


@dataclass(frozen=True)
class Curvature:
    """Second derivatives of E (mm^2) at L adapted girdles, theta in mm, angles in rad."""

    of_points: Float[np.ndarray, "6 6 lanes"]
    """H_D."""
    of_motion: Float[np.ndarray, "6 6 lanes"]
    """H_J."""
    by_angle: Float[np.ndarray, "6 6 postures lanes"]
    """B: by parameter, then by measured angle. 0 for padding and for angles not measured."""
    points_information: Float[np.ndarray, "6 6 lanes"]
    """I_D."""
    motion_information: Float[np.ndarray, "6 6 lanes"]
    """I_J."""


def curvature(data: ProblemBatch, adapted: Adapted, weight: float) -> Curvature:
    """The curvature of E = D + w mean(J) (mm^2, deg^2) at the adaptations of ``data``, lane by lane."""
    problem = problem_of(data, np.full(data.counted.shape[1:], weight))
    lanes = data.girdle, data.points_mm, data.shares, problem, adapted.theta_mm, adapted.angles
    return Curvature(*in_chunks(_curvature, _LANES, *lanes))


@jax.jit
def _curvature(girdle: Girdle, points_mm, shares, problem: Problem, theta, angles) -> tuple[Array, ...]:
    constraints = ByHand(girdle.over_postures())
    z = joint(angles, theta)
    pull = problem.weights * (angles - problem.measured)
    at = constraints.linearised(z, _multipliers(constraints.slopes(z)[:, :6], pull))
    of_motion = problem.total(eliminate(at, pull, problem.weights).hessian)

    still = at._replace(residual=jnp.zeros_like(at.residual))

    def by_angle(direction):
        """d(dE/dtheta)/ds_k: the elimination is linear in the slope W (q - s), of which -W e_k is the derivative."""
        slope = -problem.weights * direction.reshape(6, *[1] * (angles.ndim - 1))
        return jnp.where(problem.counted, eliminate(still, slope, problem.weights).slope, 0.0)

    thorax = ThoraxPoints(girdle, points_mm, shares)
    B = jax.vmap(by_angle, out_axes=1)(jnp.eye(6))
    softness = jnp.where(problem.weights > 0.0, 1.0 / problem.weights, 0.0)

    slope = jnp.stack(thorax.distances(theta)[1], axis=1)
    points_information = 2.0 * jnp.einsum("nil,nl,njl->ijl", slope, shares, slope)
    return thorax.curvature(theta), of_motion, B, points_information, jnp.einsum("iapl,apl,japl->ijl", B, softness, B)


def _multipliers(G, pull):
    """lambda of G' lambda = -W (q - s), which holds at an optimum."""
    GGt = matmul(G, transpose(G))
    return -Factor(GGt, jnp.zeros_like(GGt[0, 0])).solve_vector(matvec(G, pull))
