"""Where the bones of a parameter set are at given angles, and how far its constraints are from holding there."""

import numpy as np
from jaxtyping import Float

from models.girdle import Girdle, constraint_residuals_mm, landmarks
from motions.rotations import DEG

POINTS = ("AC", "TS", "AI", "clavicle_conoid", "scapula_conoid")
"""The landmarks that move, in the order of every array of points."""


def bones_mm(
    girdles: Girdle, angles_deg: Float[np.ndarray, "6 rows"]
) -> tuple[Float[np.ndarray, "5 3 rows"], Float[np.ndarray, "3 rows"]]:
    """Locate POINTS in the thorax frame and compute the constraint residuals A1-A3, all in mm.

    They are of each row's girdle at its angles (degrees). NaN where an angle that it takes is.
    """
    with np.errstate(invalid="ignore"):
        at = landmarks(girdles, angles_deg / DEG)
        residuals = constraint_residuals_mm(girdles, angles_deg / DEG)
    return np.stack([getattr(at, name) for name in POINTS]), residuals
