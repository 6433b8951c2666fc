"""Small systems of equations and least squares inside compiled loops."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import optimistix

from motions.arrays import Array


def solve(A: Array, b: Array) -> Array:
    """Solve A x = b by elimination: batches of LAPACK's calls have hung inside a compiled loop."""

    def solved(A, b):
        def eliminated(k, M):
            pivot = jnp.arange(len(b)) == jnp.argmax(jnp.where(jnp.arange(len(b)) >= k, abs(M[:, k]), -1.0))
            row = jnp.where(pivot, 1.0, 0.0) @ M
            row, M = row / row[k], jnp.where(pivot[:, None], M[k], M)
            return (M - M[:, k, None] * row).at[k].set(row)

        return jax.lax.fori_loop(0, len(b), eliminated, jnp.column_stack([A, b]))[:, -1]

    return jax.lax.custom_linear_solve(lambda x: A @ x, b, lambda _, b: solved(A, b), lambda _, b: solved(A.T, b))


def with_derivative(function: Callable[[Array], Array], x: Array) -> tuple[Array, Array]:
    """Compute f and df/dx."""
    derivative, value = jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True)(x)
    return value, derivative


def lowest_step(H: Array, slope: Array, bounds: Array | None) -> Array:
    """Minimise slope' p + 1/2 p' H p, within the bounds of p where there are any (primal-dual active sets)."""
    if bounds is None:
        return solve(H, -slope)
    low, high = bounds

    def again(_, p):
        aim = p - (H @ p + slope) / abs(jnp.diag(H))
        held = (aim <= low) | (aim >= high)
        return solve(jnp.where(held[:, None], jnp.eye(len(p)), H), jnp.where(held, jnp.clip(aim, low, high), -slope))

    return jnp.clip(jax.lax.fori_loop(0, len(slope) + 2, again, jnp.zeros_like(slope)), low, high)


class _BoundedDescent(optimistix.AbstractDescent):
    """Levenberg-Marquardt's step within bounds, which optimistix has not."""

    bounds: Array | None

    def init(self, y, f_info_struct):
        return y, jnp.zeros((len(y), len(y))), jnp.zeros_like(y)

    def query(self, y, f_info, state):
        J = f_info.jac.as_matrix()
        return y, J.T @ J, J.T @ f_info.residual

    def step(self, step_size, state):
        y, JJ, slope = state
        within = None if self.bounds is None else self.bounds - y
        return lowest_step(JJ + jnp.eye(len(y)) / step_size, slope, within), optimistix.RESULTS.successful


class _BoundedLevenbergMarquardt(optimistix.LevenbergMarquardt):
    def __init__(self, bounds: Array | None):
        super().__init__(rtol=1e-8, atol=1e-8)
        self.descent = _BoundedDescent(bounds)  # pyright: ignore[reportAttributeAccessIssue]


def least_squares(
    residuals: Callable[[Array], Array], start: Array, bounds: Array | None = None, most_steps: int = 200
) -> Array:
    """Minimise the sum of squares, within bounds where there are any."""
    solver = _BoundedLevenbergMarquardt(bounds)
    return optimistix.least_squares(lambda y, _: residuals(y), solver, start, throw=False, max_steps=most_steps).value
