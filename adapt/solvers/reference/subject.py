"""The whole-subject problem: adapted parameters and all postures of a subject at once (thesis Eq. 6.5).

    minimise  P(theta) + sum_p 1/2 (q_p - s_p)' W_p (q_p - s_p),   g(q_p, theta) = 0 for every posture p,
    lower <= theta <= upper

with P the thorax term D and W_p the weight (w / postures) of J_p. Its optimality conditions have an arrow shape: one
9 x 9 block a posture, bordered by theta. Each iteration eliminates the postures
(``adapt.solvers.reference.elimination``), takes a Newton step in theta alone, projected on the bounds (Bertsekas, SIAM
J. Control Optim. 20, 1982), and moves all postures with it: one sweep over the postures instead of an optimisation
inside an optimisation. The optimum is the nested one.

Arrays are component first, then the postures of a subject, then any batch of subjects.
"""

from typing import NamedTuple, Protocol

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.reference.constraints import Constraints
from adapt.solvers.reference.elimination import Eliminated, Linearised, back_to_surface, eliminate, limited
from adapt.solvers.reference.linalg import Factor, diagonal, largest, matvec
from adapt.solvers.reference.line_search import LENGTHS, TINY_RAD, grown_penalty, longest, pick
from adapt.solvers.reference.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from motions.arrays import Array, for_each, repeat_while, xp
from motions.rotations import DEG

THETA_TOLERANCE = 1e-8
"""|dE/dtheta| of a converged free parameter: mm^2 (of E) a mm. A parameter 1 mm away would change E by 1e-8."""

MAX_ITERATIONS = 60
"""Measured: 6-15 iterations from the geometric fit."""

FIRST_RADIUS_MM = 30.0
"""Longest first step in theta; later ones are twice or a quarter of it, as the last step went."""

_DAMPINGS = (0.0, *(10.0**k for k in range(-5, 4)))
"""Levenberg shifts of the matrix in theta, E per mm^2. Its eigenvalues are 1e-4 (M_y and A_y together, nearly free) to
1e2: the smallest shift that is positive definite and keeps within the radius brakes the free direction alone."""

_PIVOT_FLOOR = 1e-9
"""Smallest pivot of the matrix in theta, relative to its largest diagonal entry."""


class Problem(NamedTuple):
    """What the data and the model fix, for one subject or a trailing batch of them."""

    measured: Float[Array, " 6 postures *batch"]
    """s, rad, finite everywhere."""
    weights: Float[Array, " 6 postures *batch"]
    """W, with w / postures in it: E per rad^2. Zero for angles not measured."""
    counted: Bool[Array, " postures *batch"]
    """False for padding: a copy of some posture, solved along, that has no part in E."""
    lower: Float[Array, " m *batch"]
    upper: Float[Array, " m *batch"]

    def total(self, of_postures: Float[Array, " ..."]) -> Float[Array, " ..."]:
        """Sum the values of the postures that count; axes before the postures stay."""
        axis = of_postures.ndim - self.counted.ndim
        return xp.sum(xp.where(self.counted, of_postures, 0.0), axis=axis)

    def worst(self, of_postures: Float[Array, " postures *batch"]) -> Float[Array, " *batch"]:
        """Find the maximum over the postures that count."""
        return xp.max(xp.where(self.counted, of_postures, 0.0), axis=0)


class Thorax(Protocol):
    """P(theta) with its derivatives, elementwise over the batch."""

    def value(self, theta: Float[Array, " m *batch"]) -> Float[Array, " *batch"]: ...
    def slope(self, theta: Float[Array, " m *batch"]) -> Float[Array, " m *batch"]: ...
    def curvature(self, theta: Float[Array, " m *batch"]) -> Float[Array, " m m *batch"]: ...


