"""Rotations of the bones: Cardan angles Y-Z'-X'' (thesis, Appendix A).

Arrays have the *component axis first and the batch axes last*: a vector is ``(3, *batch)``, a matrix
``(3, 3, *batch)``. Every function is elementwise over the batch, so the same code serves one posture and a million
postures.
"""

import numpy as np
from jaxtyping import Float

from motions.arrays import Array, xp

DEG = 180.0 / np.pi
"""Degrees in one radian. Files and tables are in degrees, internal values in radians."""


def rotation_from_cardan(angles: Float[Array, " 3 *batch"]) -> Float[Array, " 3 3 *batch"]:
    """Compute R = Ry(a) Rz(b) Rx(c), bone to thorax, from angles (a, b, c) in radians (thesis, Appendix A).

    a > 0 is protraction, b > 0 elevation or lateral rotation, c > 0 backward axial rotation or backward tipping.
    """
    (ca, cb, cc), (sa, sb, sc) = xp.cos(angles), xp.sin(angles)
    return xp.stack(
        [
            xp.stack([ca * cb, sa * sc - ca * sb * cc, sa * cc + ca * sb * sc]),
            xp.stack([sb, cb * cc, -cb * sc]),
            xp.stack([-sa * cb, ca * sc + sa * sb * cc, ca * cc - sa * sb * sc]),
        ]
    )


def cardan_from_rotation(R: Float[Array, " 3 3 *batch"]) -> Float[Array, " 3 *batch"]:
    """Compute the angles (a, b, c) in radians of R = Ry(a) Rz(b) Rx(c), with |b| <= pi/2.

    At |b| = pi/2 only a + c or a - c is determined (gimbal lock); no measured clavicle or scapula comes near this.
    """
    return xp.stack([cardan_angle(R, number) for number in range(3)])


def cardan_angle(R: Float[Array, " 3 3 *batch"], number: int) -> Float[Array, " *batch"]:
    """Compute one of the three angles of :func:`cardan_from_rotation`: a, b or c, radians."""
    if number == 1:
        return xp.arctan2(R[1, 0], xp.hypot(R[0, 0], R[2, 0]))
    return xp.arctan2(-R[2, 0], R[0, 0]) if number == 0 else xp.arctan2(-R[1, 2], R[1, 1])


def rotate(R: Float[Array, " 3 3 *batch"], v: Float[Array, " 3 *#batch"]) -> Float[Array, " 3 *batch"]:
    """Compute R v, elementwise over the batch: no matrix-library call for each 3 x 3 matrix."""
    v = v.reshape(1, *v.shape, *[1] * (R.ndim - 1 - v.ndim))
    return (R * v).sum(axis=1)


def compose(R_a_b: Float[Array, " 3 3 *batch"], R_b_c: Float[Array, " 3 3 *#batch"]) -> Float[Array, " 3 3 *batch"]:
    """Compute R_a_c = R_a_b R_b_c, elementwise over the batch."""
    return (R_a_b[:, :, None] * R_b_c[None]).sum(axis=1)


def rotation_from_vector(v: Float[Array, " 3 *batch"]) -> Float[Array, " 3 3 *batch"]:
    """Compute exp([v]x), the rotation by |v| radians about v (Rodrigues), smooth at v = 0."""
    squared = xp.sum(v * v, axis=0)
    small = squared < _SMALL_ANGLE_SQUARED
    safe = xp.where(small, 1.0, squared)
    angle = xp.sqrt(safe)
    sinc = xp.where(small, 1.0 - squared / 6.0 + squared**2 / 120.0, xp.sin(angle) / angle)
    versinc = xp.where(small, 0.5 - squared / 24.0 + squared**2 / 720.0, (1.0 - xp.cos(angle)) / safe)
    outer = v[:, None] * v[None, :]
    identity = np.eye(3).reshape(3, 3, *[1] * squared.ndim)
    return identity * (1.0 - versinc * squared) + sinc * cross_matrix(v) + versinc * outer


def cross_matrix(v: Float[Array, " 3 *batch"]) -> Float[Array, " 3 3 *batch"]:
    """Compute [v]x, the matrix of the cross product v x u."""
    x, y, z = v
    zero = xp.zeros_like(x)
    return xp.stack([xp.stack([zero, -z, y]), xp.stack([z, zero, -x]), xp.stack([-y, x, zero])])


def rotation_about(axis: Float[Array, " 3 *batch"], angle: Float[Array, " *batch"]) -> Float[Array, " 3 3 *batch"]:
    """Compute the rotation by an angle in radians about a unit vector (Rodrigues)."""
    outer = axis[:, None] * axis[None, :]
    identity = np.eye(3).reshape(3, 3, *[1] * angle.ndim)
    return outer + (identity - outer) * xp.cos(angle) + cross_matrix(axis * xp.sin(angle)[None])


def rotation_between(one: Float[Array, " 3 *batch"], other: Float[Array, " 3 *batch"]) -> Float[Array, " 3 3 *batch"]:
    """Compute the smallest rotation that turns one unit vector into another; undefined for opposite vectors.

    R = I + [v]x + [v]x^2 / (1 + c), with v = one x other and c = one . other.
    """
    v, c = xp.cross(one, other, axis=0), xp.sum(one * other, axis=0)
    identity = np.eye(3).reshape(3, 3, *[1] * c.ndim)
    return identity * c + cross_matrix(v) + v[:, None] * v[None, :] / (1.0 + c)


def vector_from_rotation(R: Float[Array, " 3 3 *batch"]) -> Float[Array, " 3 *batch"]:
    """Compute log R: the axis times the angle in radians, 0 for no rotation. At half a turn the axis is not unique."""
    axis = 0.5 * xp.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = xp.sqrt(xp.sum(axis * axis, axis=0))
    return axis * xp.where(sine > 0.0, mean_angle(R) / xp.where(sine > 0.0, sine, 1.0), 1.0)


_SMALL_ANGLE_SQUARED = 1e-3
"""Squared angle (rad^2) below which a series to the 4th power is used: exact to 1e-12, finite derivatives."""


def mean_angle(R: Float[Array, " 3 3 *batch"]) -> Float[Array, " *batch"]:
    """Compute the angle of the rotation R in radians, in [0, pi], accurate near 0 and near pi."""
    axis = xp.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine2 = xp.sqrt(xp.sum(axis * axis, axis=0))
    cosine2 = R[0, 0] + R[1, 1] + R[2, 2] - 1.0
    return xp.arctan2(sine2, cosine2)
