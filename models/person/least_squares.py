"""Least-squares fits of surfaces to points, with the covariance of the fitted parameters."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motions.arrays import Array

_SETTLED = 1e-12
"""Relative and absolute (mm) tolerance of the change per iteration. With it, the fit to exact points on a patch is
correct to 1e-6 mm, even where M_y and A_y have almost the same effect."""

_MOST_STEPS = 500

_STATIONARY = 1e-6
"""Tolerance of |J_i' r| / (|J_i| |r|), the cosine between residuals and a column of the Jacobian, at a minimum."""

_EXACT_MM = 1e-9
"""Residual of exact points, from rounding."""

_POINTS_STEP = 16
"""Number of points to a multiple of which each fit is padded, with weight 0, so that few programs are compiled."""

Points = Float[np.ndarray, "3 points"]


@dataclass(frozen=True)
class Fit:
    """Parameters that minimise the sum of squared distances."""

    values: Float[np.ndarray, " parameters"]
    covariance: Float[np.ndarray, "parameters parameters"]
    """s^2 (J'J)^-1 with s^2 = sum of squares / (points - parameters), for points with independent noise."""
    rms_mm: float
    """Root mean square of the distances of the points to the surface."""
    converged: bool

    @property
    def sd(self) -> Float[np.ndarray, " parameters"]:
        """Standard deviations of the parameters."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def correlation(self, one: int, other: int) -> float:
        """Compute the correlation of two parameters; 0 where one of them has SD 0."""
        sd = self.sd[one] * self.sd[other]
        return float(self.covariance[one, other] / sd) if sd > 0.0 else 0.0


def fitted(distances: Callable[..., Array], points_mm: Points, start: Float[np.ndarray, " parameters"], *fixed) -> Fit:
    """Minimise sum |distances(parameters, points, *fixed)|^2 from a starting point (Levenberg-Marquardt, optimistix).

    Pass a module-level function as ``distances``, not a closure made for each fit: the compiled program is cached under
    this function.
    """
    count = points_mm.shape[1]
    padded = -(-count // _POINTS_STEP) * _POINTS_STEP
    points = np.pad(points_mm, ((0, 0), (0, padded - count)), mode="edge")
    weights = (np.arange(padded) < count).astype(float)
    arrays = (jnp.asarray(x) for x in (start, points, weights))
    values, J, left = (np.asarray(x) for x in _solved(distances, *arrays, fixed))
    squares, freedom = float((left**2).sum()), max(count - len(values), 1)
    covariance = squares / freedom * np.linalg.pinv(J.T @ J, hermitian=True)
    return Fit(values, covariance, float(np.sqrt(squares / count)), _is_minimum(values, J, left))


def _is_minimum(values, J, left) -> bool:
    if not (np.isfinite(values).all() and np.isfinite(J).all()):
        return False
    slack = np.maximum(np.linalg.norm(J, axis=0), _EXACT_MM) * (_STATIONARY * np.linalg.norm(left) + _EXACT_MM)
    return bool((np.abs(J.T @ left) <= slack).all())


def minimised(distances, start, points, weights, fixed: tuple[Any, ...]) -> tuple[Array, Array]:
    """Minimise sum (weights distances)^2 from a starting point, in JAX. Return the parameters and True if converged."""
    import optimistix  # takes 0.2 s, and only some commands need it

    def residuals(values, _):
        return weights * distances(values, points, *fixed)

    solver = optimistix.LevenbergMarquardt(rtol=_SETTLED, atol=_SETTLED)
    solution = optimistix.least_squares(residuals, solver, start, throw=False, max_steps=_MOST_STEPS)
    return solution.value, solution.result == optimistix.RESULTS.successful


@partial(jax.jit, static_argnums=0)
def _solved(distances, start, points, weights, fixed) -> tuple[Any, ...]:
    def residuals(values):
        return weights * distances(values, points, *fixed)

    values, _ = minimised(distances, start, points, weights, fixed)
    return values, jax.jacfwd(residuals)(values), residuals(values)
