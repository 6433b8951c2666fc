"""The AC joint is no ball and socket: the acromion glides on the clavicle."""

from dataclasses import replace

from models.effects.basis import ELEVATION
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
    return replace(girdle, ac_mm=girdle.ac_mm + mm), rotations


EFFECT = Effect(
    name="ac_translation",
    plain_name="AC joint moves",
    what="AC centre moves in the clavicle with elevation",
    unit="mm",
    directions=("along", "up", "back"),
    basis=ELEVATION,
    may_follow=("scapula_y", "scapula_z", "scapula_x"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(1.0, 1.0, 1.5),
        source="Sahara 2006 (MRI, 14 shoulders): antero-posterior -1.9 +- 1.3 mm at 90 deg of abduction, +1.6 +- 2.7 "
        "at the end, RMS of the mean course 1.2, of a person about it 2.7 / 3.5 = 0.8; up 0.9 +- 1.9, 2.1 / 3.5 = 0.6; "
        "along: none. Bone pins: range 2.7-6.5 mm of the whole vector, / 3.5 = 0.8-1.9 RMS",
    ),
)
