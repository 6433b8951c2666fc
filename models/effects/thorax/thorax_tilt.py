"""The axes of the thorax ellipsoid are turned from the axes of the thorax frame, about the ellipsoid's centre."""

from dataclasses import replace

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp
from motions.rotations import DEG, compose, rotate, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Turn all but the ellipsoid back about its centre: the same chain, expressed along the ellipsoid's axes."""
    R_ellipsoid_thorax = xp.swapaxes(rotation_from_vector(deg / DEG), 0, 1)
    sc = girdle.centre_mm + rotate(R_ellipsoid_thorax, girdle.sc_mm - girdle.centre_mm)
    R_clavicle, R_scapula = (compose(R_ellipsoid_thorax, R) for R in rotations)
    return replace(girdle, sc_mm=sc), (R_clavicle, R_scapula)


EFFECT = Effect(
    name="thorax_tilt",
    plain_name="thorax ellipsoid tilted",
    what="ellipsoid axes rotated from the thorax frame",
    unit="deg",
    directions=("about x", "about y", "about z"),
    adjust=_adjust,
    turns_thorax_about="ellipsoid",
    prior=EffectPrior(
        scale=(6.0, 3.5, 3.5),
        source="assumed: 5-10 deg, no figure found",
    ),
    moves_landmarks=False,
)
