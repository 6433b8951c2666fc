"""The subject's scapula is larger or smaller than the cadaver's, seen from AC.

Its height may differ from its width, and the coracoid, where the conoid is attached, goes along for the most part.
"""

from dataclasses import replace

import jax.numpy as jnp

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle

_CORACOID_SHARE = 0.75
"""Assumed: of the blade's growth; from half of it to all of it within one standard deviation."""


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    larger, higher, coracoid = percent / 100.0
    blade = 1.0 + jnp.stack([larger, larger + higher, larger])
    scaled = replace(
        girdle,
        ts_mm=girdle.ts_mm * blade,
        ai_mm=girdle.ai_mm * blade,
        scapula_conoid_mm=girdle.scapula_conoid_mm * (1.0 + _CORACOID_SHARE * larger + coracoid),
    )
    return scaled, rotations


EFFECT = Effect(
    name="scapula_size",
    what="the subject's scapula is not the cadaver's",
    unit="%",
    channels=("size", "height, %", "coracoid, %"),
    details=2,
    over_elevation=False,
    adjust=_adjust,
    prior=EffectPrior(
        scale=(8.0, 1.5, 2.0),
        source="assumed: as the clavicle's",
    ),
)
