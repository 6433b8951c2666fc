"""The two fits as differentiable functions of JAX: the closest closed posture, and the girdle adapted to a subject.

Slow, short, and independent of the compiled solvers: it shares the geometry of ``models`` with them and nothing else.

Posture (thesis Eq. 6.1-6.2): J = 1/2 sum W_i (q_i - s_i)^2 with g(q) = 0. Its optimum x = (q, lambda) is the root of

    F(x) = (W (q - s) + G' lambda, g),      K = dF/dx, 9 x 9,      dx = -K^-1 dF        (implicit function theorem).

Subject (Eq. 6.3-6.5): E(theta) = D + w mean(J) has the slope dD/dtheta + w mean(lambda' dg/dtheta) (envelope theorem),
and H is the derivative of that. The optimum within the bounds has H_ff dtheta_f = -d(slope_f) - H_fb dtheta_b, where f
are the free parameters and b those at a bound, which move with it. No derivative goes through an iteration.

Inner functions are jitted although they only run inside others: JAX then keeps what ``vmap`` makes of them, which loops
within loops ask for again and again. For the same reason the starts of a subject come one after the other.
"""

import logging
from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jax.core import Tracer
from jaxtyping import Bool, Float

from models.adapted_parameters import STARTS_MM
from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle
from motions.arrays import Array
from motions.errors import InputError
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

_LOG = logging.getLogger(__name__)

WEIGHT = 10.0
"""w of Eq. 6.5 (thesis 6.2.6)."""

_OFFSETS_DEG = np.concatenate([np.zeros((1, 6)), np.random.default_rng(1).uniform(-30.0, 30.0, (9, 6))])
"""Starts of a posture fit about the measured angles: J has several local minima. These lead to the J of the compiled
fits in every one of 415 shipped and measured postures with six sets."""

_LENGTHS = np.array([1.0, 0.3, 0.05])
"""Of a step, tried side by side."""

_LONGEST_RAD, _LAST_RAD = 0.5, 1e-7
"""No step is longer; one as short as the second is taken whole: the merit function does not resolve it."""

_MOST_STEPS = 30
"""Five to twelve are needed; a start that takes more leads nowhere."""

_TOLERANCE = np.repeat([1e-8, 1e-9], [6, 3])
"""|F| of a solved posture, deg^2 a rad and mm. One more step follows, quadratically, and leaves rounding."""

_MOST_ROUNDS = 8
"""Of a subject, each Levenberg-Marquardt and a Newton step. Three are needed unless a posture changes its minimum."""

_NEAR_MM, _SETTLED_MM = 0.1, 1e-9
"""A Newton step as short as the first is taken, as short as the second it ends the rounds."""


class PostureFit(NamedTuple):
    """The closest closed posture; NaN where the fit did not converge."""

    angles: Float[Array, " 6 *batch"]
    """q, rad."""
    multipliers: Float[Array, " 3 *batch"]
    """lambda of A1-A3, deg^2 a mm."""
    j_deg2: Float[Array, " *batch"]
    """J_p, deg^2; 0 for padding."""


class AdaptedSubject(NamedTuple):
    """The optimum of E within the bounds; every number is NaN where it did not converge."""

    theta_mm: Float[Array, " adapted"]
    """In the order of ``models.adapted_parameters.ADAPTED``, mm."""
    free: Bool[Array, " adapted"]
    """False at a bound. The derivative of such a parameter is that of its bound, and 0 in everything else."""
    E: Float[Array, ""]
    """D + w mean(J), mm^2."""
    D_mm2: Float[Array, ""]
    mean_j_deg2: Float[Array, ""]
    postures: PostureFit
    converged: Bool[Array, ""]


