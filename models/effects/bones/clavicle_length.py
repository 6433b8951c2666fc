"""The subject's clavicle is longer or shorter than the cadaver's.

The conoid's attachment may keep its distance from AC, or its share of the length, as the conoid tubercles of men and
women do (Rios 2007, doi 10.1177/0363546506297536), and the clavicle may become thicker with it or not: of each half,
give or take as much. A millimetre there is several degrees of the clavicle's axial rotation.
"""

from dataclasses import replace

import jax.numpy as jnp

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, percent) -> tuple[Girdle, Rotations]:
    longer, farther, thicker = percent / 100.0
    ac_mm = girdle.ac_mm * (1.0 + longer)
    factors = 1.0 + 0.5 * longer + jnp.stack([farther, thicker, thicker])
    conoid_mm = ac_mm + (girdle.clavicle_conoid_mm - girdle.ac_mm) * factors
    return replace(girdle, ac_mm=ac_mm, clavicle_conoid_mm=conoid_mm), rotations


EFFECT = Effect(
    name="clavicle_length",
    what="the subject's clavicle is not the cadaver's",
    unit="%",
    channels=("length", "conoid from AC, %", "thickness, %"),
    details=2,
    over_elevation=False,
    adjust=_adjust,
    prior=EffectPrior(
        scale=(8.0, 4.0, 4.0),
        source="143-146 +- 11 mm between people",
    ),
)
