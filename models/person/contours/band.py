"""Settings of the edge detection: brightness of the object and width of the band. This module imports nothing heavy."""

from dataclasses import dataclass
from typing import Literal, get_args

Inside = Literal["bright", "dark", "either"]
"""Brightness of the object relative to its surroundings."""

INSIDE: tuple[Inside, ...] = get_args(Inside)

HALF_WIDTH_PX = 5.0
"""Half width of the band, which has 11 pixels in all (thesis 2.5)."""

VECTOR_PX = 0.5
"""Tolerance of the vectorization: largest distance of the polygon from the contour (thesis 2.5)."""


@dataclass(frozen=True)
class Settings:
    """Settings of the edge detection."""

    inside: Inside = "either"
    half_width_px: float = HALF_WIDTH_PX
