"""How edges are looked for: what the object is, and how wide the band around a line is. Imports nothing heavy."""

from dataclasses import dataclass
from typing import Literal, get_args

Inside = Literal["bright", "dark", "either"]
"""What the object is beside what surrounds it."""

INSIDE: tuple[Inside, ...] = get_args(Inside)

HALF_WIDTH_PX = 5.0
"""Of the band: 11 pixels in all (thesis 2.5)."""

VECTOR_PX = 0.5
"""How far the polygon of the vectorization may be from the contour (thesis 2.5)."""


@dataclass(frozen=True)
class Settings:
    """How edges are looked for."""

    inside: Inside = "either"
    half_width_px: float = HALF_WIDTH_PX
