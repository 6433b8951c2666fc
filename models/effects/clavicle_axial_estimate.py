"""The axial rotation given as measured is an estimate, and it lags behind the bone's."""

import jax.numpy as jnp

from models.effects.effect import Effect, Rotations
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotation_from_cardan


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """The true clavicle has turned about its own axis by so much more than the estimate says."""
    R_thorax_estimate, R_thorax_scapula = rotations
    zero = jnp.zeros_like(deg[0])
    R_estimate_clavicle = rotation_from_cardan(jnp.stack([zero, zero, deg[0] / DEG]))
    return girdle, (compose(R_thorax_estimate, R_estimate_clavicle), R_thorax_scapula)


EFFECT = Effect(
    name="clavicle_axial_estimate",
    what="the clavicle's axial rotation as measured is an estimate that lags",
    unit="deg",
    channels=("axial",),
    scale=(15.0,),
    over_elevation=True,
    source="true 17-35 deg over elevation (Ludewig, Matsuki, Sahara)",
    adjust=_adjust,
    sign=(1,),
)
