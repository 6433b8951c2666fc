"""Optimality conditions of an adaptation, from their definition, by automatic differentiation."""

from functools import partial

import jax
from programs import few_runs

from adapt.solvers.newton.subject import SubjectProblem
from models.person.thorax_ellipsoid import thorax_distance_mm2


@few_runs
@partial(jax.vmap, in_axes=-1, out_axes=-1)
def conditions(problem: SubjectProblem, theta, angles, multipliers):
    """Compute g, and the gradients of D + sum 1/2 (q - s)' W (q - s) + lambda'g in all angles q and in theta."""

    def lagrangian(q, theta, part):
        moved = problem.girdle.with_adapted(theta)
        D = thorax_distance_mm2(moved, problem.points_mm, problem.point_weights, problem.levels_mm)
        g = moved.over_postures().residuals_mm(q)
        of_postures = 0.5 * (problem.weights * (q - problem.angles) ** 2).sum(axis=0) + (multipliers * g).sum(axis=0)
        return D + (part * of_postures).sum(), g

    by_angle, g = jax.grad(lagrangian, has_aux=True)(angles, theta, 1.0)
    by_theta, _ = jax.grad(lagrangian, 1, has_aux=True)(angles, theta, problem.counted)
    return g, by_angle, by_theta
