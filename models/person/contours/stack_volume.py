"""The volume of what closed contours in a stack of slices go round (thesis 4.3.10, Table 4.8).

Area times distance of the slices, summed. Slices without a contour between two that have one are given the area that a
line between these has.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

_MM3_PER_CM3 = 1000.0


def area_mm2(corners_mm: Float[np.ndarray, "3 corners"]) -> float:
    """Compute the area of a flat polygon in space, its first corner not repeated: |sum p_k x p_k+1| / 2."""
    off = corners_mm - corners_mm[:, :1]
    return 0.5 * float(np.linalg.norm(np.cross(off, np.roll(off, -1, axis=1), axis=0).sum(axis=1)))


def stack_volume_cm3(areas_mm2: Mapping[int, float], slice_mm: float) -> float:
    """Compute the volume of the areas in slices, by the number of the slice; ``slice_mm`` is their distance."""
    numbers = sorted(areas_mm2)
    every = np.arange(numbers[0], numbers[-1] + 1)
    areas = np.interp(every, numbers, [areas_mm2[k] for k in numbers])
    return float(areas.sum()) * abs(slice_mm) / _MM3_PER_CM3
