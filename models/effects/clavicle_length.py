"""The subject's clavicle is longer or shorter than the cadaver's.

The conoid's attachment may keep its distance from AC, or its share of the length, as the conoid tubercles of men and
women do (Rios 2007, doi 10.1177/0363546506297536): it goes halfway, give or take half the way.
"""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    longer, farther = percent / 100.0
    ac_mm = girdle.ac_mm * (1.0 + longer)
    from_ac_mm = (girdle.clavicle_conoid_mm - girdle.ac_mm) * (1.0 + 0.5 * longer + farther)
    return replace(girdle, ac_mm=ac_mm, clavicle_conoid_mm=ac_mm + from_ac_mm), rotations


EFFECT = Effect(
    name="clavicle_length",
    what="the subject's clavicle is not the cadaver's",
    unit="%",
    channels=("length", "conoid from AC, %"),
    scale=(8.0, 4.0),
    details=1,
    over_elevation=False,
    source="143-146 +- 11 mm between people",
    adjust=_adjust,
)