class Subject(NamedTuple):
    """Iterate, and at the end result, of whole-subject fits."""

    theta: Float[Array, " m *batch"]
    angles: Float[Array, " 6 postures *batch"]
    multipliers: Float[Array, " 3 postures *batch"]
    """Of A1-A3 in E per mm: w / postures times those of the posture fit."""
    penalty: Float[Array, " postures *batch"]
    residual_mm: Float[Array, " 3 postures *batch"]
    stationarity: Float[Array, " postures *batch"]
    """max |dE/dq + G' lambda|, E a degree."""
    slope: Float[Array, " m *batch"]
    """dE/dtheta by the envelope theorem: dP/dtheta + sum_p T' lambda. Zero for a parameter held by its bound."""
    radius_mm: Float[Array, " *batch"]
    """Trust radius of the next step in theta."""
    iterations: Int[Array, " *batch"]
    converged: Bool[Array, " *batch"]


def solve_subjects(
    constraints: Constraints,
    thorax: Thorax,
    problem: Problem,
    theta: Float[Array, " m *batch"],
    angles: Float[Array, " 6 postures *batch"],
) -> Subject:
    """Find the local optimum of each subject reached from ``theta`` (within the bounds) and ``angles``.

    Subjects that did not converge are returned as they stand: look at ``converged``.
    """

    def here(theta, angles, multipliers) -> tuple[Subject, Linearised]:
        at = constraints.linearised(joint(angles, theta), multipliers)
        multiplier_gradient = xp.sum(multipliers[:, None] * xp.concatenate([at.G, at.T], axis=1), axis=0)
        return conditions(thorax, problem, theta, angles, multipliers, at.residual, multiplier_gradient), at

    def advance(carry):
        state, at = carry
        theta, angles, multipliers, moved = _iterate(constraints, thorax, problem, state, at)
        new, then = here(theta, angles, multipliers)
        return jax.tree.map(lambda old, new: xp.where(state.converged, old, new), carry, (new._replace(**moved), then))

    def unfinished(carry):
        state, _ = carry
        has_numbers = xp.all(xp.isfinite(state.slope), axis=0)  # what is no number stays so
        return xp.any(~state.converged & (state.iterations < MAX_ITERATIONS) & has_numbers)

    return repeat_while(unfinished, advance, here(theta, angles, xp.zeros_like(angles[:3])))[0]


def joint(angles, theta):
    """Join angles and parameters to z = (q, theta), theta repeated over the postures."""
    postures = xp.broadcast_to(theta[:, None], (theta.shape[0], *angles.shape[1:]))
    return xp.concatenate([angles, postures])


def _held(problem: Problem, theta, slope) -> Bool[Array, " m *batch"]:
    """Parameters at a bound that E pushes outward: the active set."""
    at_lower = (theta <= problem.lower) & (slope > 0.0)
    at_upper = (theta >= problem.upper) & (slope < 0.0)
    return at_lower | at_upper


def conditions(thorax: Thorax, problem: Problem, theta, angles, multipliers, g, multiplier_gradient) -> Subject:
    """Compute the conditions of an optimum at this point from g and d(multipliers . g)/dz there; not iterated yet."""
    stationarity = largest(problem.weights * (angles - problem.measured) + multiplier_gradient[:6]) / DEG
    slope = thorax.slope(theta) + problem.total(multiplier_gradient[6:])
    slope = xp.where(_held(problem, theta, slope), 0.0, slope)
    converged = (
        (problem.worst(largest(g)) <= CONSTRAINT_TOLERANCE_MM)
        & (problem.worst(stationarity) <= STATIONARITY_TOLERANCE)
        & (largest(slope) <= THETA_TOLERANCE)
    )
    start = {"penalty": xp.zeros_like(angles[0]), "radius_mm": xp.full_like(theta[0], FIRST_RADIUS_MM)}
    iterations = xp.zeros_like(theta[0], int)
    return Subject(
        theta,
        angles,
        multipliers,
        start["penalty"],
        g,
        stationarity,
        slope,
        start["radius_mm"],
        iterations,
        converged,
    )


