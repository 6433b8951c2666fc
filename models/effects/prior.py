"""What is believed about an effect before any data.

The diagnosis reads it; a model with a known effect does not.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class EffectPrior:
    """Normal prior of an effect's amplitudes; a tuple has one value for each direction."""

    scale: tuple[float, ...]
    """Prior SD in the effect's unit: as a vector, as long as the effect typically is."""
    source: str
    """Where the scale comes from."""
    sign: tuple[int, ...] = ()
    """Where the effect's nature gives one: +1, -1, or 0 for either; empty for all 0."""
    mean: float = 0.0
    """Prior mean of each amplitude, where what is measured of it has one."""
