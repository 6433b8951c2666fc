"""The thorax is not symmetric: the ellipsoid's centre is not in the sagittal plane (A4 of the thesis does not hold)."""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp


def _adjust(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
    M_x, M_y, M_z = girdle.centre_mm
    return replace(girdle, centre_mm=xp.stack(xp.broadcast_arrays(M_x + mm[0], M_y, M_z))), rotations


EFFECT = Effect(
    name="thorax_asymmetry",
    plain_name="thorax beside the midline",
    what="M_x is not 0",
    unit="mm",
    directions=("M_x",),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(7.0,),
        source="assumed: 5-10 mm, no figure found",
    ),
    moves_landmarks=False,
)
