"""Least sum of squares under constraints and bounds, as a differentiable function of the numbers of the problem.

    minimise |r(v)|^2   subject to   g(v) = 0,   low <= theta <= high,   v = (theta, q of each posture)

Constraints and bounds first have slack: least squares of r, g / slack and (theta - nearest in bounds) / slack, which
needs no feasible start and passes local minima. Newton's method then solves the optimality conditions for x = (theta, q
and lambda of each posture),

    F(x) = d/dx (|r|^2 + lambda' g) = 0,   theta = bound in place of the equation of theta where theta was beyond it,

which also give the derivatives (implicit function theorem): dx = -K^-1 dF with K = dF/dx. Postures interact only
through theta, so that J'J and K are arrow matrices, and the cost is proportional to the number of postures.

A problem is a pytree of the numbers on which the optimum depends, with ``bounds`` of theta, and with ``residuals`` (of
theta alone, and of each posture) and ``constraints`` as functions of theta and q. Arrays over postures have the
postures last.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jax.flatten_util import ravel_pytree

from motions.arrays import Array

SOFTLY, HARDER, NEAR = np.array([[1.0, 0.1, 0.01], [0.1, 0.1, 0.01], [0.01, 0.01, 0.01]])
"""Slacks of successive searches, mm: first a chain open by 1 mm costs as much as gaps of 1 degree. A larger slack leads
a search farther; ``NEAR`` ends in the minimum around the start."""

_MOST_STEPS, _ENDED = 30, 1e-6
"""Largest number of steps of a search, to which two per variable are added (40 are too few for subjects with unmeasured
angles), and the absolute and relative tolerance of a search."""

_MOST_ROUNDS, _SETTLED = 10, 1e-9
"""Largest number of Newton steps, of which three are needed, and the step length, mm or rad, at which they end.
Convergence is quadratic, so only rounding is left after such a step."""


@jax.custom_batching.sequential_vmap
def _by_lapack(A: Array, b: Array) -> Array:
    """Solve systems one after the other: LAPACK's batches have hung inside compiled loops."""
    return jnp.linalg.solve(A, b)


class _Arrow(NamedTuple):
    """Symmetric arrow matrix over theta and the own variables of each posture."""

    of_theta: Array
    both: Array
    """Blocks (own, theta, postures)."""
    own: Array
    """Blocks (own, own, postures)."""

    def __matmul__(self, x: tuple[Array, Array]) -> tuple[Array, Array]:
        of_theta = self.of_theta @ x[0] + jnp.einsum("ktp,kp->t", self.both, x[1])
        return of_theta, jnp.einsum("ktp,t->kp", self.both, x[0]) + jnp.einsum("kjp,jp->kp", self.own, x[1])

    def solve(self, b: tuple[Array, Array]) -> tuple[Array, Array]:
        """Solve a linear system, first for each posture's own variables (Schur complement)."""
        flat, parts = ravel_pytree(b)  # JAX cannot transpose a solve of which only one of two parts is used

        def product(x):
            return ravel_pytree(self @ parts(x))[0]

        def solution(_, b):
            theta, own = parts(b)
            solved = jax.vmap(_by_lapack, -1, -1)(self.own, jnp.concatenate([self.both, own[:, None]], axis=1))
            rows = jnp.column_stack([self.of_theta, theta]) - jnp.einsum("ktp,kup->tu", self.both, solved)
            theta = _by_lapack(rows[:, :-1], rows[:, -1])
            return ravel_pytree((theta, solved[:, -1] - jnp.einsum("ktp,t->kp", solved[:, :-1], theta)))[0]

        return parts(jax.lax.custom_linear_solve(product, flat, solution, symmetric=True))


def _columns(linear, theta: Array, own: Array):
    """Apply a linear function to the unit vectors of theta and of the variables of a posture, for all postures at once.

    Postures do not interact, so these are all its columns (Curtis, Powell and Reid 1974).
    """
    t, k = len(theta), len(own)
    of_own = jnp.eye(t + k, k, -t)[..., None] * jnp.ones_like(own)
    return jax.vmap(linear)((jnp.eye(t + k, t), of_own))


class _Descent(optimistix.AbstractDescent):
    """Levenberg-Marquardt step by its normal equations."""

    def init(self, y, f_info_struct):
        (t,), (k, postures) = y[0].shape, y[1].shape
        return _Arrow(*map(jnp.zeros, ((t, t), (k, t, postures), (k, k, postures)))), jax.tree.map(jnp.zeros_like, y)

    def query(self, y, f_info, state):  # J'J, J'r
        t, (r, r_each) = len(y[0]), f_info.residual
        J, J_each = _columns(f_info.jac.mv, *y)
        JJ = jnp.einsum("irp,jrp->ijp", J_each, J_each)
        slope = jnp.einsum("irp,rp->ip", J_each, r_each)
        arrow = _Arrow(J[:t] @ J[:t].T + jnp.sum(JJ[:t, :t], axis=-1), JJ[t:, :t], JJ[t:, t:])
        return arrow, (J[:t] @ r + jnp.sum(slope[:t], axis=-1), slope[t:])

    def step(self, step_size, state):
        (of_theta, both, own), slope = state
        damped = _Arrow(of_theta + jnp.eye(len(of_theta)) / step_size, both, own + jnp.eye(6)[..., None] / step_size)
        return jax.tree.map(jnp.negative, damped.solve(slope)), optimistix.RESULTS.successful


