"""Sphere and cylinder fitted to points: head and shaft of the humerus, glenohumeral joint (thesis 4.3.3, 4.3.5).

The fits minimise the sum of squared distances to the surface (Tables 4.3 and 4.4).
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from models.person.least_squares import Fit, Points, fitted

_FLATTEST = 1e-3
"""Ratio of singular values of the points. If the third over the first is smaller, the points lie in a plane, which
spheres of any radius fit; if the second over the first is, they lie on a line."""


@dataclass(frozen=True)
class Sphere:
    """The sphere closest to the points."""

    centre_mm: Float[np.ndarray, "3"]
    radius_mm: float
    fit: Fit
    """Fit of four parameters: x, y, z of the centre relative to the mean point, radius."""

    @property
    def volume_cm3(self) -> float:
        """Volume 4/3 pi r^3 (Table 4.8)."""
        return 4.0 / 3.0 * np.pi * (self.radius_mm / 10.0) ** 3


@dataclass(frozen=True)
class Cylinder:
    """The cylinder closest to the points."""

    point_mm: Float[np.ndarray, "3"]
    """Point on the axis, in the middle of the measured part."""
    direction: Float[np.ndarray, "3"]
    """Unit vector of the axis, upward (y > 0)."""
    radius_mm: float
    fit: Fit
    """Fit of five parameters: two shifts across the initial axis, two slopes of the axis, radius."""


def fit_sphere(points_mm: Points) -> Sphere:
    """Fit a sphere by min sum (|p - c| - r)^2. Starting point: the algebraic fit |p|^2 = 2 c.p + (r^2 - |c|^2).

    ValueError for fewer than four points, or for points in a plane.
    """
    _check(points_mm, 4, "a sphere", 2)
    middle = points_mm.mean(axis=1)
    p = points_mm - middle[:, None]
    unknowns = np.vstack([2.0 * p, np.ones(p.shape[1])]).T
    solution = np.linalg.lstsq(unknowns, (p**2).sum(axis=0), rcond=None)[0]
    start = np.append(solution[:3], np.sqrt(solution[3] + (solution[:3] ** 2).sum()))
    fit = fitted(_from_sphere, p, start)
    return Sphere(fit.values[:3] + middle, abs(float(fit.values[3])), fit)


def fit_cylinder(points_mm: Points) -> Cylinder:
    """Fit a cylinder by min sum (distance to the axis - r)^2.

    Starting point: the longest axis of the points and a circle across this axis, so the measured shaft must be longer
    than wide. ValueError for fewer than five points, or for points on a line.
    """
    _check(points_mm, 5, "a cylinder", 1)
    middle = points_mm.mean(axis=1)
    p = points_mm - middle[:, None]
    axes = np.linalg.svd(p)[0]
    axes = np.stack([axes[:, 1], axes[:, 2], axes[:, 0]], axis=1)  # across, across, along
    local = axes.T @ p
    unknowns = np.vstack([2.0 * local[:2], np.ones(p.shape[1])]).T
    u, v, rest = np.linalg.lstsq(unknowns, (local[:2] ** 2).sum(axis=0), rcond=None)[0]
    fit = fitted(_from_cylinder, local, np.array([u, v, 0.0, 0.0, np.sqrt(max(rest + u * u + v * v, 1e-6))]))
    u, v, a, b, radius = fit.values
    direction = axes @ np.array([a, b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
    direction = direction if direction[1] >= 0.0 else -direction
    return Cylinder(middle + axes @ np.array([u, v, 0.0]), direction, abs(float(radius)), fit)


def _from_sphere(values, p):
    return _length(p - values[:3, None]) - values[3]


def _from_cylinder(values, p):
    u, v, a, b, radius = values
    direction = jnp.stack([a, b, jnp.ones_like(a)]) / jnp.sqrt(a * a + b * b + 1.0)
    off = p - jnp.stack([u, v, jnp.zeros_like(u)])[:, None]
    return _length(off - direction[:, None] * (direction @ off)) - radius


def _length(v):
    return jnp.sqrt(jnp.maximum(jnp.sum(v * v, axis=0), 1e-12))


def _check(points_mm: Points, fewest: int, what: str, dimension: int) -> None:
    count = points_mm.shape[1]
    if count < fewest:
        raise ValueError(f"{count} points, and {what} needs {fewest}")
    spread = np.linalg.svd(points_mm - points_mm.mean(axis=1, keepdims=True), compute_uv=False)
    if spread[dimension] < _FLATTEST * spread[0]:
        raise ValueError(f"the points of {what} lie {'in a plane' if dimension == 2 else 'on a line'}")
