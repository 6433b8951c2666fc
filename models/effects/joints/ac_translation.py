"""The AC joint is no ball and socket: the acromion glides on the clavicle."""

from dataclasses import replace

from models.effects.course import ELEVATION
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
    course=ELEVATION,
    may_follow=("scapula_y", "scapula_z", "scapula_x"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(1.5, 1.5, 4.5),
        source="Sahara 2006: antero-posterior -1.9 to +1.6 mm; bone pins 2.7-6.5 mm",
    ),
)
