"""Shortest path round a sphere or an infinite cylinder, in closed form: straight, round, straight.

With a unit vector a along the axis of a cylinder, or a = 0 of a sphere, and points p and q from the centre (or from any
point of the axis), u = p - (p . a) a and v = q - (q . a) a lie in the plane of the section, and the path in it is

    t_p + r s + t_q,   t_p = (|u|^2 - r^2)^(1/2),   s = angle(u, v) - atan(t_p / r) - atan(t_q / r) > 0;

where s <= 0 the line is straight, |u - v|. Unrolled, a cylinder is flat: L^2 = l^2 + ((q - p) . a)^2, with l the length
in the section. A point inside counts as its closest point of the surface. Of the two ways round, it is the shorter one.

DAS3 wraps the muscles of the humerus on such shapes (thesis 3.2.4: a ball for its head, a cylinder for its shaft). Its
cylinders have ends, and two of them a side that they keep to; here they have neither.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from motions.arrays import Array

Points = Float[Array, " 3 *batch"]
Lengths = Float[Array, " *batch"]


class Section(NamedTuple):
    """The path in the section: from p, on the circle, to q."""

    before: Lengths
    """t_p, mm."""
    first: Lengths
    """Angle from u at which the path reaches the circle, rad."""
    arc: Lengths
    """s; not above 0 where there is no contact."""
    after: Lengths
    """t_q, mm."""
    apart: Lengths
    """|u - v|, mm."""


def round_length_mm(p_mm: Points, q_mm: Points, axis: Points, radius_mm: Lengths) -> Lengths:
    """Measure the path from p to q; differentiable twice but where it lifts off. ``axis``: 0 of a sphere."""
    u, v, along = _in_section(p_mm, q_mm, axis, radius_mm)
    return jnp.sqrt(_length(_section(u, v, radius_mm), radius_mm) ** 2 + along**2)


def round_contact_mm(p_mm: Points, q_mm: Points, axis: Points, radius_mm: Lengths) -> Lengths:
    """Measure how much of the path lies on the surface; 0 without contact."""
    u, v, _ = _in_section(p_mm, q_mm, axis, radius_mm)
    section = _section(u, v, radius_mm)
    share = radius_mm * jnp.maximum(section.arc, 0.0) / _length(section, radius_mm)
    return share * round_length_mm(p_mm, q_mm, axis, radius_mm)


def round_depth_mm(p_mm: Points, axis: Points, radius_mm: Lengths) -> Lengths:
    """Measure how deep a point lies in the surface, 0 outside."""
    return jnp.maximum(radius_mm - _norm(_across(p_mm, axis)), 0.0)


def round_points_mm(
    p_mm: Points, q_mm: Points, axis: Points, radius_mm: Lengths, count: int
) -> Float[Array, " points 3 *batch"]:
    """Return p, ``count`` points evenly along the contact (or along the straight line) and q, both outside."""
    u, v, along = _in_section(p_mm, q_mm, axis, radius_mm)
    p_mm, q_mm = (w + jnp.sum(x * axis, axis=0) * axis for w, x in ((u, p_mm), (v, q_mm)))
    section = _section(u, v, radius_mm)
    share = jnp.linspace(0.0, 1.0, count).reshape(-1, *[1] * section.arc.ndim)
    angle = section.first + share * jnp.maximum(section.arc, 0.0)
    e1 = u / _norm(u)
    e2 = _unit(v - jnp.sum(v * e1, axis=0) * e1)
    gone = section.before + radius_mm * (angle - section.first)
    level = jnp.sum(p_mm * axis, axis=0) + along * gone / _length(section, radius_mm)
    curved = radius_mm * (jnp.cos(angle)[:, None] * e1 + jnp.sin(angle)[:, None] * e2) + level[:, None] * axis
    straight = p_mm + jnp.linspace(0.0, 1.0, count + 2)[1:-1].reshape(-1, *[1] * p_mm.ndim) * (q_mm - p_mm)
    return jnp.concatenate([p_mm[None], jnp.where(section.arc > 0.0, curved, straight), q_mm[None]])


def _in_section(p, q, axis, radius) -> tuple[Points, Points, Lengths]:
    """u and v, outside, and how far q lies from p along the axis."""
    return _outside(_across(p, axis), radius), _outside(_across(q, axis), radius), jnp.sum((q - p) * axis, axis=0)


def _across(p, axis) -> Points:
    return p - jnp.sum(p * axis, axis=0) * axis


def _outside(u, radius) -> Points:
    size = _norm(u)
    inside = size < radius
    return jnp.where(inside, u * (radius / jnp.where(size > 0.0, size, 1.0)), u)


def _section(u, v, radius) -> Section:
    before, after = _tangent(u, radius), _tangent(v, radius)
    angle = jnp.arctan2(_norm(jnp.cross(u, v, axis=0)), jnp.sum(u * v, axis=0))
    first = jnp.arctan2(before, radius)
    return Section(before, first, angle - first - jnp.arctan2(after, radius), after, _norm(u - v))


def _length(section: Section, radius) -> Lengths:
    return jnp.where(section.arc > 0.0, section.before + radius * section.arc + section.after, section.apart)


def _tangent(u, radius) -> Lengths:
    """(|u|^2 - r^2)^(1/2), with slope 0 on the surface."""
    squared = jnp.sum(u * u, axis=0) - radius**2
    off = squared > _ON_SURFACE * radius**2
    return jnp.where(off, jnp.sqrt(jnp.where(off, squared, 1.0)), 0.0)


_ON_SURFACE = 1e-12
"""Share of r^2 within which a point is on the surface: rounding leaves 1e-15, and the path 1e-6 r at most shorter."""


def _norm(v) -> Lengths:
    """|v|, with slope 0 at 0."""
    squared = jnp.sum(v * v, axis=0)
    off = squared > 0.0
    return jnp.where(off, jnp.sqrt(jnp.where(off, squared, 1.0)), 0.0)


def _unit(v) -> Points:
    size = _norm(v)
    return v / jnp.where(size > 0.0, size, 1.0)
