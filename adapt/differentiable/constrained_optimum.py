"""The least sum of squares under constraints and bounds, as a differentiable function of the numbers of the problem.

    minimise |r(v)|^2   subject to   g(v) = 0,   low <= v <= high

Constraints and bounds first have slack: least squares of r, g / slack and (v - nearest in bounds) / slack, which needs
no feasible start and passes local minima. Newton's method then solves the conditions of the optimum x = (v, lambda),

    F(x) = d/dx (|r|^2 + lambda' g) = 0,   v = bound in place of dF/dv where v was beyond it,

and they carry its derivatives (implicit function theorem): dx = -K^-1 dF with K = dF/dx. A problem is a pytree of the
numbers that the optimum follows, with ``residuals`` and ``constraints`` of v, and ``bounds``.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix

from motions.arrays import Array

SOFTLY, HARDER, NEAR = np.array([[1.0, 0.1, 0.01], [0.1, 0.1, 0.01], [0.01, 0.01, 0.01]])
"""Slacks of one search after the other, mm: first a chain open by 1 mm costs as much as gaps of 1 degree. The
more slack, the farther a search leads; the last ones end in the minimum around the start."""

_MOST_STEPS, _ENDED = 30, 1e-6
"""Of a search, and two more for each variable: 40 are too few for subjects with unmeasured angles. Its absolute and
relative tolerance."""

_MOST_ROUNDS, _SETTLED = 10, 1e-9
"""Of Newton's method, which needs three; a step as short ends it, mm or rad. Quadratically, rounding is left."""


@jax.custom_batching.sequential_vmap
def _by_lapack(A: Array, b: Array) -> Array:
    """One after the other: its batches have hung inside compiled loops."""
    return jnp.linalg.solve(A, b)


def _solve(A: Array, b: Array) -> Array:
    return jax.lax.custom_linear_solve(A.__matmul__, b, lambda _, b: _by_lapack(A, b), lambda _, b: _by_lapack(A.T, b))


class _Descent(optimistix.AbstractDescent):
    """Levenberg-Marquardt's step by its normal equations, for ``_solve``."""

    def init(self, y, f_info_struct):
        return jnp.zeros((len(y), len(y))), jnp.zeros_like(y)

    def query(self, y, f_info, state):
        J = f_info.jac.as_matrix()
        return J.T @ J, J.T @ f_info.residual

    def step(self, step_size, state):
        JJ, slope = state
        return -_solve(JJ + jnp.eye(len(slope)) / step_size, slope), optimistix.RESULTS.successful


class _LevenbergMarquardt(optimistix.LevenbergMarquardt):
    def __init__(self):
        super().__init__(rtol=_ENDED, atol=_ENDED)
        self.descent = _Descent()  # pyright: ignore[reportAttributeAccessIssue]


def _conditions(problem, beyond: Array, x: Array) -> Array:
    """F; ``beyond`` is 1 above the upper bound, -1 below the lower, 0 where v is free."""
    n = len(beyond)
    slope = jax.grad(lambda x: jnp.sum(problem.residuals(x[:n]) ** 2) + x[n:] @ problem.constraints(x[:n]))(x)
    of_v = jnp.where(beyond == 0.0, slope[:n], x[:n] - jnp.where(beyond < 0.0, *problem.bounds))
    return jnp.concatenate([of_v, slope[n:]])


def _slope(problem, beyond: Array, x: Array) -> tuple[Array, Array]:
    """K, and F."""
    return jax.jacfwd(lambda x: (_conditions(problem, beyond, x),) * 2, has_aux=True)(x)


def softly(problem, start: Array, slacks: Array) -> Array:
    """Search from v = start: v at the last slack."""

    def residuals(v, slack):
        outside = v - jnp.clip(v, *problem.bounds)
        return jnp.concatenate([problem.residuals(v), problem.constraints(v) / slack, outside / slack])

    def stiffer(v, slack):
        solver, most = _LevenbergMarquardt(), _MOST_STEPS + 2 * len(v)
        return optimistix.least_squares(residuals, solver, v, slack, throw=False, max_steps=most).value, None

    return jax.lax.scan(stiffer, start, slacks)[0]


def reached(problem, start: Array, slacks: Array) -> tuple[Array, Array, Array]:
    """Find the optimum x from v = start, where v is beyond its bounds, and |r|^2; infinite where there is none."""
    v, n = softly(problem, start, slacks), len(start)
    beyond = jnp.sign(v - jnp.clip(v, *problem.bounds))

    def newton(state):
        x, _, count = state
        K, F = _slope(problem, beyond, x)
        step = _solve(K, -F)
        return x + step, jnp.max(abs(step[:n])), count + 1

    first = jnp.concatenate([v, 2.0 * problem.constraints(v) / slacks[-1] ** 2]), jnp.inf, 0
    x, longest, _ = jax.lax.while_loop(lambda state: (state[1] > _SETTLED) & (state[2] < _MOST_ROUNDS), newton, first)
    return x, beyond, jnp.where(longest <= _SETTLED, jnp.sum(problem.residuals(x[:n]) ** 2), jnp.inf)


@jax.custom_jvp
def following(problem, beyond: Array, x: Array) -> Array:
    """Return the optimum x as it is; it follows where the numbers of the problem move."""
    return x


@following.defjvp
def _following_jvp(primals, tangents):
    (problem, beyond, _), x = primals, following(*primals)
    _, moved = jax.jvp(lambda problem: _conditions(problem, beyond, x), (problem,), tangents[:1])
    return x, _solve(_slope(problem, beyond, x)[0], -moved)
