"""Signed Euclidean distance to the thorax ellipsoid, exact and differentiable wherever a derivative exists.

The closest point x of the surface sum (x_i / a_i)^2 = 1 to a point p (both from the centre, along the axes) is the
point whose normal passes through p:

    p - x = t n,   n_i = x_i / a_i^2   =>   x_i = a_i^2 p_i / (t + a_i^2),

with t the largest root of  S(t) = sum a_i^2 p_i^2 / (t + a_i^2)^2 = 1  (Eberly, "Distance from a point to an
ellipse, an ellipsoid, or a hyperellipsoid", 2013). With tau = t + min a^2 > 0 no denominator suffers cancellation, and
Newton on  1 - S^(-1/2),  nearly linear in tau, converges monotonically to the root from below (the secular
equation of More and Sorensen, SIAM J. Sci. Stat. Comput. 4, 1983).
"""

from collections.abc import Callable, Sequence
from operator import add, mul, pow, sub
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from motions.arrays import Array, ByType, is_jax, repeat_while, xp

Vector = Sequence[Array] | Array
"""Three components, as one array or as three separate values."""

_UNROLLED_STEPS = 3
"""Newton steps that every point takes before convergence is tested. From 20 mm inside a thorax to 60 mm outside, the
remaining error is below 1e-6 mm and most often 0; points with a larger error, such as those deeper inside, continue in
a loop."""

_LAST_STEP = ByType(1e-8, 1e-4)
"""|S - 1| below which one more Newton step, converging quadratically, is exact to rounding."""

_MAX_STEPS = 60
"""Limit of Newton steps. Deep inside, near the plane of the shortest axis, some 25 are needed; the rest is margin."""

_OFF_PLANE = 1e-13
"""Shift off a symmetry plane, as a share of the axis, of a point that is exactly on the plane: deep inside, two points
of the surface are equally near, and the shift selects the one on the positive side. It changes a distance by < 1e-10
mm."""


def signed_distance_mm(
    point_mm: Float[Array, " 3 *batch"],
    centre_mm: Float[Array, " 3 *#batch"],
    semi_axes_mm: Float[Array, " 3 *#batch"],
) -> Float[Array, " *batch"]:
    """Compute the distance of a point from the ellipsoid in mm, positive outside (thesis Eq. 6.2, A1 and A2)."""
    point = point_mm - centre_mm
    point, axes = xp.broadcast_arrays(point, semi_axes_mm)
    return _signed_distance(point, axes) if is_jax([point, axes]) else _from_surface(point, axes)


def distance_and_normal(
    point_mm: Float[Array, " 3 *batch"],
    centre_mm: Float[Array, " 3 *#batch"],
    semi_axes_mm: Float[Array, " 3 *#batch"],
) -> tuple[Float[Array, " *batch"], Float[Array, " 3 *batch"]]:
    """Compute :func:`signed_distance_mm` and its gradient with respect to the point: the outward normal at the closest
    point."""
    p, a = xp.broadcast_arrays(point_mm - centre_mm, semi_axes_mm)
    x = closest_point(p, a)
    n = _outward_normal(x, a)
    return ((p - x) * n).sum(axis=0), n


def _from_surface(p: Float[Array, " 3 *batch"], a: Float[Array, " 3 *batch"]) -> Float[Array, " *batch"]:
    x = closest_point(p, a)
    return ((p - x) * _outward_normal(x, a)).sum(axis=0)


_signed_distance = jax.custom_jvp(_from_surface)


@_signed_distance.defjvp
def _signed_distance_jvp(primals, tangents):
    """Compute dd = n . (dp - dx): the closest point moves by dx_i = (x_i / a_i) da_i with the axes; its sliding along
    the surface is normal to n."""
    (p, a), (dp, da) = primals, tangents
    x = closest_point(p, a)
    n = _outward_normal(x, a)
    return jnp.sum((p - x) * n, axis=0), jnp.sum(n * (dp - x / a * da), axis=0)


def closest_point(p: Float[Array, " 3 *batch"], a: Float[Array, " 3 *batch"]) -> Float[Array, " 3 *batch"]:
    """Compute the point of the surface nearest to p, both relative to the centre and along the axes, in mm."""
    p = p + xp.where(p < 0.0, -_OFF_PLANE, _OFF_PLANE) * a
    root = _secular_root if is_jax([p, a]) else _largest_root
    return a * a * p / (root(p, a)[None] + _beyond_shortest(a))


