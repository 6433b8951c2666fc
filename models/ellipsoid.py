"""Signed Euclidean distance to the thorax ellipsoid, exact and differentiable everywhere it has a derivative.

The closest point x of the surface sum (x_i / a_i)^2 = 1 to a point p (both from the centre, along the axes) is
where the normal meets p:

    p - x = t n,   n_i = x_i / a_i^2   =>   x_i = a_i^2 p_i / (t + a_i^2),

with t the largest root of  S(t) = sum a_i^2 p_i^2 / (t + a_i^2)^2 = 1  (Eberly, "Distance from a point to an
ellipse, an ellipsoid, or a hyperellipsoid", 2013). With tau = t + min a^2 > 0 no denominator cancels, and
Newton on  1 - S^(-1/2),  nearly linear in tau, climbs monotonically to the root from below (the secular
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
"""Three components: an array of them, or each by itself."""

_UNROLLED_STEPS = 3
"""Newton steps every point takes. From 20 mm inside a thorax to 60 mm outside they leave less than 1e-6 mm, most often
nothing; what they leave, and points deeper inside, goes on in a loop."""

_LAST_STEP = ByType(1e-8, 1e-4)
"""|S - 1| from which one more Newton step, converging quadratically, is exact to rounding."""

_MAX_STEPS = 60
"""Deep inside, next to the plane of the shortest axis, some 25 steps are needed; the rest is margin."""

_OFF_PLANE = 1e-13
"""Share of an axis by which a point exactly on a symmetry plane is moved off it: there, deep inside, two points of
the surface are equally near and the closest one is taken on the positive side. Changes a distance by < 1e-10 mm."""


def signed_distance_mm(
    point_mm: Float[Array, " 3 *batch"],
    centre_mm: Float[Array, " 3 *#batch"],
    semi_axes_mm: Float[Array, " 3 *#batch"],
) -> Float[Array, " *batch"]:
    """Measure how far a point is from the ellipsoid's surface in mm, outside positive (thesis Eq. 6.2, A1 and A2)."""
    point = point_mm - centre_mm
    point, axes = xp.broadcast_arrays(point, semi_axes_mm)
    return _signed_distance(point, axes) if is_jax([point, axes]) else _from_surface(point, axes)


def distance_and_normal(
    point_mm: Float[Array, " 3 *batch"],
    centre_mm: Float[Array, " 3 *#batch"],
    semi_axes_mm: Float[Array, " 3 *#batch"],
) -> tuple[Float[Array, " *batch"], Float[Array, " 3 *batch"]]:
    """Measure :func:`signed_distance_mm`, and give the outward normal at the closest point, its slope in the point."""
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
    """d = n . (dp - dx|surface): the surface point moves by (x_i / a_i) da_i; sliding along it costs nothing."""
    (p, a), (dp, da) = primals, tangents
    x = closest_point(p, a)
    n = _outward_normal(x, a)
    return jnp.sum((p - x) * n, axis=0), jnp.sum(n * (dp - x / a * da), axis=0)


def closest_point(p: Float[Array, " 3 *batch"], a: Float[Array, " 3 *batch"]) -> Float[Array, " 3 *batch"]:
    """Find the point of the surface nearest to p, both relative to the centre and along the axes, in mm."""
    p = p + xp.where(p < 0.0, -_OFF_PLANE, _OFF_PLANE) * a
    root = _secular_root if is_jax([p, a]) else _largest_root
    return a * a * p / (root(p, a)[None] + _beyond_shortest(a))


def closest_point_multiplier(p: Vector, a: Vector) -> Array:
    """Find t of p - x = t (x_i / a_i^2), mm^2, x the closest point; p and a as their components."""
    off_plane = [
        xp.where(abs(x) > _OFF_PLANE * y, x, xp.where(x < 0.0, -_OFF_PLANE * y, _OFF_PLANE * y))
        for x, y in zip(p, a, strict=True)
    ]
    axes = _Components(a)
    return _largest_root(_Components(off_plane), axes) - axes.min(axis=0) ** 2


class _Components:
    """Three components that compute as an array of them does: for a compiler whose values have no axis. They stand on
    the left of an operation."""

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
    """a_i^2 - min a^2 as a product, which is exactly 0 for the shortest axis however the compiler fuses it."""
    shortest = a.min(axis=0)
    return (a - shortest) * (a + shortest)


def _outward_normal(x: Float[Array, " 3 *batch"], a: Float[Array, " 3 *batch"]) -> Float[Array, " 3 *batch"]:
    gradient = x / (a * a)
    return gradient / xp.sqrt((gradient * gradient).sum(axis=0))[None]


def _secular(tau, p: Array, a: Array) -> tuple[Array, Array]:
    """S and -dS/dtau / 2 at tau = t + min a^2."""
    inverse = 1.0 / (_beyond_shortest(a) + tau)
    terms = (a * p * inverse) ** 2
    return terms.sum(axis=0), (terms * inverse).sum(axis=0)


def _largest_root(p: Array, a: Array) -> Array:
    def newton(tau):
        S, half_slope = _secular(tau, p, a)
        return tau + (xp.sqrt(S) - 1.0) * S / half_slope, S

    # One term of S alone reaches 1 at `below`: the root lies to its right, and Newton from the left never passes it.
    below = (a * abs(p) - _beyond_shortest(a)).max(axis=0)
    tau = xp.maximum(below, newton(a.min(axis=0) ** 2)[0])  # tau = min a^2 is the surface itself
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
    """Implicit function theorem on S(tau, p, a) = 1; written in tau, so higher derivatives follow."""
    tau = _secular_root(*primals)
    _, dS = jax.jvp(lambda p, a: _secular(tau, p, a)[0], primals, tangents)
    return tau, dS / (2.0 * _secular(tau, *primals)[1])
