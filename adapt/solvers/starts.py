"""Where posture fits start from."""

import numpy as np
from jaxtyping import Bool, Float

from motions.rhythm import REST_DEG
from motions.rotations import DEG

OFFSETS_SEED = 0

OFFSETS_DEG = np.random.Generator(np.random.PCG64(OFFSETS_SEED)).uniform(-30.0, 30.0, (8, 6))
"""Where else to start from: offsets to the measured angles. Fixed, so that a fit is reproducible."""


def at_rest_where_unknown(
    angles: Float[np.ndarray, " 6 *batch"], known: Bool[np.ndarray, " *any"]
) -> Float[np.ndarray, " 6 *batch"]:
    """Replace angles (rad) that are not known by those of the arm at rest."""
    rest = (REST_DEG / DEG).astype(angles.dtype).reshape(6, *(1,) * (angles.ndim - 1))
    return np.where(known, angles, rest)
