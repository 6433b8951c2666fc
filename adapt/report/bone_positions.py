"""Bone positions and constraint residuals of a parameter set at given angles."""

import numpy as np
from jaxtyping import Float

from models.girdle import Girdle, constraint_residuals_mm, landmarks
from motions.rotations import DEG

POINTS = ("AC", "TS", "AI", "clavicle_conoid", "scapula_conoid")
"""Moving landmarks, in the order of every array of points."""


def bones_mm(
    girdles: Girdle, angles_deg: Float[np.ndarray, "6 rows"]
) -> tuple[Float[np.ndarray, "5 3 rows"], Float[np.ndarray, "3 rows"]]:
    """Compute the positions of POINTS in the thorax frame and the constraint residuals A1-A3, all in mm.

    Each row has its own girdle and angles (degrees). A result is NaN where one of its angles is NaN.
    """
    with np.errstate(invalid="ignore"):
        at = landmarks(girdles, angles_deg / DEG)
        residuals = constraint_residuals_mm(girdles, angles_deg / DEG)
    return np.stack([getattr(at, name) for name in POINTS]), residuals
