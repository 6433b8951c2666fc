"""Frames of the bones from bony landmarks, and angles of humerus and thorax (thesis, Appendix A). Right shoulder.

Positions are ``(3, *batch)`` in any right-handed frame and any unit. A frame is a matrix ``(3, 3, *batch)`` with the x,
y and z axes as columns. NaN in a landmark gives NaN in the result.
"""

import numpy as np
from jaxtyping import Float

from motions.rotations import compose, rotation_from_cardan

Points = Float[np.ndarray, " 3 *batch"]
Rotations = Float[np.ndarray, " 3 3 *batch"]


def thorax_frame(IJ: Points, PX: Points, C7: Points, T8: Points) -> Rotations:
    """Compute R_lab_thorax, the frame of the thorax, with origin IJ.

    y points from halfway PX-T8 to halfway IJ-C7, x to the right, normal to the plane of IJ, C7 and halfway PX-T8, and
    z = x cross y backward.
    """
    y = unit((IJ + C7) / 2.0 - (PX + T8) / 2.0)
    x = unit(cross(y, C7 - IJ))
    return frame(x, y)


def clavicle_frame(SC: Points, AC: Points, y_thorax: Points) -> Rotations:
    """Compute the frame of the clavicle without axial rotation.

    x points from SC to AC, z backward, normal to x and the thorax's y.
    Two landmarks do not determine the axial rotation (Appendix A, note 1).
    """
    x = unit(AC - SC)
    z = unit(cross(x, y_thorax))
    return frame(x, cross(z, x))


def scapula_frame(acromion: Points, TS: Points, AI: Points) -> Rotations:
    """Compute the frame of the scapula: x from TS to the acromial landmark, z backward, normal to x and AI-acromion.

    ``acromion``: AC in the thesis, AA in ISB's recommendation (Wu 2005); these two frames are some 18 degrees apart.
    """
    x = unit(acromion - TS)
    z = unit(cross(AI - acromion, x))
    return frame(x, cross(z, x))


def humerus_frame(GH: Points, EM: Points, EL: Points) -> Rotations:
    """Compute the frame of the humerus: y from halfway EM-EL to GH, z backward, normal to y and EM-EL."""
    y = unit(GH - (EM + EL) / 2.0)
    z = unit(cross(EL - EM, y))
    return frame(cross(y, z), y)


def humerus_angles(R_thorax_humerus: Rotations) -> Points:
    """Compute plane of elevation, elevation and axial rotation (p, e, q) of the humerus, radians.

    R = Ry(p) Rz(e) Ry(q), 0 <= e <= pi.
    p = 0 is abduction, p = pi/2 forward flexion. With the arm hanging (e = 0), only p + q is determined.
    """
    R = R_thorax_humerus
    return np.stack(
        [
            np.arctan2(R[2, 1], -R[0, 1]),
            np.arctan2(np.hypot(R[0, 1], R[2, 1]), R[1, 1]),
            np.arctan2(R[1, 2], R[1, 0]),
        ]
    )


def thorax_angles(R_global_thorax: Rotations) -> Points:
    """Compute backward tilt, torsion and lateral flexion (x, y, z) of the thorax, radians (Appendix A).

    R = Rx(x) Ry(y) Rz(z) in the global frame (x right, y up, z backward), -pi/2 <= y <= pi/2. x > 0 is backward,
    y > 0 and z > 0 are to the left.
    """
    R = R_global_thorax
    return np.stack(
        [
            np.arctan2(-R[1, 2], R[2, 2]),
            np.arctan2(R[0, 2], np.hypot(R[0, 0], R[0, 1])),
            np.arctan2(-R[0, 1], R[0, 0]),
        ]
    )


def humerus_rotation(angles: Points) -> Rotations:
    """Compute R_thorax_humerus = Ry(p) Rz(e) Ry(q), the inverse of :func:`humerus_angles`; angles in radians."""
    p, e, q = angles
    zero = np.zeros_like(e)
    first, second = rotation_from_cardan(np.stack([p, e, zero])), rotation_from_cardan(np.stack([q, zero, zero]))
    return compose(first, second)


def frame(x: Points, y: Points) -> Rotations:
    """Build the right-handed frame with these orthogonal unit axes."""
    return np.stack([x, y, cross(x, y)], axis=1)


def cross(a: Points, b: Points) -> Points:
    """Compute a x b along the first axis."""
    return np.cross(a, b, axis=0)


def unit(v: Points) -> Points:
    """Compute v / |v|; NaN where v is 0, because the two landmarks of an axis coincide."""
    length = np.sqrt(np.sum(v * v, axis=0))
    return v / np.where(length > 0.0, length, np.nan)


def transposed(R: Rotations) -> Rotations:
    """Transpose R_a_b to R_b_a."""
    return np.swapaxes(R, 0, 1)
