"""The SC joint is no ball and socket: the medial clavicle, and with it the girdle, glides on the sternum."""

from dataclasses import replace

from models.effects.basis import ELEVATION
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
    return replace(girdle, sc_mm=girdle.sc_mm + mm), rotations


EFFECT = Effect(
    name="sc_translation",
    plain_name="SC joint moves",
    what="SC centre moves in the thorax with elevation",
    unit="mm",
    directions=("lateral", "up", "back"),
    basis=ELEVATION,
    may_follow=("clavicle_y", "clavicle_z"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(1.2, 1.2, 1.2),
        source="whole vector: bone pins of four shoulders 1.2-2.1 mm RMS; of two, range 5.9-12.8 mm, / 3.5 = 1.7-3.7 "
        "RMS; no figure of living people found",
    ),
)
