"""Conversion of the scapula frame through AA (ISB; Wu 2005) to the thesis's frame through AC, by a mean rotation.

Both frames are fixed in the bone, so R_thorax_AC = R_thorax_AA R_AA_AC with one R_AA_AC per scapula. If AC of this
scapula was not measured, the mean R_AA_AC of other scapulae replaces its own. The error is a constant rotation in every
posture of the subject, which the diagnosis calls ``scapula_landmark_bias``. Output always states the mean rotation.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.landmarks.frames import scapula_frame
from motions.rotations import DEG, cardan_from_rotation, compose, rotation_from_cardan


@dataclass(frozen=True)
class AcromionRotation:
    """Mean rotation between the two frames of a scapula."""

    R_ac_aa: Float[np.ndarray, "3 3"]
    """Axes of the AA frame in the AC frame, both with the thesis's axes (x lateral, y up, z backward)."""
    uncertainty_deg: float
    """SD of one person's rotation about the mean, about each axis."""
    source: str


POSITION_SD_MM = 10.0
"""SD of AC estimated from AA: 4 degrees at 120 mm are 8 mm, and the distance from TS is assumed known to 5 mm."""

# The matrix is printed in ISB's axes (x forward, y up, z right); this permutes rows and columns to (z, y, -x).
_THESIS_FROM_ISB = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
_KOLZ_PRINTED = np.array(
    [
        [0.964732483180704, 0.0100557410449752, -0.263040145164248],
        [-0.0568391733041278, 0.983654375192805, -0.170860699232318],
        [0.257022458695919, 0.17978585104532, 0.949534887979275],
    ]
)


def nearest_rotation(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Compute the rotation nearest to a matrix U S V': U diag(1, 1, +-1) V', where the sign excludes a reflection."""
    U, _, Vt = np.linalg.svd(matrix)
    return U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt


KOLZ = AcromionRotation(
    # Anatomy decides whether the printed matrix or its transpose is R_ac_aa: AA lies behind and below AC, so the x-axis
    # of the AA frame points more backward (+z) and down (-y) in the AC frame; the transpose would put AA in front.
    # The angles agree: AA gives less protraction, less lateral rotation and more backward tipping (Ludewig et al.,
    # Clin. Biomech. 25 (2010) 415-421: 11.6 deg less internal rotation; at full elevation 12.4 deg less upward rotation
    # and 6.1 deg more posterior tilt).
    # The mean of rotation matrices is not exactly a rotation.
    R_ac_aa=nearest_rotation(_THESIS_FROM_ISB @ _KOLZ_PRINTED @ _THESIS_FROM_ISB.T),
    uncertainty_deg=4.0,
    source="Kolz et al., Gait Posture 81 (2020) 183-190; uncertainty assumed, as Ludewig 2010's means are 2-4 deg off",
)

ROTATIONS = {"kolz2020": KOLZ}
"""Mean rotations by the name that --aa-to-ac takes."""


def ac_position_from_aa(
    AA: Float[np.ndarray, "3 postures"],
    TS: Float[np.ndarray, "3 postures"],
    AI: Float[np.ndarray, "3 postures"],
    rotation: AcromionRotation,
) -> Float[np.ndarray, "3 postures"]:
    """Place AC on the x-axis of the AC frame, as far from TS as AA is: AC = TS + |AA - TS| R_thorax_AA R_AA_AC e_x.

    The equal distance of AC and AA from TS is an assumption. ``POSITION_SD_MM`` is the SD of AC, including the
    uncertainty of the rotation.
    """
    R_thorax_aa = scapula_frame(AA, TS, AI)
    x_ac = np.einsum("ijn,j->in", R_thorax_aa, rotation.R_ac_aa.T[:, 0])
    return TS + np.linalg.norm(AA - TS, axis=0) * x_ac


def ac_from_aa_deg(
    scapula_aa_deg: Float[np.ndarray, "postures 3"], rotation: AcromionRotation
) -> Float[np.ndarray, "postures 3"]:
    """Convert Cardan angles of the AA frame to angles of the AC frame, R_thorax_AC = R_thorax_AA R_AC_AA', degrees."""
    R_thorax_aa = rotation_from_cardan(scapula_aa_deg.T / DEG)
    return cardan_from_rotation(compose(R_thorax_aa, rotation.R_ac_aa.T[:, :, None])).T * float(DEG)