def fit_posture(
    girdle: Girdle,
    angles: Float[Array, " 6 *batch"],
    measured: Bool[Array, " 6 *batch"] | None = None,
    start: Float[Array, " 6 *batch"] | None = None,
) -> PostureFit:
    """Fit postures: q, lambda and J_p (Eq. 6.1-6.2), differentiable in the girdle and the measured angles.

    Forward and reverse, any number of times, with ``jit`` and ``vmap`` in any order. ``angles`` in rad; those whose
    ``measured`` is False do not count, whatever they are. A posture with none is padding: J and every derivative are 0.
    One with fewer than three is NaN. ``girdle`` has the same batch axes, or none. The lowest J of several starts is
    taken, or that reached from ``start`` (rad) alone.

    The first call compiles for 5 to 20 s, a derivative as long again. InputError if the first axis is not six long, or
    if an angle is above a full turn, which ``jit`` cannot see.
    """
    _say_compiling()
    s, W = _target(angles, measured)
    return _fits(jax.tree.map(jnp.asarray, girdle), s, W, _starts(s, start))


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
    _say_compiling()
    problem = _problem(girdle, points_mm, angles, measured, weight)
    return _objective(jnp.asarray(theta_mm), problem, _starts(problem.s, start))


def adapt_subject(
    girdle: Girdle,
    points_mm: Float[Array, " 3 points"],
    bounds_mm: Float[Array, " 2 adapted"],
    angles: Float[Array, " 6 postures"],
    measured: Bool[Array, " 6 postures"] | None = None,
    weight: float | Float[Array, ""] = WEIGHT,
) -> AdaptedSubject:
    """Minimise E(theta) (:func:`objective`) within lower and upper bounds, mm: what :func:`adapt.adapt_subjects` finds.

    Differentiable in every number given but the girdle's own adapted parameters, which are only a start. ``jax.vmap``
    takes subjects with unequal numbers of postures: pad them with postures whose ``measured`` is False. Starts are the
    geometric fit, min D, and places around it (thesis 6.2.6; ``models.adapted_parameters.STARTS_MM``).

    The first call compiles for about a minute, a derivative for half of one more; a subject then takes some seconds.
    InputError as in :func:`fit_posture`.
    """
    _say_compiling()
    return _subject(_problem(girdle, points_mm, angles, measured, weight), jnp.asarray(bounds_mm))


class _Problem(NamedTuple):
    girdle: Girdle
    points_mm: Array
    s: Array
    """Measured angles, at rest where not measured."""
    W: Array
    """Of J; 0 where not measured."""
    weight: Array

    def at(self, theta: Array) -> tuple[Girdle, Array, Array]:
        """Girdle, s and W."""
        return self.girdle.with_adapted(theta), self.s, self.W

    def mean(self, of_postures: Array) -> Array:
        """Over the postures that count; padding is 0."""
        return jnp.sum(of_postures) / jnp.sum(jnp.any(self.W > 0.0, axis=0))

    def distances(self, theta: Array) -> Array:
        girdle = self.girdle.with_adapted(theta)
        return signed_distance_mm(self.points_mm, girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None])


@cache
def _say_compiling() -> None:
    """Say once a process why nothing seems to happen."""
    _LOG.warning("the first call compiles: a posture fit for 5 to 20 s, an adaptation for a minute; later calls do not")


def _problem(girdle: Girdle, points_mm, angles, measured, weight) -> _Problem:
    return jax.tree.map(jnp.asarray, _Problem(girdle, points_mm, *_target(angles, measured), weight))


def _target(angles, measured) -> tuple[Array, Array]:
    """s and W."""
    if jnp.shape(angles)[:1] != (6,):
        remedy = "Give (6, postures) in rad: np.deg2rad(motions.angles_deg).T"
        raise InputError("angles", None, f"their shape is {jnp.shape(angles)}", remedy)
    measured = np.ones(jnp.shape(angles), bool) if measured is None else measured
    if not any(isinstance(x, Tracer) for x in (angles, measured)):
        largest = np.max(np.abs(np.where(measured, angles, 0.0)), initial=0.0)
        if largest > 2.0 * np.pi:
            raise InputError(
                "angles", None, f"one is {largest:g} rad", "Give radians: np.deg2rad(motions.angles_deg).T"
            )
    rest = (REST_DEG / DEG).reshape(6, *[1] * (jnp.ndim(angles) - 1))
    count = jnp.maximum(jnp.sum(jnp.asarray(measured), axis=0), 1)
    return jnp.where(measured, angles, rest), jnp.where(measured, 2.0 * DEG**2 / count, 0.0)


def _starts(s: Array, start=None) -> Array:
    return jnp.asarray(start)[None] if start is not None else s + _OFFSETS_DEG.reshape(-1, 6, *[1] * (s.ndim - 1)) / DEG