class _LevenbergMarquardt(optimistix.LevenbergMarquardt):
    """Levenberg-Marquardt with ``_Descent``."""

    def __init__(self):
        super().__init__(rtol=_ENDED, atol=_ENDED)
        self.descent = _Descent()  # pyright: ignore[reportAttributeAccessIssue]


def sum_of_squares(problem, x: tuple[Array, Array]) -> Array:
    """Compute |r|^2."""
    theta, own = x
    of_theta, of_each = problem.residuals(theta, own[:6])
    return jnp.sum(of_theta**2) + jnp.sum(of_each**2)


@jax.jit
def _gradient(problem, x: tuple[Array, Array]) -> tuple[Array, Array]:
    """Compute d/dx (|r|^2 + lambda' g)."""

    def lagrangian(x):
        theta, own = x
        return sum_of_squares(problem, x) + jnp.sum(own[6:] * problem.constraints(theta, own[:6]))

    return jax.grad(lagrangian)(x)


@jax.jit
def _conditions(problem, beyond: Array, x: tuple[Array, Array]) -> tuple[Array, Array]:
    """Compute F. ``beyond`` is 1 where theta is above its upper bound, -1 below its lower bound, 0 where it is free."""
    of_theta, of_own = _gradient(problem, x)
    return jnp.where(beyond == 0.0, of_theta, x[0] - jnp.where(beyond < 0.0, *problem.bounds)), of_own


@jax.jit
def _newton_step(problem, beyond: Array, x: tuple[Array, Array], F: tuple[Array, Array]) -> tuple[Array, Array]:
    """Compute -K^-1 F. The rows of K for theta at a bound are those of the unit matrix, and the right-hand side
    contains the effect of these steps on all other equations."""
    t, free = len(beyond), beyond == 0.0
    H, H_each = _columns(lambda dx: jax.jvp(lambda x: _gradient(problem, x), (x,), (dx,))[1], *x)
    K = _Arrow(H[:t], jnp.swapaxes(H_each[:t], 0, 1), H_each[t:])
    moved = K @ (jnp.where(free, 0.0, -F[0]), jnp.zeros_like(F[1]))
    b = jnp.where(free, -F[0] - moved[0], -F[0]), -F[1] - moved[1]
    among_free = jnp.where(free & free[:, None], K.of_theta, jnp.eye(t))
    return _Arrow(among_free, jnp.where(free[:, None], K.both, 0.0), K.own).solve(b)


def softly(problem, start: tuple[Array, Array], slacks: Array) -> tuple[Array, Array]:
    """Search from v = start with one slack after the other; return v at the last slack."""

    def residuals(v, slack):
        of_theta, of_each = problem.residuals(*v)
        outside = v[0] - jnp.clip(v[0], *problem.bounds)
        open_by = problem.constraints(*v)
        return jnp.concatenate([of_theta, outside / slack]), jnp.concatenate([of_each, open_by / slack])

    def stiffer(v, slack):
        solver, most = _LevenbergMarquardt(), _MOST_STEPS + 2 * sum(part.size for part in v)
        return optimistix.least_squares(residuals, solver, v, slack, throw=False, max_steps=most).value, None

    return jax.lax.scan(stiffer, start, slacks)[0]


@jax.jit
def reached(problem, start: tuple[Array, Array], slacks: Array) -> tuple[tuple[Array, Array], Array, Array]:
    """Find the optimum x from v = start; return x, where theta is beyond its bounds, and |r|^2, infinite without an
    optimum."""
    theta, q = softly(problem, start, slacks)
    beyond = jnp.sign(theta - jnp.clip(theta, *problem.bounds))

    def newton(state):
        x, _, count = state
        step = _newton_step(problem, beyond, x, _conditions(problem, beyond, x))
        longest = jnp.max(abs(jnp.concatenate([step[0], step[1][:6].ravel()])))
        return jax.tree.map(jnp.add, x, step), longest, count + 1

    multipliers = 2.0 * problem.constraints(theta, q) / slacks[-1] ** 2
    first = (theta, jnp.concatenate([q, multipliers])), jnp.inf, 0
    x, longest, _ = jax.lax.while_loop(lambda state: (state[1] > _SETTLED) & (state[2] < _MOST_ROUNDS), newton, first)
    return x, beyond, jnp.where(longest <= _SETTLED, sum_of_squares(problem, x), jnp.inf)


@jax.custom_jvp
def following(problem, beyond: Array, x: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the optimum x unchanged; its derivatives follow the numbers of the problem."""
    return x


@following.defjvp
def _following_jvp(primals, tangents):
    (problem, beyond, _), x = primals, following(*primals)
    _, moved = jax.jvp(lambda problem: _conditions(problem, beyond, x), (problem,), tangents[:1])
    return x, _newton_step(problem, beyond, x, moved)
