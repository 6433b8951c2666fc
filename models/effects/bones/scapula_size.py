"""The subject's scapula is larger or smaller than the cadaver's, scaled about AC.

The coracoid, to which the conoid is attached, grows by most of the blade's growth (``CORACOID_SHARE``).
"""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle

CORACOID_SHARE = 0.75
"""Growth of the coracoid as a share of the blade's, assumed: half of it to all of it within one standard deviation."""


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    larger = percent[0] / 100.0
    scaled = replace(
        girdle,
        ts_mm=girdle.ts_mm * (1.0 + larger),
        ai_mm=girdle.ai_mm * (1.0 + larger),
        scapula_conoid_mm=girdle.scapula_conoid_mm * (1.0 + CORACOID_SHARE * larger),
    )
    return scaled, rotations


EFFECT = Effect(
    name="scapula_size",
    plain_name="scapula of another size",
    what="the subject's scapula is not the cadaver's",
    unit="%",
    directions=("size",),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(8.0,),
        source="assumed: as the clavicle's",
    ),
)