def _solve(A: Array, b: Array) -> Array:
    """Solve A x = b by elimination: batches of LAPACK's calls have hung inside a compiled loop."""

    def solved(A, b):
        def eliminated(k, M):
            pivot = jnp.arange(len(b)) == jnp.argmax(jnp.where(jnp.arange(len(b)) >= k, abs(M[:, k]), -1.0))
            row = jnp.where(pivot, 1.0, 0.0) @ M
            row, M = row / row[k], jnp.where(pivot[:, None], M[k], M)
            return (M - M[:, k, None] * row).at[k].set(row)

        return jax.lax.fori_loop(0, len(b), eliminated, jnp.column_stack([A, b]))[:, -1]

    return jax.lax.custom_linear_solve(lambda x: A @ x, b, lambda _, b: solved(A, b), lambda _, b: solved(A.T, b))


@jax.jit
def _conditions(girdle: Girdle, s: Array, W: Array, x: Array) -> Array:
    """F(x) of one posture."""
    g, pull = jax.vjp(girdle.residuals_mm, x[:6])
    return jnp.concatenate([W * (x[:6] - s) + pull(x[6:])[0], g])


def _with_derivative(function: Callable[[Array], Array], x: Array) -> tuple[Array, Array]:
    derivative, value = jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True)(x)
    return value, derivative


@jax.jit
def _newton(girdle: Girdle, s: Array, W: Array, x: Array) -> tuple[Array, Array]:
    """Step to the lowest J + penalty |g| of Newton's step and that without the curvature of g, each brought back to the
    surface; and |F| before it, in tolerances."""

    def limited(step):
        return step * jnp.minimum(1.0, _LONGEST_RAD / jnp.max(abs(step)))

    def to_surface(q):
        return q - limited(G.T @ _solve(G @ G.T, girdle.residuals_mm(q)))

    def merit(q, multipliers):
        penalty = 2.0 * jnp.max(abs(multipliers))
        return 0.5 * jnp.sum(W * (q - s) ** 2) + penalty * jnp.sum(abs(girdle.residuals_mm(q)))

    F, K = _with_derivative(partial(_conditions, girdle, s, W), x)
    G = K[6:, :6]
    steps = jax.vmap(_solve, (0, None))(jnp.stack([K, K.at[:6, :6].set(jnp.diag(W))]), -F)
    q = x[:6] + _LENGTHS[:, None, None] * jax.vmap(limited)(steps[:, :6])
    q, multipliers = jax.vmap(to_surface)(q.reshape(-1, 6)), jnp.tile(x[6:] + steps[:, 6:], (len(_LENGTHS), 1))
    merits = jax.vmap(merit)(q, multipliers)
    lowest = jnp.argmin(jnp.where(jnp.isnan(merits), jnp.inf, merits))
    best = jnp.where(jnp.max(abs(steps[0, :6])) < _LAST_RAD, 0, lowest)
    return jnp.concatenate([q[best], multipliers[best]]), jnp.max(abs(F) / _TOLERANCE)


@jax.jit
def _fit_from(girdle: Girdle, s: Array, W: Array, start: Array) -> tuple[Array, Array]:
    """x and J reached from one start; J is infinite where it does not converge."""

    def unfinished(state):
        return (state[1] > 1.0) & (state[2] < _MOST_STEPS)

    def advance(state):
        return *_newton(girdle, s, W, state[0]), state[2] + 1

    first = jnp.concatenate([start, jnp.zeros(3)]), jnp.inf, 0
    x, error, _ = jax.lax.while_loop(unfinished, advance, first)
    return x, jnp.where(error <= 1.0, 0.5 * jnp.sum(W * (x[:6] - s) ** 2), jnp.inf)


def _lowest(girdle: Girdle, s: Array, W: Array, starts: Array) -> Array:
    """x of one posture."""
    x, J = jax.vmap(partial(_fit_from, girdle, s, W))(starts)
    count = jnp.sum(W > 0.0)
    found = jnp.where(jnp.isfinite(jnp.min(J)) & (count >= FEWEST_ANGLES), x[jnp.argmin(J)], jnp.nan)
    return jnp.where(count > 0, found, jnp.concatenate([s, jnp.zeros(3)]))


