"""The volume enclosed by closed contours in a stack of slices (thesis 4.3.10, Table 4.8).

The volume is the sum of the areas times the distance between slices. The area of a slice without a contour is
interpolated linearly between the nearest slices with one.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

_MM3_PER_CM3 = 1000.0


def area_mm2(corners_mm: Float[np.ndarray, "3 corners"]) -> float:
    """Compute the area of a flat polygon in space, without its first corner repeated: |sum p_k x p_k+1| / 2."""
    off = corners_mm - corners_mm[:, :1]
    return 0.5 * float(np.linalg.norm(np.cross(off, np.roll(off, -1, axis=1), axis=0).sum(axis=1)))


def stack_volume_cm3(areas_mm2: Mapping[int, float], slice_mm: float) -> float:
    """Compute the volume from the areas by slice number; ``slice_mm`` is the distance between slices."""
    numbers = sorted(areas_mm2)
    every = np.arange(numbers[0], numbers[-1] + 1)
    areas = np.interp(every, numbers, [areas_mm2[k] for k in numbers])
    return float(areas.sum()) * abs(slice_mm) / _MM3_PER_CM3
