"""The conoid is not rigid: its length changes as the arm is raised. It is soft and strains only once it is taut."""

from dataclasses import replace

from models.effects.basis import LATE
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
    return replace(girdle, conoid_length_mm=girdle.conoid_length_mm + mm[0]), rotations


EFFECT = Effect(
    name="conoid_strain",
    plain_name="conoid stretches",
    what="conoid length changes with elevation",
    unit="mm",
    directions=("length",),
    basis=LATE,
    may_follow=("scapula_y", "scapula_z", "scapula_x"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(0.8,),
        sign=(1,),
        source="bone pins of four shoulders 0.7 mm RMS; stiffness of DAS3, 80 000 N/m (Chadwick 2014, doi "
        "10.1109/TBME.2014.2309727): 0.7 mm RMS / 3.5 of 200 N; in vivo strain not found",
    ),
    moves_landmarks=False,
)
