"""What is believed about an effect before any data: how large it is, its sign, and how surely its channels go together.

The diagnosis reads it; a model with a known effect does not.
"""

from dataclasses import dataclass

COURSE_SD = (1.0, 0.3, 0.2)
"""Prior SD of the terms of a course over elevation, as fractions of the effect's scale. Powers of the elevation from
1/2 to 3, a hinge at half the range and a smooth step have second terms of 0.2, -0.4, -0.5 and 0, third ones up to
0.2."""


@dataclass(frozen=True)
class EffectPrior:
    """Prior of an effect's amplitudes; a tuple has one value for each channel."""

    scale: tuple[float, ...]
    """Prior SD in the effect's unit: as a vector, as long as the effect typically is."""
    source: str
    """Where the scale comes from."""
    sign: tuple[int, ...] = ()
    """Where the effect's nature gives one: +1, -1, or 0 for either; empty for all 0."""
    leads: str = ""
    """The channel that is the effect's own direction, where there is one: along it the effect typically is as large as
    the scale, the other channels only lie beside it. Of a single direction it is that one."""
    between_motions: float = 0.1
    """Prior SD of a channel's amplitude in one motion about the mean of all motions, as a fraction of the scale."""
    axial: tuple[float, ...] = ()
    """How much farther the clavicle has turned about its own axis than was measured, deg a unit of each channel; empty
    where the effect does not hide such a turn."""
