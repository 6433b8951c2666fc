"""SC and AC as centres of their joint surfaces (thesis 4.3.3)."""

import numpy as np
from jaxtyping import Float

from models.person.least_squares import Points

NEAR_MM = 10.0
"""Points of the clavicle nearer than this to the scapula, and the other way round, are of the AC joint (4.3.3)."""


def sternoclavicular_centre_mm(joint_surface_mm: Points) -> Float[np.ndarray, "3"]:
    """Average the points of the clavicle's joint surface."""
    return joint_surface_mm.mean(axis=1)


def acromioclavicular_centre_mm(clavicle_mm: Points, scapula_mm: Points) -> Float[np.ndarray, "3"]:
    """Average the points of the clavicle within ``NEAR_MM`` of the scapula and those of the scapula near the clavicle.

    ValueError where the two bones come nowhere so near.
    """
    apart = np.linalg.norm(clavicle_mm[:, :, None] - scapula_mm[:, None, :], axis=0)
    near = clavicle_mm[:, apart.min(axis=1) < NEAR_MM], scapula_mm[:, apart.min(axis=0) < NEAR_MM]
    if not near[0].shape[1]:
        raise ValueError(
            f"clavicle and scapula come no nearer than {apart.min():.1f} mm, and the AC joint is within {NEAR_MM:g} mm"
        )
    return np.concatenate(near, axis=1).mean(axis=1)
