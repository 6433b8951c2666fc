"""The two fits as differentiable JAX functions: the closest closed posture, and the girdle adapted to a subject."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jaxtyping import Array, Bool, Float

from models.adapted_parameters import STARTS_MM
from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle
from motions.errors import InputError
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

WEIGHT = 10.0

_OFFSETS_DEG = np.concatenate([np.zeros((1, 6)), np.random.default_rng(1).uniform(-30.0, 30.0, (9, 6))])
_LENGTHS = np.array([1.0, 0.3, 0.05])
_LONGEST_RAD = 0.5
_LAST_STEP_RAD = 1e-7
_MOST_STEPS = 30
_TOLERANCE = np.repeat([1e-8, 1e-9], [6, 3])

_MOST_ROUNDS = 6
_NEWTON_STEPS = 4
_SETTLED_MM = 1e-7


class PostureFit(NamedTuple):
    angles: Float[Array, " 6 *batch"]
    multipliers: Float[Array, " 3 *batch"]
    j_deg2: Float[Array, " *batch"]


class AdaptedSubject(NamedTuple):
    theta_mm: Float[Array, " adapted"]
    free: Bool[Array, " adapted"]
    E: Float[Array, ""]
    D_mm2: Float[Array, ""]
    mean_j_deg2: Float[Array, ""]
    postures: PostureFit
    converged: Bool[Array, ""]


def fit_posture(girdle, angles, measured=None, start=None) -> PostureFit:
    return _fits(girdle, *_target(angles, measured), start)


def objective(theta_mm, girdle, points_mm, angles, measured=None, weight=WEIGHT, start=None):
    return _terms(theta_mm, _problem(girdle, points_mm, angles, measured, weight), start)[0]


def adapt_subject(girdle, points_mm, bounds_mm, angles, measured=None, weight=WEIGHT) -> AdaptedSubject:
    return _subject(_problem(girdle, points_mm, angles, measured, weight), jnp.asarray(bounds_mm))


class _Problem(NamedTuple):
    girdle: Girdle
    points_mm: Array
    s: Array
    W: Array
    weight: Array


def _problem(girdle, points_mm, angles, measured, weight):
    return jax.tree.map(jnp.asarray, _Problem(girdle, points_mm, *_target(angles, measured), weight))


def _target(angles, measured):
    if jnp.shape(angles)[:1] != (6,):
        remedy = "Give (6, postures) in rad: np.deg2rad(motions.angles_deg).T"
        raise InputError("angles", None, f"their shape is {jnp.shape(angles)}", remedy)
    measured = jnp.ones(jnp.shape(angles), bool) if measured is None else jnp.asarray(measured)
    rest = (REST_DEG / DEG).reshape(6, *[1] * (jnp.ndim(angles) - 1))
    s = jnp.where(measured, angles, rest)
    if not isinstance(s, jax.core.Tracer) and bool(jnp.any(abs(s) > 2.0 * jnp.pi)):
        raise InputError("angles", None, "an angle is larger than a full turn", "Give radians: np.deg2rad(angles_deg)")
    count = measured.sum(axis=0)
    return s, jnp.where(measured, 2.0 * DEG**2 / jnp.maximum(count, 1), 0.0)


def _solve(A, b):
    """LU-free."""

    def eliminated(A, b):
        def step(k, M):
            below = jnp.where(jnp.arange(len(b)) >= k, abs(M[:, k]), -1.0)
            row = jnp.where(jnp.arange(len(b)) == jnp.argmax(below), 1.0, 0.0) @ M
            M = jnp.where((jnp.arange(len(b)) == jnp.argmax(below))[:, None], M[k], M)
            row = row / row[k]
            return (M - M[:, k, None] * row).at[k].set(row)

        return jax.lax.fori_loop(0, len(b), step, jnp.column_stack([A, b]))[:, -1]

    return jax.lax.custom_linear_solve(
        lambda x: A @ x, b, lambda _, b: eliminated(A, b), lambda _, b: eliminated(A.T, b)
    )


def _conditions(girdle, s, W, x):
    g, pull = jax.vjp(girdle.residuals_mm, x[:6])
    return jnp.concatenate([W * (x[:6] - s) + pull(x[6:])[0], g])


def _limited(step):
    return step * jnp.minimum(1.0, _LONGEST_RAD / jnp.max(abs(step)))


def _newton(girdle, s, W, x):
    def both(x):
        F = _conditions(girdle, s, W, x)
        return F, F

    def to_surface(q):
        return q - _limited(G.T @ _solve(G @ G.T, girdle.residuals_mm(q)))

    def merit(q, multipliers):
        J = 0.5 * jnp.sum(W * (q - s) ** 2)
        return J + 2.0 * jnp.max(abs(multipliers)) * jnp.sum(abs(girdle.residuals_mm(q)))

    K, F = jax.jacfwd(both, has_aux=True)(x)
    G = K[6:, :6]
    steps = jax.vmap(_solve, (0, None))(jnp.stack([K, K.at[:6, :6].set(jnp.diag(W))]), -F)
    q = x[:6] + _LENGTHS[:, None, None] * jax.vmap(_limited)(steps[:, :6])
    q = jax.vmap(to_surface)(q.reshape(-1, 6))
    multipliers = jnp.tile(x[6:] + steps[:, 6:], (len(_LENGTHS), 1))
    merits = jax.vmap(merit)(q, multipliers)
    tiny = jnp.max(abs(steps[0, :6])) < _LAST_STEP_RAD
    best = jnp.where(tiny, 0, jnp.argmin(jnp.where(jnp.isnan(merits), jnp.inf, merits)))
    return jnp.concatenate([q[best], multipliers[best]]), jnp.max(abs(F) / _TOLERANCE)


def _fit_from(girdle, s, W, start):
    def unfinished(state):
        _, error, number = state
        return (error > 1.0) & (number < _MOST_STEPS)

    def advance(state):
        x, _, number = state
        return *_newton(girdle, s, W, x), number + 1

    first = jnp.concatenate([start, jnp.zeros(3)])
    x, error, _ = jax.lax.while_loop(unfinished, advance, (first, jnp.inf, 0))
    return x, jnp.where(error <= 1.0, 0.5 * jnp.sum(W * (x[:6] - s) ** 2), jnp.inf)


@jax.custom_jvp
def _optimum(girdle, s, W, start):
    """x=(q, lambda)"""
    starts = start[None] if start is not None else s + _OFFSETS_DEG / DEG
    x, J = jax.vmap(partial(_fit_from, girdle, s, W))(starts)
    lowest = jnp.argmin(J)
    count = jnp.sum(W > 0.0)
    good = jnp.isfinite(J[lowest]) & (count >= FEWEST_ANGLES)
    return jnp.where(count > 0, jnp.where(good, x[lowest], jnp.nan), jnp.concatenate([s, jnp.zeros(3)]))


@_optimum.defjvp
def _optimum_jvp(primals, tangents):
    x = _optimum(*primals)
    *given, _ = primals
    _, moved = jax.jvp(lambda *given: _conditions(*given, x), given, tangents[:3])
    K = jax.jacfwd(partial(_conditions, *given))(x)
    counts = jnp.any(given[2] > 0.0)
    return x, -_solve(jnp.where(counts, K, jnp.eye(9)), jnp.where(counts, moved, 0.0))


@jax.jit
def _fits(girdle, s, W, start):
    girdle = jax.tree.map(jnp.asarray, girdle)
    batch = s.ndim - 1
    fit = _optimum
    for axis in range(batch):
        of_girdle = None if girdle.conoid_length_mm.ndim == 0 else -1
        fit = jax.vmap(fit, (of_girdle, -1, -1, None if start is None else -1), -1)
    x = fit(girdle, s, W, start)
    return PostureFit(x[:6], x[6:], 0.5 * jnp.sum(W * (x[:6] - s) ** 2, axis=0))


def _distances(theta, problem):
    moved = problem.girdle.with_adapted(theta)
    return signed_distance_mm(problem.points_mm, moved.centre_mm[:, None], moved.semi_axes_mm[:, None])


def _share(problem):
    return problem.weight / jnp.sum(jnp.any(problem.W > 0.0, axis=0))


def _terms(theta, problem, start):
    fits = _fits(problem.girdle.with_adapted(theta), problem.s, problem.W, start)
    D = jnp.mean(_distances(theta, problem) ** 2)
    mean_j = jnp.sum(fits.j_deg2) / jnp.sum(jnp.any(problem.W > 0.0, axis=0))
    return D + problem.weight * mean_j, D, mean_j, fits


def _residuals(problem, start, theta):
    fits = _fits(problem.girdle.with_adapted(theta), problem.s, problem.W, start)
    d = _distances(theta, problem)
    gaps = jnp.sqrt(_share(problem) * problem.W / 2.0) * (fits.angles - problem.s)
    return jnp.concatenate([d / np.sqrt(len(d)), gaps.ravel()])


def _slope(problem, start, theta):
    fits = _fits(problem.girdle.with_adapted(theta), problem.s, problem.W, start)

    def lagrangian(theta):
        g = jax.vmap(problem.girdle.with_adapted(theta).residuals_mm, -1, -1)(fits.angles)
        return jnp.mean(_distances(theta, problem) ** 2) + _share(problem) * jnp.sum(fits.multipliers * g)

    return jax.grad(lagrangian)(theta)


def _bounded_step(H, slope, low, high):
    def again(_, p):
        aim = p - (H @ p + slope) / abs(jnp.diag(H))
        held = (aim <= low) | (aim >= high)
        return _solve(jnp.where(held[:, None], jnp.eye(len(p)), H), jnp.where(held, jnp.clip(aim, low, high), -slope))

    return jnp.clip(jax.lax.fori_loop(0, 8, again, jnp.zeros_like(slope)), low, high)


class _BoundedDescent(optimistix.AbstractDescent):
    low: Array
    high: Array

    def init(self, y, f_info_struct):
        return y, jnp.zeros((len(y), len(y))), jnp.zeros_like(y)

    def query(self, y, f_info, state):
        J = f_info.jac.as_matrix()
        return y, J.T @ J, J.T @ f_info.residual

    def step(self, step_size, state):
        y, JJ, slope = state
        step = _bounded_step(JJ + jnp.eye(len(y)) / step_size, slope, self.low - y, self.high - y)
        return step, optimistix.RESULTS.successful


class _BoundedLevenbergMarquardt(optimistix.AbstractGaussNewton):
    descent: _BoundedDescent
    rtol: float = 1e-8
    atol: float = 1e-8
    norm: Callable = optimistix.max_norm
    search: optimistix.AbstractSearch = optimistix.ClassicalTrustRegion()
    verbose: Callable = lambda **_: None


def _least_squares(residuals, theta, low, high, steps=100):
    solver = _BoundedLevenbergMarquardt(_BoundedDescent(low, high))
    return optimistix.least_squares(lambda y, _: residuals(y), solver, theta, throw=False, max_steps=steps).value


def _descended(problem, low, high, theta):
    def advance(state):
        theta, q, _, number = state
        q = _lower(problem, theta, q)
        new = _least_squares(partial(_residuals, problem, q), theta, low, high)
        slope = partial(_slope, problem, q)

        def newton(_, theta):
            return theta + _bounded_step(jax.jacfwd(slope)(theta), slope(theta), low - theta, high - theta)

        new = jax.lax.fori_loop(0, _NEWTON_STEPS, newton, new)
        q = _fits(problem.girdle.with_adapted(new), problem.s, problem.W, q).angles
        return new, q, jnp.max(abs(new - theta)), number + 1

    def unfinished(state):
        return (state[2] > _SETTLED_MM) & (state[3] < _MOST_ROUNDS)

    theta, q, moved, number = jax.lax.while_loop(unfinished, advance, (theta, problem.s, jnp.inf, 0))
    E = _terms(theta, problem, q)[0]
    return theta, q, jnp.where(moved <= _SETTLED_MM, E, jnp.inf)


def _lower(problem, theta, q):
    girdle = problem.girdle.with_adapted(theta)
    fresh, warm = (_fits(girdle, problem.s, problem.W, start) for start in (None, q))
    return jnp.where(fresh.j_deg2 < warm.j_deg2 - 1e-6, fresh.angles, jnp.where(jnp.isnan(warm.angles), fresh.angles, warm.angles))


@jax.custom_jvp
def _adapted(problem, bounds):
    low, high = bounds
    own = problem.girdle.adapted_mm
    fitted = _least_squares(lambda theta: _distances(theta, problem), own, jnp.full(6, -jnp.inf), jnp.full(6, jnp.inf), 200)
    starts = jnp.clip(fitted + STARTS_MM, low, high)
    theta, q, E = jax.vmap(partial(_descended, problem, low, high))(starts)
    lowest = jnp.argmin(E)
    good = jnp.isfinite(E[lowest])
    return jnp.where(good, theta[lowest], jnp.nan), jnp.where(good, q[lowest], jnp.nan)


@_adapted.defjvp
def _adapted_jvp(primals, tangents):
    (problem, bounds), (dproblem, dbounds) = primals, tangents
    theta, q = _adapted(problem, bounds)
    low, high = bounds
    q0 = jax.lax.stop_gradient(q)
    free = (theta > low) & (theta < high)
    H = jax.jacfwd(partial(_slope, problem, q0))(theta)
    _, dslope = jax.jvp(lambda problem: _slope(problem, q0, theta), (problem,), (dproblem,))
    A = jnp.where(free[:, None], H, jnp.eye(len(theta)))
    b = jnp.where(free, -dslope, jnp.where(theta <= low, *dbounds))
    return (theta, q), (_solve(A, b), jnp.zeros_like(q))


@jax.jit
def _subject(problem, bounds):
    theta, q = _adapted(problem, bounds)
    E, D, mean_j, fits = _terms(theta, problem, jax.lax.stop_gradient(q))
    free = (theta > bounds[0]) & (theta < bounds[1])
    return AdaptedSubject(theta, free, E, D, mean_j, fits, jnp.all(jnp.isfinite(theta)))