@jax.custom_jvp
def _following(girdle: Girdle, s: Array, W: Array, x: Array) -> Array:
    """Return the optimum x as it is; it follows where girdle and s move."""
    return x


@_following.defjvp
def _following_jvp(primals, tangents):
    girdle, s, W, _ = primals
    x = _following(*primals)
    _, moved = jax.jvp(lambda girdle, s, W: _conditions(girdle, s, W, x), (girdle, s, W), tangents[:3])
    K, counts = jax.jacfwd(partial(_conditions, girdle, s, W))(x), jnp.any(W > 0.0)
    return x, -_solve(jnp.where(counts, K, jnp.eye(9)), jnp.where(counts, moved, 0.0))


def _each(of_posture: Callable[..., Array], girdle: Girdle, s: Array, W: Array, x: Array) -> Array:
    """Of every posture along the axes after the first of s."""
    for _ in range(s.ndim - 1):
        of_posture = jax.vmap(of_posture, (None if girdle.conoid_length_mm.ndim == 0 else -1, -1, -1, -1), -1)
    return of_posture(girdle, s, W, x)


def _search(girdle: Girdle, s: Array, W: Array, starts: Array) -> Array:
    return _each(_lowest, *jax.lax.stop_gradient((girdle, s, W, starts)))


def _fits_at(girdle: Girdle, s: Array, W: Array, x: Array) -> PostureFit:
    x = _each(_following, girdle, s, W, jax.lax.stop_gradient(x))
    return PostureFit(x[:6], x[6:], 0.5 * jnp.sum(W * (x[:6] - s) ** 2, axis=0))


@jax.jit
def _fits(girdle: Girdle, s: Array, W: Array, starts: Array) -> PostureFit:
    return _fits_at(girdle, s, W, _search(girdle, s, W, starts))


def _value(theta: Array, problem: _Problem, x: Array) -> tuple[Array, Array, Array, PostureFit]:
    """E, D and mean J, with the postures x."""
    fits, D = _fits_at(*problem.at(theta), x), jnp.mean(problem.distances(theta) ** 2)
    mean_j = problem.mean(fits.j_deg2)
    return D + problem.weight * mean_j, D, mean_j, fits


@jax.jit
def _objective(theta: Array, problem: _Problem, starts: Array) -> Array:
    return _value(theta, problem, _search(*problem.at(theta), starts))[0]


def _residuals(theta: Array, problem: _Problem, start: Array) -> Array:
    """Numbers whose sum of squares is E."""
    gaps = jnp.sqrt(0.5 * problem.W) * (_fits(*problem.at(theta), start).angles - problem.s)
    distances = problem.distances(theta) / np.sqrt(problem.points_mm.shape[1])
    return jnp.concatenate([distances, jnp.sqrt(problem.mean(problem.weight)) * gaps.ravel()])


def _slope(theta: Array, problem: _Problem, x: Array) -> Array:
    """dE/dtheta, with the postures that follow from x."""
    fits = _fits_at(*problem.at(theta), x)

    def lagrangian(theta):
        g = jax.vmap(problem.girdle.with_adapted(theta).residuals_mm, -1, -1)(fits.angles)
        return jnp.mean(problem.distances(theta) ** 2) + problem.weight * problem.mean(fits.multipliers * g)

    return jax.grad(lagrangian)(theta)


def _bounded_step(H: Array, slope: Array, low: Array, high: Array) -> Array:
    """Minimise slope' p + 1/2 p' H p within the bounds of p (primal-dual active sets)."""

    def again(_, p):
        aim = p - (H @ p + slope) / abs(jnp.diag(H))
        held = (aim <= low) | (aim >= high)
        return _solve(jnp.where(held[:, None], jnp.eye(len(p)), H), jnp.where(held, jnp.clip(aim, low, high), -slope))

    return jnp.clip(jax.lax.fori_loop(0, len(slope) + 2, again, jnp.zeros_like(slope)), low, high)


class _BoundedDescent(optimistix.AbstractDescent):
    """Levenberg-Marquardt's step within bounds, which optimistix has not."""

    low: Array
    high: Array

    def init(self, y, f_info_struct):
        return y, jnp.zeros((len(y), len(y))), jnp.zeros_like(y)

    def query(self, y, f_info, state):
        J = f_info.jac.as_matrix()
        return y, J.T @ J, J.T @ f_info.residual

    def step(self, step_size, state):
        y, JJ, slope = state
        damped = JJ + jnp.eye(len(y)) / step_size
        return _bounded_step(damped, slope, self.low - y, self.high - y), optimistix.RESULTS.successful


