"""Exact second derivatives of E at an adapted girdle, and derivatives of the optimum by each measured angle.

With the postures eliminated E is a function of theta and of the measured angles s alone. At its optimum

    H = d2E/dtheta2 = H_D + H_J     of the thorax points, D, and of the motion, w mean(J)
    B = d2E/dtheta ds = -(dq/dtheta)' W,      dtheta/ds = -H^-1 B

(implicit function theorem; dE/ds = -W (q - s) gives the second form of B). Without the curvature of distances and
constraints, whose part in H grows with the residuals, the information remains:

    I_D = 2 sum_i c_i d'_i d'_i',   I_J = B W^-1 B'    of the thorax points and of the motion,

both positive semidefinite. d'_i: derivative in theta of the distance of point i; c_i: its weight in D; W: weights of
the angles in E.
"""

from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Float

from adapt.engine.batching import take_problems
from adapt.solvers.adaptation import Adapted
from adapt.solvers.newton.elimination import Elimination
from adapt.solvers.newton.linear_algebra import backward, factorised, forward, product
from adapt.solvers.newton.subject import SubjectProblem, point_distance, point_multiplier, thorax_terms
from adapt.solvers.problems import Problems, subject_problem
from adapt.solvers.projection.subjects import motion_curvature
from adapt.solvers.unmeasured import have_weight
from models.derivatives import chain, closest_point_multipliers

_TOGETHER = 128
"""Number of problems at a time, whose arrays stay in the cache."""


@dataclass(frozen=True)
class Curvature:
    """Second derivatives of E (mm^2) at adapted girdles, theta in mm, angles in rad."""

    of_points: Float[np.ndarray, "adapted adapted problems"]
    """Hessian H_D of D."""
    of_motion: Float[np.ndarray, "adapted adapted problems"]
    """Hessian H_J of w mean(J)."""
    by_angle: Float[np.ndarray, "adapted 6 postures problems"]
    """Mixed derivatives B, by parameter and by measured angle. 0 for padding and for angles not measured."""
    points_information: Float[np.ndarray, "adapted adapted problems"]
    """Information I_D of the thorax points."""
    motion_information: Float[np.ndarray, "adapted adapted problems"]
    """Information I_J of the motion."""


def curvature(data: Problems, adapted: Adapted) -> Curvature:
    """Compute the second derivatives of E = sum u d^2 + W mean(J) (mm^2, deg^2) at the adaptation of each problem."""
    data = replace(data, point_weights=adapted.point_weights)
    problem = subject_problem(data, adapted.weight, float(adapted.landmark_weight.max(initial=0.0)))
    count = adapted.theta_mm.shape[-1]
    given = problem, adapted.theta_mm, adapted.angles, data.active_effects
    places = np.split(np.arange(count), range(_TOGETHER, count, _TOGETHER))
    with np.errstate(all="ignore"):  # a failed problem gives NaN
        parts = [_curvature(*take_problems(given, some)) for some in places]
    return Curvature(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))


def _curvature(problem: SubjectProblem, theta, angles, active_effects) -> tuple[np.ndarray, ...]:
    of_motion = motion_curvature if active_effects.effects else _of_plain_chains
    H, moved = of_motion(problem, theta, angles, active_effects)
    counts = have_weight(problem.weights) & problem.counted
    B = -np.moveaxis(np.where(counts[:, :, None], problem.weights[:, :, None] * moved, 0.0), 2, 0)
    inverse_weights = np.where(counts, 1.0 / np.where(counts, problem.weights, 1.0), 0.0)
    information = np.einsum("iapl,apl,japl->ijl", B, inverse_weights, B)
    H_D, I_D = _of_points(problem, theta)
    return H_D, H, B, I_D, information


def _of_plain_chains(problem: SubjectProblem, theta, angles, _) -> tuple[np.ndarray, np.ndarray]:
    """Compute H_J, and dq/dtheta of every posture in rad per mm."""
    q, by_parameter = list(angles), list(theta)
    gradient = [w * (x - s) for w, x, s in zip(problem.weights, q, problem.angles, strict=True)]
    feet, zero = closest_point_multipliers(problem.girdle, q, by_parameter), np.zeros_like(q[0])
    G = chain(problem.girdle, q, by_parameter, [zero] * 3, feet).G
    at = chain(problem.girdle, q, by_parameter, _multipliers(G, gradient, zero), feet)
    posture, n = Elimination(at, list(problem.weights), gradient, parameters=True), range(len(theta))

    def total(x) -> np.ndarray:
        return np.where(problem.counted, x, 0.0).sum(axis=0)

    H = np.array([[total(posture.curvature(max(i, j), min(i, j))) for j in n] for i in n])
    return H, np.stack([np.stack(posture.step_slope(k)) for k in n], axis=2)


def _multipliers(G, gradient, zero) -> list[np.ndarray]:
    """Compute lambda from G' lambda = -W (q - s), which holds at an optimum."""
    lower, inverse, _ = factorised([[product(G[i], G[j]) for j in range(i + 1)] for i in range(3)], zero)
    right = [-product(row, gradient) for row in G]
    return backward(lower, [x * d for x, d in zip(forward(lower, right), inverse, strict=True)])


def _of_points(problem: SubjectProblem, theta) -> tuple[np.ndarray, np.ndarray]:
    """Compute H_D and I_D."""
    girdle, points, weights, levels, *_ = problem
    feet = point_multiplier(girdle, list(theta), points)
    sums, _ = thorax_terms(girdle, list(theta), points, weights, levels, feet)
    lower, n = jax.tree.map(lambda x: np.sum(x, axis=0), sums.matrix), range(len(theta))
    off, slopes, _ = point_distance(girdle, list(theta), points, levels, feet)
    slope = np.stack([*slopes, np.zeros_like(off)])
    H = np.array([[lower[max(i, j)][min(i, j)] for j in n] for i in n])
    return H, 2.0 * np.einsum("inl,nl,jnl->ijl", slope, weights, slope)
