"""Conversion between ISB's angles of clavicle and scapula (Wu et al., J. Biomech. 38 (2005) 981-992) and the thesis's.

ISB: R = Ry(alpha) Rx(beta) Rz(gamma), x forward, y up, z right. Thesis: R = Ry(a) Rz(b) Rx(c), x right, y up, z
backward. The axes differ in name only, (x, y, z)_thesis = (z, y, -x)_ISB, so the sequences are the same too:

    (a, b, c) = (alpha, -beta, gamma).

The conversion changes names of axes only. ISB's scapula frame goes through AA, the thesis's through AC:
``motions.landmarks.acromion`` converts between them.
"""

import numpy as np
from jaxtyping import Float

ISB_ANGLES = tuple(f"{bone}_{angle}" for bone in ("clavicle", "scapula") for angle in ("alpha", "beta", "gamma"))
"""ISB's names, in the order of ANGLES: alpha is about y, beta about ISB's x, gamma about ISB's z."""

_SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])


def thesis_from_isb(isb: Float[np.ndarray, "*postures 6"]) -> Float[np.ndarray, "*postures 6"]:
    """Convert ISB_ANGLES to the six ANGLES, in the same unit."""
    return isb * _SIGNS


def isb_from_thesis(angles: Float[np.ndarray, "*postures 6"]) -> Float[np.ndarray, "*postures 6"]:
    """Convert the six ANGLES to ISB_ANGLES, in the same unit."""
    return angles * _SIGNS
