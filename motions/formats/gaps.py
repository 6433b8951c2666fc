"""How files of positions write that a marker was not seen."""

import numpy as np
from jaxtyping import Float


def zeros_as_gaps(positions: Float[np.ndarray, "markers 3 frames"]) -> Float[np.ndarray, "markers 3 frames"]:
    """Put NaN for a marker at exactly (0, 0, 0), which is how capture software writes a gap, unless it is always there:
    then it is the origin of the frame, such as IJ in a file in the thorax frame."""
    zero = (positions == 0.0).all(axis=1)
    gap = zero & ~zero.all(axis=1, keepdims=True)
    return np.where(gap[:, None], np.nan, positions)
