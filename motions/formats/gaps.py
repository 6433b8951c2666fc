"""Gaps of markers in files of positions."""

import numpy as np
from jaxtyping import Float


def zeros_as_gaps(positions: Float[np.ndarray, "markers 3 frames"]) -> Float[np.ndarray, "markers 3 frames"]:
    """Replace markers at exactly (0, 0, 0), with which capture software writes a gap, by NaN.

    A marker that is always there is the origin of the frame, such as IJ in a file in the thorax frame, and stays.
    """
    zero = (positions == 0.0).all(axis=1)
    gap = zero & ~zero.all(axis=1, keepdims=True)
    return np.where(gap[:, None], np.nan, positions)