def closest_point_multiplier(p: Vector, a: Vector) -> Array:
    """Compute t of p - x = t (x_i / a_i^2), mm^2, with x the closest point; p and a are given by component."""
    off_plane = [
        xp.where(abs(x) > _OFF_PLANE * y, x, xp.where(x < 0.0, -_OFF_PLANE * y, _OFF_PLANE * y))
        for x, y in zip(p, a, strict=True)
    ]
    axes = _Components(a)
    return _largest_root(_Components(off_plane), axes) - axes.min(axis=0) ** 2


class _Components:
    """Three components that behave like an array of length 3, for a compiler whose values have no axes. Except in a
    division of another value by them, they must be the left operand."""

    def __init__(self, components: Vector):
        self.x, self.y, self.z = components

    def _each(self, operation: Callable[[Array, Array], Array], other: Any) -> "_Components":
        others = (other.x, other.y, other.z) if isinstance(other, _Components) else (other,) * 3
        return _Components([operation(*pair) for pair in zip((self.x, self.y, self.z), others, strict=True)])

    def __abs__(self):
        return _Components([abs(self.x), abs(self.y), abs(self.z)])

    def __add__(self, other):
        return self._each(add, other)

    def __sub__(self, other):
        return self._each(sub, other)

    def __mul__(self, other):
        return self._each(mul, other)

    def __rtruediv__(self, other):
        return self._each(lambda x, other: other / x, other)

    def __pow__(self, other):
        return self._each(pow, other)

    def sum(self, axis: int) -> Array:
        return self.x + self.y + self.z

    def min(self, axis: int) -> Array:
        return xp.minimum(xp.minimum(self.x, self.y), self.z)

    def max(self, axis: int) -> Array:
        return xp.maximum(xp.maximum(self.x, self.y), self.z)


def _beyond_shortest(a: Array) -> Array:
    """Compute a_i^2 - min a^2 as a product, so that the shortest axis gives exactly 0 even with fused operations."""
    shortest = a.min(axis=0)
    return (a - shortest) * (a + shortest)


def _outward_normal(x: Float[Array, " 3 *batch"], a: Float[Array, " 3 *batch"]) -> Float[Array, " 3 *batch"]:
    gradient = x / (a * a)
    return gradient / xp.sqrt((gradient * gradient).sum(axis=0))[None]


def _secular(tau, p: Array, a: Array) -> tuple[Array, Array]:
    """Compute S and -dS/dtau / 2 at tau = t + min a^2."""
    inverse = 1.0 / (_beyond_shortest(a) + tau)
    terms = (a * p * inverse) ** 2
    return terms.sum(axis=0), (terms * inverse).sum(axis=0)


def _largest_root(p: Array, a: Array) -> Array:
    def newton(tau):
        S, half_slope = _secular(tau, p, a)
        return tau + (xp.sqrt(S) - 1.0) * S / half_slope, S

    # At `below` a single term of S is already 1, so the root is not below it; from there Newton never passes the root.
    below = (a * abs(p) - _beyond_shortest(a)).max(axis=0)
    tau = xp.maximum(below, newton(a.min(axis=0) ** 2)[0])  # tau = min a^2 is t = 0: p on the surface
    for _ in range(_UNROLLED_STEPS - 1):
        tau, _ = newton(tau)

    def unfinished(carry):
        step, _, S = carry
        return (step < _MAX_STEPS) & xp.any(abs(S - 1.0) > _LAST_STEP.for_dtype_of(S))

    def again(carry):
        step, tau, _ = carry
        return (step + 1, *newton(tau))

    tau, S = newton(tau)
    return repeat_while(unfinished, again, (0, tau, S))[1]


_secular_root = jax.custom_jvp(_largest_root)


@_secular_root.defjvp
def _secular_root_jvp(primals, tangents):
    """Apply the implicit function theorem to S(tau, p, a) = 1. The formula contains tau itself, so that JAX can derive
    higher derivatives."""
    tau = _secular_root(*primals)
    _, dS = jax.jvp(lambda p, a: _secular(tau, p, a)[0], primals, tangents)
    return tau, dS / (2.0 * _secular(tau, *primals)[1])
