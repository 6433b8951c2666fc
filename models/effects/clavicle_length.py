"""The subject's clavicle is longer or shorter than the cadaver's: in its shaft, so the conoid keeps its place near AC.

Scaled as a whole, a clavicle 8 % longer would take the conoid's attachment farther from the scapula than any conoid of
the adapted lengths reaches.
"""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    more_mm = girdle.ac_mm * percent / 100.0
    longer = replace(girdle, ac_mm=girdle.ac_mm + more_mm, clavicle_conoid_mm=girdle.clavicle_conoid_mm + more_mm)
    return longer, rotations


EFFECT = Effect(
    name="clavicle_length",
    what="the subject's clavicle is not the cadaver's",
    unit="%",
    channels=("length",),
    scale=(8.0,),
    over_elevation=False,
    source="143-146 +- 11 mm between people",
    adjust=_adjust,
)
