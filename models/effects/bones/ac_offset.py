"""The AC joint is not where the set has it: off the clavicle's axis, or elsewhere in the scapula.

AC of a set is a landmark on the bones, but the bones rotate about a centre inside the joint. In the clavicle frame the
effect moves AC across the axis; a movement along it is a change of the clavicle's length. In the scapula frame the
effect moves TS, AI and the conoid's attachment relative to the centre.
"""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp

ON_SCAPULA = ("ts_mm", "ai_mm", "scapula_conoid_mm")
"""Fields of the girdle that are relative to AC, scapula frame."""


def _adjust(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
    off_axis = xp.stack([xp.zeros_like(mm[0]), mm[0], mm[1]])
    on_scapula = {name: getattr(girdle, name) + mm[2:] for name in ON_SCAPULA}
    return replace(girdle, ac_mm=girdle.ac_mm + off_axis, **on_scapula), rotations


EFFECT = Effect(
    name="ac_offset",
    plain_name="AC joint elsewhere in the bones",
    what="AC is off the clavicle's axis; TS, AI and conoid lie elsewhere on the scapula, seen from it",
    unit="mm",
    directions=("clavicle y", "clavicle z", "scapula x", "scapula y", "scapula z"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(8.0, 8.0, 10.0, 10.0, 10.0),
        source="assumed: AC of a set is a landmark on the bones, the centre of the joint some 10 mm away",
    ),
)
