"""The girdle adapted to a subject as a differentiable function: the optimum of E (``errors_of_subject``).

E has the slope d|r|^2/dtheta + sum c_p lambda_p' dg/dtheta (envelope theorem), and H is the derivative of that. The
optimum within the bounds has H_ff dtheta_f = -d(slope_f) - H_fb dtheta_b, where f are the free parameters and b those
at a bound, which move with it.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

from adapt.differentiable.closest_posture import PostureFit, fits_at, fits_from, search, starts_of
from adapt.differentiable.errors_of_subject import WEIGHT, OwnPrior, Problem, problem_of
from adapt.differentiable.small_systems import least_squares, lowest_step, solve, with_derivative
from models.girdle import Girdle
from motions.arrays import Array

_MOST_ROUNDS = 8
"""Of a subject, each Levenberg-Marquardt and a Newton step. Three are needed unless a posture changes its minimum."""

_NEAR, _SETTLED = 0.1, 1e-9
"""A Newton step as short as the first is taken, as short as the second it ends the rounds; mm, or SDs."""


class AdaptedSubject(NamedTuple):
    """The optimum of E within the bounds; every number is NaN where it did not converge."""

    theta_mm: Float[Array, " adapted"]
    """In the order of ``models.adapted_parameters.ADAPTED``, mm."""
    free: Bool[Array, " adapted"]
    """False at a bound. The derivative of such a parameter is that of its bound, and 0 in everything else."""
    E: Float[Array, ""]
    """D + w mean(J), mm^2, or E_own."""
    D_mm2: Float[Array, ""]
    mean_j_deg2: Float[Array, ""]
    postures: PostureFit
    converged: Bool[Array, ""]
    girdle: Girdle
    """Adapted."""
    sizes: Float[Array, " sizes"]
    """Of own bones, in SDs; none without."""


def objective(
    theta_mm: Float[Array, " adapted"],
    girdle: Girdle,
    points_mm: Float[Array, " 3 points"],
    angles: Float[Array, " 6 postures"],
    measured: Bool[Array, " 6 postures"] | None = None,
    weight: float | Float[Array, ""] = WEIGHT,
    start: Float[Array, " 6 postures"] | None = None,
) -> Float[Array, ""]:
    """Compute E(theta) = D + w mean(J_p), mm^2 (Eq. 6.3-6.5), as a function that any optimiser can minimise.

    D is the mean squared distance of the thorax points. Angles, ``measured``, ``start``, derivatives, compilation and
    errors are those of :func:`fit_posture`.
    """
    problem = problem_of(girdle, points_mm, angles, measured, weight)
    return _objective(jnp.asarray(theta_mm), problem, starts_of(problem.s, start))


def adapt_subject(
    girdle: Girdle,
    points_mm: Float[Array, " 3 points"],
    bounds_mm: Float[Array, " 2 adapted"],
    angles: Float[Array, " 6 postures"],
    measured: Bool[Array, " 6 postures"] | None = None,
    weight: float | Float[Array, ""] = WEIGHT,
    own_bones: OwnPrior | None = None,
    start: Float[Array, " thetas"] | None = None,
) -> AdaptedSubject:
    """Minimise E(theta) (:func:`objective`) within lower and upper bounds, mm: what :func:`adapt.adapt_subjects` finds.

    Differentiable in every number given but the girdle's own adapted parameters, which are only a start. ``jax.vmap``
    takes subjects with unequal numbers of postures: pad them with postures whose ``measured`` is False. Starts are the
    geometric fit, min D, and places around it (thesis 6.2.6; ``models.adapted_parameters.STARTS_MM``).

    ``own_bones``: minimise E_own = w / m (S + sigma^2 |z|^2) over the sizes of the person's own, without bounds, as
    ``adapt_subjects(..., own_bones=True)`` does with the same noise and scales (``docs/method.md``). It is
    differentiable in every number given, ``own_bones`` too; bounds and points move nothing, and w no optimum. Of angles
    that were not measured the compiled fits keep a millionth of their weight, and this none. E_own has local minima,
    and each search may end in another one.

    ``start``: theta (mm), or sizes (SDs), to start from alone. That of a compiled adaptation ends in its minimum, and
    spares the search.

    The first call compiles for about a minute, a derivative for half of one more; a subject then takes some seconds.
    InputError as in :func:`fit_posture`.
    """
    problem = problem_of(girdle, points_mm, angles, measured, weight, own_bones)
    bounds = jnp.asarray(bounds_mm) if own_bones is None else None
    return _subject(problem, bounds, None if start is None else jnp.asarray(start)[None])


def _value(theta: Array, problem: Problem, x: Array) -> tuple[Array, PostureFit]:
    """E, and the postures x."""
    fits = fits_at(*problem.at(theta), x)
    return jnp.sum(problem.others(theta) ** 2) + jnp.sum(problem.shares * fits.j_deg2), fits


@jax.jit
def _objective(theta: Array, problem: Problem, starts: Array) -> Array:
    return _value(theta, problem, search(*problem.at(theta), starts))[0]


def _residuals(theta: Array, problem: Problem, start: Array) -> Array:
    """Numbers whose sum of squares is E."""
    gaps = jnp.sqrt(0.5 * problem.W) * (fits_from(*problem.at(theta), start).angles - problem.s)
    return jnp.concatenate([problem.others(theta), (jnp.sqrt(problem.shares) * gaps).ravel()])


def _slope(theta: Array, problem: Problem, x: Array) -> Array:
    """dE/dtheta, with the postures that follow from x."""
    fits = fits_at(*problem.at(theta), x)

    def lagrangian(theta):
        g = jax.vmap(problem.girdle_at(theta).residuals_mm, -1, -1)(fits.angles)
        return jnp.sum(problem.others(theta) ** 2) + jnp.sum(problem.shares * fits.multipliers * g)

    return jax.grad(lagrangian)(theta)


def _descended(problem: Problem, bounds: Array | None, theta: Array) -> tuple[Array, Array, Array]:
    """theta, x and E of the optimum reached from theta; E is infinite where there is none."""

    def unfinished(state):
        return (state[2] > _SETTLED) & (state[3] < _MOST_ROUNDS)

    def advance(state):
        theta, x, _, number = state
        x = search(*problem.at(theta), jnp.concatenate([x[None, :6], starts_of(problem.s)]))
        slope, H = with_derivative(lambda theta: _slope(theta, problem, x), theta)
        step = lowest_step(H, slope, None if bounds is None else bounds - theta)
        longest = jnp.max(abs(step))
        theta = jnp.where(longest < _NEAR, theta + step, theta)
        hopeless = jnp.any(jnp.isnan(x))  # it would keep the subjects beside it waiting
        residuals = partial(_residuals, problem=problem, start=x[None, :6])
        further = least_squares(lambda theta: jnp.where(hopeless, 0.0, residuals(theta)), theta, bounds)
        return jnp.where(longest <= _SETTLED, theta, further), x, longest, number + 1

    first = theta, jnp.concatenate([problem.s, jnp.zeros_like(problem.s[:3])]), jnp.inf, 0
    theta, x, longest, _ = jax.lax.while_loop(unfinished, advance, first)
    return theta, x, jnp.where(longest <= _SETTLED, _value(theta, problem, x)[0], jnp.inf)


def _lowest(problem: Problem, bounds: Array | None, starts: Array | None) -> tuple[Array, Array]:
    """theta and x of the lowest optimum from all starts, without a derivative."""
    problem, bounds, starts = jax.lax.stop_gradient((problem, bounds, starts))
    starts = problem.starts(bounds) if starts is None else starts
    theta, x, E = jax.lax.map(partial(_descended, problem, bounds), starts)
    return jax.tree.map(lambda of: jnp.where(jnp.isfinite(jnp.min(E)), of[jnp.argmin(E)], jnp.nan), (theta, x))


def _free(theta: Array, bounds: Array | None) -> Array:
    return jnp.ones_like(theta, bool) if bounds is None else ~((theta <= bounds[0]) | (theta >= bounds[1]))


@jax.custom_jvp
def _following(problem: Problem, bounds: Array | None, theta: Array, x: Array) -> Array:
    """Return the optimum theta, with postures x, as it is; it follows where the problem and its bounds move."""
    return theta


@_following.defjvp
def _following_jvp(primals, tangents):
    (problem, bounds, theta, x), (moved, moved_bounds, *_) = primals, tangents
    H = jax.jacfwd(lambda theta: _slope(theta, problem, x))(theta)
    _, slope_moved = jax.jvp(lambda problem: _slope(theta, problem, x), (problem,), (moved,))
    free = _free(theta, bounds)
    with_bound = 0.0 if bounds is None else jnp.where(theta <= bounds[0], *moved_bounds)
    step = solve(jnp.where(free[:, None], H, jnp.eye(len(theta))), jnp.where(free, -slope_moved, with_bound))
    return theta, step


@jax.jit
def _subject(problem: Problem, bounds: Array | None, starts: Array | None) -> AdaptedSubject:
    theta, x = _lowest(problem, bounds, starts)
    theta = _following(problem, bounds, theta, x)
    E, fits = _value(theta, problem, x)
    girdle, adapted = problem.girdle_at(theta), problem.own is None
    of_six = theta if adapted else girdle.adapted_mm
    free = _free(theta, bounds) if adapted else jnp.ones_like(of_six, bool)
    D = jnp.mean(problem.distances(theta) ** 2)
    converged = jnp.all(jnp.isfinite(theta))
    return AdaptedSubject(
        of_six, free, E, D, problem.mean(fits.j_deg2), fits, converged, girdle, theta[:0] if adapted else theta
    )
