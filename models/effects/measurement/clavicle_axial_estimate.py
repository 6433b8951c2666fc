"""The clavicle's axial rotation that is given as measured is an estimate, which lags behind the bone.

The lag grows late in a raise, because the bone turns late. In the basis ``OverElevation``, the axial rotation of six
shoulders with bone pins and of one published mean (Moissenet 2023, Oki 2012) has a second term of -0.2 to -0.8 times
the first, another mean (Ludewig 2009) one of -0.1 to -0.2. The straight line f has 0 and f^2 has -0.25.
"""

from models.effects.basis import LATE
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp
from motions.rotations import DEG, compose, rotation_from_cardan


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Turn the clavicle about its own axis by the lag, which the estimate lacks."""
    R_thorax_estimate, R_thorax_scapula = rotations
    zero = xp.zeros_like(deg[0])
    R_estimate_clavicle = rotation_from_cardan(xp.stack([zero, zero, deg[0] / DEG]))
    return girdle, (compose(R_thorax_estimate, R_estimate_clavicle), R_thorax_scapula)


EFFECT = Effect(
    name="clavicle_axial_estimate",
    plain_name="axial rotation of the clavicle estimated, not measured",
    what="the clavicle's axial rotation as measured is an estimate that lags",
    unit="deg",
    directions=("axial",),
    basis=LATE,
    adjust=_adjust,
    prior=EffectPrior(
        scale=(5.0,),
        sign=(1,),
        source="true range over elevation 17-35 deg (Ludewig, Matsuki, Sahara), of which an estimate misses 10-25, "
        "/ 3.5 = 2.9-7.1 RMS",
    ),
)
