"""Rotations as 3 x 3 matrices, Cardan angles and vectors: stacks (n, 3, 3) and (n, 3), rad."""

import numpy as np

from scripts.research.named_causes.synthetic_a.conventions import Array


def rotation_from_cardan(q: Array) -> Array:
    """Compute Ry(q0) Rz(q1) Rx(q2), (n, 3, 3), from angles (n, 3) in rad."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(q).T, np.cos(q).T
    rows = (
        (ca * cb, sa * sc - ca * sb * cc, ca * sb * sc + sa * cc),
        (sb, cb * cc, -cb * sc),
        (-sa * cb, sa * sb * cc + ca * sc, ca * cc - sa * sb * sc),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def cardan_from_rotation(R: Array) -> Array:
    """Compute the angles (n, 3) in rad of R = Ry Rz Rx, the middle one within +-pi/2."""
    a = np.arctan2(-R[:, 2, 0], R[:, 0, 0])
    b = np.arcsin(np.clip(R[:, 1, 0], -1.0, 1.0))
    return np.stack([a, b, np.arctan2(-R[:, 1, 2], R[:, 1, 1])], -1)


def cardan_axes(q: Array, R: Array) -> Array:
    """Compute the axes (n, 3 axes, 3), in the thorax frame, about which the three angles turn a bone."""
    zero = np.zeros(len(q))
    first = np.stack([zero, zero + 1.0, zero], -1)
    second = np.stack([np.sin(q[:, 0]), zero, np.cos(q[:, 0])], -1)
    return np.stack([first, second, R[:, :, 0]], 1)


def rotation_from_vector(v: Array) -> Array:
    """Compute the rotation (n, 3, 3) about v (n, 3) by |v| rad (Rodrigues)."""
    angle = np.linalg.norm(v, axis=-1)[:, None, None]
    x, y, z = v.T
    o = np.zeros(len(v))
    K = np.stack([np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], -2)
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / 2.0 / np.pi) ** 2 * (K @ K)


def vector_from_rotation(R: Array) -> Array:
    """Compute the rotation vector (n, 3) in rad of R (n, 3, 3), for angles well below pi."""
    skew = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], -1)
    angle = np.arctan2(np.linalg.norm(skew, axis=-1), 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    return skew / np.sinc(angle / np.pi)[:, None]


def apply(R: Array, v: Array) -> Array:
    """Compute R v, row by row."""
    return np.einsum("nij,nj->ni", R, v)
