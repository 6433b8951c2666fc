"""How E curves about an adapted girdle, and how the optimum follows each measured angle. Exact second derivatives.

With the postures eliminated E is a function of theta and of the measured angles s alone. At its optimum

    H = d2E/dtheta2 = H_D + H_J     of the thorax points, D, and of the motion, w mean(J)
    B = d2E/dtheta ds = -(dq/dtheta)' W,      dtheta/ds = -H^-1 B

(implicit function theorem; dE/ds = -W (q - s) gives the second form of B). H_J and dq/dtheta come from
``adapt.solvers.reference.elimination.eliminate``. Without the curvature of distances and constraints, which a larger
residual makes matter, what is left is information,

    I_D = 2 sum_i c_i d'_i d'_i',   I_J = B W^-1 B'    of the thorax points and of the motion,

never negative in any direction. d'_i: derivative in theta of the distance of point i; c_i: its weight in D; W: weights
of the angles in E.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from adapt.engine.batching import compiled, in_chunks, take_problems
from adapt.solvers.adaptation import Adapted, subject_conditions
from adapt.solvers.batched.subject import Fixed
from adapt.solvers.extended.second_derivatives import motion_curvature
from adapt.solvers.objective import ThoraxPoints
from adapt.solvers.problem_batch import ProblemBatch, fixed_problem
from adapt.solvers.reference.elimination import eliminate
from adapt.solvers.reference.linalg import Factor, matmul, matvec, transpose
from adapt.solvers.reference.subject import Problem, joint
from models.effects import ActiveEffects
from models.girdle import Girdle
from motions.arrays import Array, xp

_CHUNK = 64
"""Subjects in a chunk of the compiled program, for effects: second derivatives of 14 postures of each are 130 kB."""

_AT_ONCE = 128
"""Subjects that numpy does at once, 0.15 ms each; compiled 0.08 ms, but the program takes a second to load."""


@dataclass(frozen=True)
class Curvature:
    """Second derivatives of E (mm^2) at adapted girdles, theta in mm, angles in rad."""

    of_points: Float[np.ndarray, "adapted adapted problems"]
    """H_D."""
    of_motion: Float[np.ndarray, "adapted adapted problems"]
    """H_J."""
    by_angle: Float[np.ndarray, "adapted 6 postures problems"]
    """B: by parameter, then by measured angle. 0 for padding and for angles not measured."""
    points_information: Float[np.ndarray, "adapted adapted problems"]
    """I_D."""
    motion_information: Float[np.ndarray, "adapted adapted problems"]
    """I_J."""


def curvature(data: ProblemBatch, adapted: Adapted) -> Curvature:
    """Differentiate E = sum u d^2 + W mean(J) (mm^2, deg^2) twice at the adaptations of ``data``, each problem's."""
    data = replace(data, point_weights=adapted.point_weights)
    fixed = fixed_problem(data, adapted.weight, float(adapted.landmark_weight.max(initial=0.0)))
    if data.active_effects.effects and np.asarray(data.measured | ~data.counted).all():
        return _with_effects(data, fixed, adapted)
    given = *fixed, adapted.theta_mm, adapted.angles
    at_once = 0 if data.active_effects.effects else _AT_ONCE  # effects have no derivatives by hand, which numpy needs
    count = adapted.theta_mm.shape[-1]
    parts = [
        in_chunks(_curvature, _CHUNK, *take_problems((*given, data.active_effects), part), at_once=at_once)
        for part in np.split(np.arange(count), range(_AT_ONCE, count, _AT_ONCE))
    ]
    return Curvature(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))


def _with_effects(data: ProblemBatch, fixed: Fixed, adapted: Adapted) -> Curvature:
    """The same with effects at work, the motion's part by differences of its exact slope."""
    of_motion, moved = motion_curvature(fixed, data.active_effects, adapted.theta_mm)
    thorax = ThoraxPoints(*fixed[:4])
    B = -np.einsum("apkl,apl->kapl", moved, np.where(data.counted, fixed.problem.weights, 0.0))
    information = _information(thorax, adapted.theta_mm, B, fixed.problem.weights)
    return Curvature(thorax.curvature(adapted.theta_mm), of_motion, B, *information)


@compiled
def _curvature(
    girdle: Girdle, points_mm, point_weights, levels_mm, problem: Problem, theta, angles, active_effects: ActiveEffects
) -> tuple[Array, ...]:
    constraints, thorax = subject_conditions(girdle, points_mm, point_weights, levels_mm, active_effects)
    z = joint(angles, theta)
    objective_gradient = problem.weights * (angles - problem.measured)
    at = constraints.linearised(z, _multipliers(constraints.slopes(z)[:, :6], objective_gradient))
    eliminated = eliminate(at, objective_gradient, problem.weights)
    B = -xp.swapaxes(problem.weights[:, None] * eliminated.step_theta, 0, 1)
    B = xp.where(problem.counted, B, 0.0)
    information = _information(thorax, theta, B, problem.weights)
    return thorax.curvature(theta), problem.total(eliminated.hessian), B, *information


def _information(thorax: ThoraxPoints, theta, B, weights) -> tuple[Array, Array]:
    """I_D and I_J."""
    counts = weights > 0.0
    inverse_weights = xp.where(counts, 1.0 / xp.where(counts, weights, 1.0), 0.0)
    slope = xp.stack(thorax.distances(theta)[1], axis=1)
    return (
        2.0 * xp.einsum("nil,nl,njl->ijl", slope, thorax.point_weights, slope),
        xp.einsum("iapl,apl,japl->ijl", B, inverse_weights, B),
    )


def _multipliers(G, objective_gradient):
    """lambda of G' lambda = -W (q - s), which holds at an optimum."""
    GGt = matmul(G, transpose(G))
    return -Factor(GGt, xp.zeros_like(GGt[0, 0])).solve_vector(matvec(G, objective_gradient))
