"""Shortest path round a sphere or an infinite cylinder, in closed form: straight, round, straight.

Let a be the unit vector along the axis of a cylinder, or 0 for a sphere, and p and q points relative to the centre (or
to any point of the axis). Then u = p - (p . a) a and v = q - (q . a) a lie in the plane of the cross-section, and the
length of the path in this plane is

    t_p + r s + t_q,   t_p = (|u|^2 - r^2)^(1/2),   s = angle(u, v) - atan(t_p / r) - atan(t_q / r) > 0;

where s <= 0 the path is straight, of length |u - v|. The surface of a cylinder unrolls to a plane, so
L^2 = l^2 + ((q - p) . a)^2, with l the length in the cross-section. A point inside is replaced by the closest point of
the surface. The path is the shorter one of the two ways round.

DAS3 wraps the muscles of the humerus on such shapes (thesis 3.2.4: a ball for its head, a cylinder for its shaft). In
DAS3 cylinders have ends, and two of them keep the muscle on one side; here they have no ends and no side.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from motions.arrays import Array

Points = Float[Array, " 3 *batch"]
Lengths = Float[Array, " *batch"]


class Section(NamedTuple):
    """Path in the cross-section: straight from p, along the circle, straight to q."""

    before: Lengths
    """Length t_p of the first straight part, mm."""
    first: Lengths
    """Angle between u and the point where the path reaches the circle, rad."""
    arc: Lengths
    """Angle s, rad; 0 or less without contact."""
    after: Lengths
    """Length t_q of the last straight part, mm."""
    apart: Lengths
    """Distance |u - v|, mm."""


def round_length_mm(p_mm: Points, q_mm: Points, axis: Points, radius_mm: Lengths) -> Lengths:
    """Compute the length of the path from p to q; twice differentiable except at lift-off. ``axis``: 0 for a sphere."""
    u, v, along = _in_section(p_mm, q_mm, axis, radius_mm)
    return jnp.sqrt(_length(_section(u, v, radius_mm), radius_mm) ** 2 + along**2)


def round_contact_mm(p_mm: Points, q_mm: Points, axis: Points, radius_mm: Lengths) -> Lengths:
    """Compute the length of the path on the surface; 0 without contact."""
    u, v, _ = _in_section(p_mm, q_mm, axis, radius_mm)
    section = _section(u, v, radius_mm)
    share = radius_mm * jnp.maximum(section.arc, 0.0) / _length(section, radius_mm)
    return share * round_length_mm(p_mm, q_mm, axis, radius_mm)


def round_depth_mm(p_mm: Points, axis: Points, radius_mm: Lengths) -> Lengths:
    """Compute the depth of a point below the surface; 0 outside."""
    return jnp.maximum(radius_mm - _norm(_across(p_mm, axis)), 0.0)


def round_points_mm(
    p_mm: Points, q_mm: Points, axis: Points, radius_mm: Lengths, count: int
) -> Float[Array, " points 3 *batch"]:
    """Return p, ``count`` points evenly along the contact (or the straight line) and q; p and q are moved outside."""
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
    """Compute u and v, moved outside, and the distance from p to q along the axis."""
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
    """Compute (|u|^2 - r^2)^(1/2), with derivative 0 on the surface."""
    squared = jnp.sum(u * u, axis=0) - radius**2
    off = squared > _ON_SURFACE * radius**2
    return jnp.where(off, jnp.sqrt(jnp.where(off, squared, 1.0)), 0.0)


_ON_SURFACE = 1e-12
"""Share of r^2 within which a point counts as on the surface: rounding errors are 1e-15, and the path gets at most 1e-6
r shorter."""


def _norm(v) -> Lengths:
    """Compute |v|, with derivative 0 at 0."""
    squared = jnp.sum(v * v, axis=0)
    off = squared > 0.0
    return jnp.where(off, jnp.sqrt(jnp.where(off, squared, 1.0)), 0.0)


def _unit(v) -> Points:
    size = _norm(v)
    return v / jnp.where(size > 0.0, size, 1.0)