class _BoundedLevenbergMarquardt(optimistix.LevenbergMarquardt):
    def __init__(self, low: Array, high: Array):
        super().__init__(rtol=1e-8, atol=1e-8)
        self.descent = _BoundedDescent(low, high)  # pyright: ignore[reportAttributeAccessIssue]


def _least_squares(residuals: Callable[[Array], Array], theta: Array, low: Array, high: Array) -> Array:
    solver = _BoundedLevenbergMarquardt(low, high)
    return optimistix.least_squares(lambda y, _: residuals(y), solver, theta, throw=False, max_steps=200).value


def _descended(problem: _Problem, low: Array, high: Array, theta: Array) -> tuple[Array, Array, Array]:
    """theta, x and E of the optimum reached from theta; E is infinite where there is none."""

    def unfinished(state):
        return (state[2] > _SETTLED_MM) & (state[3] < _MOST_ROUNDS)

    def advance(state):
        theta, x, _, number = state
        x = _search(*problem.at(theta), jnp.concatenate([x[None, :6], _starts(problem.s)]))
        slope, H = _with_derivative(lambda theta: _slope(theta, problem, x), theta)
        step = _bounded_step(H, slope, low - theta, high - theta)
        longest = jnp.max(abs(step))
        theta = jnp.where(longest < _NEAR_MM, theta + step, theta)
        hopeless = jnp.any(jnp.isnan(x))  # it would keep the subjects beside it waiting
        residuals = partial(_residuals, problem=problem, start=x[None, :6])
        further = _least_squares(lambda theta: jnp.where(hopeless, 0.0, residuals(theta)), theta, low, high)
        return jnp.where(longest <= _SETTLED_MM, theta, further), x, longest, number + 1

    first = theta, jnp.concatenate([problem.s, jnp.zeros_like(problem.s[:3])]), jnp.inf, 0
    theta, x, longest, _ = jax.lax.while_loop(unfinished, advance, first)
    return theta, x, jnp.where(longest <= _SETTLED_MM, _value(theta, problem, x)[0], jnp.inf)


@jax.custom_jvp
def _adapted(problem: _Problem, bounds: Array) -> tuple[Array, Array]:
    """theta and x of the lowest optimum from the geometric fit and around it."""
    anywhere = jnp.full_like(bounds[0], jnp.inf)
    fitted = _least_squares(problem.distances, problem.girdle.adapted_mm, -anywhere, anywhere)
    starts = jnp.clip(fitted + STARTS_MM, *bounds)
    theta, x, E = jax.lax.map(partial(_descended, problem, *bounds), starts)
    return jax.tree.map(lambda of: jnp.where(jnp.isfinite(jnp.min(E)), of[jnp.argmin(E)], jnp.nan), (theta, x))


def _free(theta: Array, bounds: Array) -> Array:
    return ~((theta <= bounds[0]) | (theta >= bounds[1]))


@_adapted.defjvp
def _adapted_jvp(primals, tangents):
    (problem, bounds), (moved, moved_bounds) = primals, tangents
    theta, x = _adapted(problem, bounds)
    H = jax.jacfwd(lambda theta: _slope(theta, problem, x))(theta)
    _, slope_moved = jax.jvp(lambda problem: _slope(theta, problem, x), (problem,), (moved,))
    free = _free(theta, bounds)
    with_bound = jnp.where(theta <= bounds[0], *moved_bounds)
    step = _solve(jnp.where(free[:, None], H, jnp.eye(len(theta))), jnp.where(free, -slope_moved, with_bound))
    return (theta, x), (step, jnp.zeros_like(x))


@jax.jit
def _subject(problem: _Problem, bounds: Array) -> AdaptedSubject:
    theta, x = _adapted(problem, bounds)
    E, D, mean_j, fits = _value(theta, problem, x)
    return AdaptedSubject(theta, _free(theta, bounds), E, D, mean_j, fits, jnp.all(jnp.isfinite(theta)))
