"""The subject's scapula is larger or smaller than the cadaver's, all of it alike."""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    size = 1.0 + percent / 100.0
    scaled = replace(
        girdle,
        ts_mm=girdle.ts_mm * size,
        ai_mm=girdle.ai_mm * size,
        scapula_conoid_mm=girdle.scapula_conoid_mm * size,
    )
    return scaled, rotations


EFFECT = Effect(
    name="scapula_size",
    what="the subject's scapula is not the cadaver's",
    unit="%",
    channels=("size",),
    scale=(8.0,),
    over_elevation=False,
    source="assumed: as the clavicle's",
    adjust=_adjust,
)
