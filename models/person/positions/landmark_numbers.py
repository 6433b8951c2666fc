"""The numbers n of a girdle that landmark positions measure without any angle: medians over a person's postures.

n = (SC, |SC-AC|, TS_x, AI_x, AI_y): SC in the thorax frame, the last three in the scapula frame, with its origin at AC
and its x axis from TS to AC (thesis, Appendix A).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from models.girdle import NUMBERS
from models.person.sizes import PALPATOR_LENGTH_MM, PALPATOR_MM, size_of
from motions.landmarks.frames import scapula_frame, transposed
from motions.rotations import rotate

MEASURED = ("sc_mm", "ac_mm", "ts_mm", "ai_mm")
"""Fields of a girdle that landmarks measure."""

IN_GIRDLE = tuple(
    NUMBERS[name].start + axis
    for name, axes in zip(MEASURED, ((0, 1, 2), (0,), (0,), (0, 1)), strict=True)
    for axis in axes
)
"""Indices of n in ``Girdle.numbers_mm``, with AC on the axis of the clavicle."""

KEYS = (*["clavicle.sc_mm"] * 3, "clavicle.length_mm", "scapula.ts_mm", *["scapula.ai_mm"] * 2)
"""Key in a parameter set of each number of n."""


class LandmarkNumbers(NamedTuple):
    """The numbers n of one person or of several, mm; NaN where not measured."""

    values_mm: Float[np.ndarray, " seven *persons"]
    sd_mm: Float[np.ndarray, " seven *persons"]
    """SDs of the medians."""


def numbers_of(
    landmarks_mm: Mapping[str, Float[np.ndarray, "3 postures"]], postures: Bool[np.ndarray, " postures"]
) -> LandmarkNumbers:
    """Compute n and its SDs over the postures of a mask."""
    nowhere = np.full((3, int(postures.sum())), np.nan)
    SC, AC, TS, AI = (
        landmarks_mm[name][:, postures] if name in landmarks_mm else nowhere for name in ("SC", "AC", "TS", "AI")
    )
    ts_x = -np.linalg.norm(AC - TS, axis=0)
    ai_x, ai_y, _ = rotate(transposed(scapula_frame(AC, TS, AI)), AI - AC)
    lengths = np.linalg.norm(SC - AC, axis=0), ts_x, ai_x, ai_y
    columns = [*((row, PALPATOR_MM) for row in SC), *((row, PALPATOR_LENGTH_MM) for row in lengths)]
    sizes = [size_of(row, least) if np.isfinite(row).any() else None for row, least in columns]
    return LandmarkNumbers(
        np.array([np.nan if one is None else one.value_mm for one in sizes]),
        np.array([np.nan if one is None else one.sd_mm for one in sizes]),
    )
