"""Lengths of a person's bones: medians over postures, with their spread and what a median of so many is worth."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.checks.rigidity import Rigidity

_MEDIAN_SD = 1.2533
"""SD of the median of n normal values, times sqrt(n) over theirs (sqrt(pi / 2))."""

ONE_POSTURE_MM = 3.0
"""SD of a length palpated once: 1.43 mm for each end (thesis 5.2.1) are 2.0 mm, and skin moves. Assumed."""


PALPATOR_MM = 0.96
"""SD of a palpated coordinate (Pronk's palpator, thesis 5.2.1). Medians over postures do not get below it: a landmark
that is taken for a place beside it in one posture is so in the others."""

PALPATOR_LENGTH_MM = PALPATOR_MM * float(np.sqrt(2.0))
"""The same of a length between two landmarks."""

DEEPEST_MM = -2.0 * ONE_POSTURE_MM
"""Of TS or AI, as a distance to the thorax: deeper than two SDs of a landmark palpated once, none is inside it."""


@dataclass(frozen=True)
class Size:
    """A length or coordinate, mm."""

    value_mm: float
    spread_mm: float
    """SD over the postures; NaN for one posture."""
    sd_mm: float
    """Of the value, what every posture has alike included."""
    postures: int

    def __str__(self) -> str:
        if self.postures == 1:
            return "in one posture"
        return f"over {self.postures} postures, spread {self.spread_mm:.1f} mm"


def size_of(values_mm: Float[np.ndarray, " postures"], least_sd_mm: float) -> Size:
    """Take the median of the postures in which it was measured (the others are NaN), with at least this SD."""
    known = values_mm[np.isfinite(values_mm)]
    if len(known) == 1:
        return Size(float(known[0]), np.nan, ONE_POSTURE_MM, 1)
    spread = float(np.std(known, ddof=1))
    sd = _MEDIAN_SD * spread / float(np.sqrt(len(known)))
    return Size(float(np.median(known)), spread, max(sd, least_sd_mm), len(known))


def bone_sizes(rigidity: Rigidity) -> dict[tuple[str, str], Size]:
    """Take the distances that a bone holds, without the postures in which one of their landmarks slipped.

    Pairs that were in no posture measured together are left out.
    """
    sound = np.where(rigidity.sound(), rigidity.distances_mm, np.nan)
    every = np.where(np.isfinite(sound).any(axis=1, keepdims=True), sound, rigidity.distances_mm)
    return {
        pair: size_of(row, PALPATOR_LENGTH_MM)
        for pair, row in zip(rigidity.pairs, every, strict=True)
        if np.isfinite(row).any()
    }
