"""Measurement noise, the part of the angles that is not smooth along a motion.

Third differences of neighbouring postures of a motion remove a parabola; for independent errors with the variance s^2
they have the variance 20 s^2 (1 + 9 + 9 + 1).
"""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.diagnosis.result import Noise
from motions.rotations import DEG

_ASSUMED_DEG = 1.5
"""Noise assumed if neither data nor user give it: one palpated posture has 2-3 deg, the mean of repeats less."""

ASSUMED = "assumed"

LEAST_DEG = 0.1
"""Smallest noise: less is rounding of the files, not measurement."""

ORDER = 3
_VARIANCE = 20.0

FEWEST = 12
"""Smallest number of third differences for an estimate."""

INDEPENDENT = 0.36
"""Share of overlapping third differences that counts as independent: on the cautious side of the 0.43 that their
autocorrelations r = -3/4, 3/10, -1/20 give by 1 / (1 + 2 sum r_k^2)."""


def estimate_noise(shoulders: Shoulders, y: Float[np.ndarray, "rows 3"], given_deg: float | None = None) -> Noise:
    """Estimate the SD of one angle from y (``projection.nearest_posture``), each component of which has this SD."""
    if given_deg is not None:
        return Noise(given_deg, "given", np.inf)
    every = variances(shoulders, y)
    if len(every) < FEWEST:
        return Noise(_ASSUMED_DEG, ASSUMED, float(FEWEST))
    return Noise(max(LEAST_DEG, float(np.sqrt(every.mean()))), "estimated", float(INDEPENDENT * len(every)))


def variances(shoulders: Shoulders, values: Float[np.ndarray, "rows n"]) -> Float[np.ndarray, " differences"]:
    """Compute s^2 from each third difference of each of n numbers along every motion."""
    every = (values[rows] for rows in shoulders.sequences() if len(rows) > ORDER)
    return np.concatenate([np.zeros(0), *((np.diff(one, ORDER, axis=0) ** 2 / _VARIANCE).ravel() for one in every)])


def floor_deg(noise: Noise, shoulders: Shoulders, B: Float[np.ndarray, "rows 3 6"]) -> Float[np.ndarray, "rows 6"]:
    """Compute the mean absolute gap of noise alone: ``sqrt(2/pi) s |B_a|``, as the gap is B' y (B per degree)."""
    gap = np.sqrt(2.0 / np.pi) * noise.angle_deg * np.sqrt((B**2).sum(axis=1)) / DEG
    return np.where(shoulders.measured.T, gap, np.nan)
