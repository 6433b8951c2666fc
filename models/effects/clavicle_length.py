"""The subject's clavicle is longer or shorter than the cadaver's; the conoid keeps its place relative to its length."""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    size = 1.0 + percent / 100.0
    longer = replace(girdle, ac_mm=girdle.ac_mm * size, clavicle_conoid_mm=girdle.clavicle_conoid_mm * size)
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
