"""The thorax frame turns as the arm is raised, because the spine extends: both bones seem to turn by this rotation."""

from models.effects.basis import ELEVATION
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp
from motions.rotations import DEG, compose, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Compute R_true = E' R_measured for both bones, from R_measured = E R_true with the rotation E of the thorax."""
    R_true_measured = xp.swapaxes(rotation_from_vector(deg / DEG), 0, 1)
    R_clavicle, R_scapula = (compose(R_true_measured, R) for R in rotations)
    return girdle, (R_clavicle, R_scapula)


EFFECT = Effect(
    name="thorax_extension",
    plain_name="thorax bends with the arm",
    what="the thorax frame turns with elevation, both bones alike",
    unit="deg",
    directions=("about x", "about y", "about z"),
    basis=ELEVATION,
    may_follow=("scapula_z",),
    adjust=_adjust,
    turns_thorax_about="IJ",
    prior=EffectPrior(
        scale=(3.0, 1.0, 1.0),
        sign=(1, 0, 0),
        source="ranges over a raise: of both arms 12.8 +- 7.6 deg, 14.9 / 3.5 = 4.3 RMS; of one up to 6, / 3.5 = 1.7; "
        "between them; about y and z assumed a third",
    ),
)
