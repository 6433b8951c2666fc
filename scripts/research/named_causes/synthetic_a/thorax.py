"""Distance to the thorax: an ellipsoid, or a superquadric."""

import numpy as np

from scripts.research.named_causes.synthetic_a.conventions import Array


def ellipsoid_foot(point: Array, semi: Array) -> Array:
    """Compute the closest point (n, 3) of the ellipsoid |x / semi| = 1 to `point`, both relative to its centre, mm.

    The closest point is semi^2 x / (semi^2 + t); t is the largest root of a function that decreases and is convex to
    the right of the start, so that Newton's steps approach the root from one side.
    """
    square = semi**2
    t = np.max(semi * np.abs(point) - square, axis=-1)
    for _ in range(100):
        ratio = semi * point / (square + t[:, None])
        value = np.sum(ratio**2, axis=-1) - 1.0
        step = 0.5 * value / np.sum(ratio**2 / (square + t[:, None]), axis=-1)
        t = t + step
        if np.all(np.abs(step) <= 1e-14 * np.max(square)):
            break
    return square * point / (square + t[:, None])


def superquadric_foot(point: Array, semi: Array, exponent: Array) -> Array:
    """Compute the closest point (n, 3) of sum |x / semi|^p = 1 to `point`, mm.

    Newton's method solves y - x + m grad F(y) = 0, F(y) = 1; the second derivative of F is diagonal, so each step has a
    closed form. The start is the ellipsoid's closest point, moved radially onto the surface, as every iterate is. Where
    the iteration does not converge (deep inside, at the ridges of a small exponent) the result is NaN, and the posture
    counts as open.
    """
    p, late = exponent[:, None], np.ones(len(point), dtype=bool)

    def onto(y: Array) -> Array:
        return y / np.sum(np.abs(y / semi) ** p, axis=-1, keepdims=True) ** (1.0 / p)

    def slope(y: Array) -> Array:
        return p / semi * np.sign(y) * np.abs(y / semi) ** (p - 1.0)

    y = onto(ellipsoid_foot(point, semi))
    for _ in range(60):
        g = slope(y)
        m = np.sum((point - y) * g, axis=-1, keepdims=True) / np.sum(g * g, axis=-1, keepdims=True)
        bend = p * (p - 1.0) / semi**2 * np.maximum(np.abs(y / semi), 1e-6) ** (p - 2.0)
        D = np.maximum(1.0 + m * bend, 0.2)
        r = y - point + m * g
        dm = -np.sum(g * r / D, axis=-1, keepdims=True) / np.sum(g * g / D, axis=-1, keepdims=True)
        step = -(r + g * dm) / D
        step *= np.minimum(1.0, 20.0 / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-30))
        y = onto(y + step)
        late = np.max(np.abs(step), axis=-1) > 1e-10
        if not late.any():
            break
    return np.where(late[:, None], np.nan, y)


def surface_distance(point: Array, semi: Array, exponent: Array) -> tuple[Array, Array]:
    """Compute the signed distance (n,) in mm, outside positive, and its gradient, the unit outward normal (n, 3)."""
    foot = ellipsoid_foot(point, semi)
    bent = exponent != 2.0
    if bent.any():
        foot[bent] = superquadric_foot(point[bent], semi[bent], exponent[bent])
    normal = np.sign(foot) * np.abs(foot / semi) ** (exponent[:, None] - 1.0) / semi
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.sum((point - foot) * normal, axis=-1), normal
