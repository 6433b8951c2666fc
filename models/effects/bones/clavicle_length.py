"""The subject's clavicle is longer or shorter than the cadaver's.

The distance of the conoid's attachment from SC keeps its share of the length, as do the conoid tubercles of men and
women (Rios 2007, doi 10.1177/0363546506297536).
"""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    longer = 1.0 + percent[0] / 100.0
    x, y, z = girdle.clavicle_conoid_mm
    conoid_mm = xp.stack(xp.broadcast_arrays(x * longer, y, z))
    return replace(girdle, ac_mm=girdle.ac_mm * longer, clavicle_conoid_mm=conoid_mm), rotations


EFFECT = Effect(
    name="clavicle_length",
    plain_name="clavicle of another length",
    what="the subject's clavicle is not the cadaver's",
    unit="%",
    directions=("length",),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(8.0,),
        source="143-146 +- 11 mm between people",
    ),
)