def theta_system(
    thorax: Thorax, problem: Problem, theta: Float[Array, " m *batch"], eliminated: Eliminated
) -> tuple[Float[Array, " m m *batch"], Float[Array, " m *batch"]]:
    """Compute the Hessian of E in theta with the postures eliminated, and the slope after their own steps."""
    matrix = thorax.curvature(theta) + problem.total(eliminated.hessian)
    return matrix, thorax.slope(theta) + problem.total(eliminated.slope)


def _theta_step(problem: Problem, state: Subject, matrix, slope) -> Float[Array, " m *batch"]:
    """Newton step of the parameters off their bounds, braked to the trust radius and cut at the bounds."""
    free = ~_held(problem, state.theta, slope)
    size = xp.max(abs(matrix), axis=(0, 1))
    reduced = xp.where(free[:, None] & free[None], matrix, 0.0) + diagonal(xp.where(free, 0.0, size[None]))
    target = xp.where(free, slope, 0.0)

    def braked(damping):
        factor = Factor(reduced + diagonal(xp.full_like(slope, damping)), _PIVOT_FLOOR * size)
        step = -factor.solve_vector(target)
        return step, factor.positive & (largest(step) <= state.radius_mm)

    steps, good = for_each(braked, np.array(_DAMPINGS), like=target)
    first_good = xp.where(xp.any(good, axis=0), xp.argmax(good, axis=0), len(_DAMPINGS) - 1)
    return xp.clip(state.theta + pick(steps, first_good), problem.lower, problem.upper) - state.theta


def _iterate(constraints, thorax, problem: Problem, state: Subject, at: Linearised):
    eliminated = eliminate(at, problem.weights * (state.angles - problem.measured), problem.weights)
    matrix, slope = theta_system(thorax, problem, state.theta, eliminated)
    theta_step = _theta_step(problem, state, matrix, slope)
    over_postures = xp.broadcast_to(theta_step[:, None], (len(theta_step), *state.angles.shape[1:]))
    step = limited(eliminated.step + matvec(eliminated.step_theta, over_postures))
    multipliers = eliminated.multipliers + matvec(eliminated.multipliers_theta, over_postures)
    penalty = grown_penalty(state.penalty, multipliers)
    theta, angles, length = _search(constraints, thorax, problem, state, at.G, theta_step, step, penalty)
    radius = state.radius_mm * xp.where(length == 1.0, 2.0, xp.where(length < 0.5, 0.25, 1.0))
    return theta, angles, multipliers, {"penalty": penalty, "radius_mm": radius, "iterations": state.iterations + 1}


def _search(constraints, thorax, problem: Problem, state: Subject, G, theta_step, step, penalty):
    def merit(angles, theta):
        gap = 0.5 * xp.sum(problem.weights * (angles - problem.measured) ** 2, axis=0)
        open_chain = penalty * xp.sum(abs(constraints.residual(joint(angles, theta))), axis=0)
        return thorax.value(theta) + problem.total(gap + open_chain)

    def corrected(length):
        angles, theta = state.angles + length * step, state.theta + length * theta_step
        return angles + limited(back_to_surface(G, constraints.residual(joint(angles, theta)))), theta

    def attempt(lengths):
        candidates = for_each(corrected, lengths, like=step)
        return candidates, for_each(merit, *candidates, like=step)

    predicted = xp.sum(thorax.slope(state.theta) * theta_step, axis=0)
    gap_slope = xp.sum(problem.weights * (state.angles - problem.measured) * step, axis=0)
    predicted = predicted + problem.total(gap_slope - penalty * xp.sum(abs(state.residual_mm), axis=0))
    tiny = (problem.worst(largest(step)) < TINY_RAD) & (largest(theta_step) < 100.0 * TINY_RAD)
    (angles, theta), index = longest(attempt, merit(state.angles, state.theta), predicted, tiny)
    postures_index = xp.broadcast_to(index[None], step.shape[1:])
    return pick(theta, index), pick(angles, postures_index), xp.take(np.array(LENGTHS), index)
