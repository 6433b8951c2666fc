"""Lengths of a person's bones: medians over the postures, with the spread of the values and the SD of the median."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.checks.rigidity import Rigidity

_MEDIAN_SD = 1.2533
"""SD of the median of n normal values, in units of (their SD) / sqrt(n): sqrt(pi / 2)."""

ONE_POSTURE_MM = 3.0
"""SD of a length palpated once, assumed: 1.43 mm per end (thesis 5.2.1) make 2.0 mm, and skin moves."""


PALPATOR_MM = 0.96
"""SD of a palpated coordinate (Pronk's palpator, thesis 5.2.1), and lower limit for the SD of a median over postures: a
place beside the landmark that is mistaken for it in one posture is mistaken for it in the others too."""

PALPATOR_LENGTH_MM = PALPATOR_MM * float(np.sqrt(2.0))
"""SD of a palpated length between two landmarks."""

DEEPEST_MM = -2.0 * ONE_POSTURE_MM
"""Smallest plausible signed distance of TS or AI to the thorax: two SDs of a landmark palpated once, inside it."""


@dataclass(frozen=True)
class Size:
    """A length or coordinate, mm."""

    value_mm: float
    spread_mm: float
    """SD over the postures; NaN for one posture."""
    sd_mm: float
    """SD of the value, including the error that all postures share."""
    postures: int

    def __str__(self) -> str:
        if self.postures == 1:
            return "in one posture"
        return f"over {self.postures} postures, spread {self.spread_mm:.1f} mm"


def size_of(values_mm: Float[np.ndarray, " postures"], least_sd_mm: float) -> Size:
    """Compute the median over the postures with a value (not NaN); its SD is at least ``least_sd_mm``."""
    known = values_mm[np.isfinite(values_mm)]
    if len(known) == 1:
        return Size(float(known[0]), np.nan, ONE_POSTURE_MM, 1)
    spread = float(np.std(known, ddof=1))
    sd = _MEDIAN_SD * spread / float(np.sqrt(len(known)))
    return Size(float(np.median(known)), spread, max(sd, least_sd_mm), len(known))


def bone_sizes(rigidity: Rigidity) -> dict[tuple[str, str], Size]:
    """Compute the distances between landmarks of one bone, without postures in which one of the two is an outlier.

    A pair that is sound in no posture keeps all postures. A pair that was never measured together is left out.
    """
    sound = np.where(rigidity.sound(), rigidity.distances_mm, np.nan)
    every = np.where(np.isfinite(sound).any(axis=1, keepdims=True), sound, rigidity.distances_mm)
    return {
        pair: size_of(row, PALPATOR_LENGTH_MM)
        for pair, row in zip(rigidity.pairs, every, strict=True)
        if np.isfinite(row).any()
    }
