"""Scapulo-humeral rhythm of de Groot & Brand, and the axial rotation of the clavicle that goes with it.

J.H. de Groot, R. Brand, "A three-dimensional regression model of the shoulder rhythm", Clinical Biomechanics 16 (2001)
735-743.
"""

import numpy as np
from jaxtyping import Float

from motions.arrays import Array, xp
from motions.rotations import DEG, compose, rotation_from_cardan
from motions.table import ANGLES

PREDICTED = ("clavicle_y", "clavicle_z", "scapula_y", "scapula_z", "scapula_x")
"""Angles that the regression predicts; the axial rotation of the clavicle cannot be palpated."""

COEFFICIENTS: Float[np.ndarray, "5 4"] = np.array(
    [
        [-4.983, 0.120, -0.242, 0.851],
        [3.917, -0.046, 0.123, 0.493],
        [-1.203, 0.140, -0.049, 0.901],
        [3.095, -0.079, 0.396, 0.414],
        [0.659, -0.028, 0.184, 0.886],
    ]
)
"""Coefficients (de Groot & Brand 2001), one row per angle of PREDICTED: the constant in degrees, and the factors of the
plane of elevation of the humerus, of the elevation of the humerus, and of the same angle at rest."""

REST_DEG: Float[np.ndarray, "6"] = np.array([-28.57, 11.68, 7.48, 32.05, 10.67, -10.32])
"""Mean ANGLES with the arm hanging, in degrees, published with the Delft shoulder model."""

_IN_ANGLES = [ANGLES.index(angle) for angle in PREDICTED]


def girdle_angles_deg(
    rest_deg: Float[np.ndarray, " 6 *batch"],
    plane_deg: Float[np.ndarray, " *batch"],
    elevation_deg: Float[np.ndarray, " *batch"],
    coefficients: Float[np.ndarray, " 5 4 *batch"],
) -> Float[np.ndarray, " 6 *batch"]:
    """Predict ANGLES in degrees of a girdle whose angles with the arm hanging are ``rest_deg``.

    For the five PREDICTED angles, angle = k0 + k1 plane + k2 elevation + k3 angle_rest (de Groot & Brand 2001). The
    axial rotation of the clavicle is the one that turns the SC and AC joints least from their posture at rest.

    - ``plane_deg``: plane of elevation of the humerus, 0 abduction, 90 forward flexion.
    - ``elevation_deg``: elevation of the humerus, 0 with the arm hanging.
    - ``coefficients``: COEFFICIENTS, or coefficients of individuals.
    """
    constant, by_plane, by_elevation, by_rest = np.moveaxis(coefficients, 1, 0)
    predicted = constant + by_plane * plane_deg + by_elevation * elevation_deg + by_rest * rest_deg[_IN_ANGLES]
    clavicle_deg, scapula_deg = predicted[:2], predicted[2:]
    R_thorax_clavicle_rest = rotation_from_cardan(rest_deg[:3] / DEG)
    R_thorax_scapula_rest = rotation_from_cardan(rest_deg[3:] / DEG)
    clavicle_x = clavicle_axial_rotation(
        clavicle_deg / DEG, scapula_deg / DEG, R_thorax_clavicle_rest, R_thorax_scapula_rest
    )
    return np.concatenate([clavicle_deg, clavicle_x[None] * DEG, scapula_deg])


def clavicle_axial_rotation(
    clavicle_yz: Float[Array, " 2 *batch"],
    scapula: Float[Array, " 3 *batch"],
    R_thorax_clavicle_rest: Float[Array, " 3 3 *batch"],
    R_thorax_scapula_rest: Float[Array, " 3 3 *batch"],
) -> Float[Array, " *batch"]:
    """Compute the third angle c of the clavicle that turns the SC and AC joints least from rest (thesis, section 6.3).

    A joint that turns from D0 to D turns by an angle t with tr(D0^T D) = 1 + 2 cos t. With R_C = R_yz Rx(c) and
    Q = R_clavicle_scapula_rest, the sum of the two traces, of the SC joint (D = R_C) and of the AC joint
    (D = R_C^T R_S), is tr(Rx(c) B), B = (R_C0^T + Q R_S^T) R_yz, that is p cos c + q sin c + B11 with p = B22 + B33
    and q = B23 - B32. The sum is largest, and the joints turn least, at c = atan2(q, p). Angles are in radians.

    Two landmarks do not determine the axial rotation, so it is estimated (Pronk; thesis Appendix A, note 1). With the
    published rhythm this gives 41 degrees at 120 degrees of abduction; bone pins show 25-36 (Ludewig 2009, Oki 2012).
    """
    R_yz = rotation_from_cardan(xp.concatenate([clavicle_yz, xp.zeros_like(clavicle_yz[:1])]))
    R_clavicle_thorax_rest = xp.swapaxes(R_thorax_clavicle_rest, 0, 1)
    R_clavicle_scapula_rest = compose(R_clavicle_thorax_rest, R_thorax_scapula_rest)
    R_scapula_thorax = xp.swapaxes(rotation_from_cardan(scapula), 0, 1)
    B = compose(R_clavicle_thorax_rest + compose(R_clavicle_scapula_rest, R_scapula_thorax), R_yz)
    return xp.arctan2(B[1, 2] - B[2, 1], B[1, 1] + B[2, 2])
