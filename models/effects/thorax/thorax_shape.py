"""The thorax is not an ellipsoid but squarer or more pointed: a superquadric.

To first order in n, the surface sum |x_i / a_i|^(2 + n) = 1 lies off the ellipsoid, along its normal, by

    h = -n sum u_i^2 ln |u_i| / (2 |x_i / a_i^2|),   u_i = x_i / a_i

The surface of this effect is the ellipsoid moved by exactly h.
"""

from dataclasses import replace

import jax.numpy as jnp

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.ellipsoid import closest_point
from models.girdle import Girdle, chain_landmarks

_SMALLEST_SQUARE = 1e-12
"""Lower limit of u^2, at which u^2 ln u^2 is 0 to rounding; it keeps the logarithm finite."""


def _offset_mm(point_mm, girdle: Girdle, exponent):
    """Compute h at the point of the ellipsoid closest to the given point; ``exponent`` is n."""
    relative, axes = jnp.broadcast_arrays(point_mm - girdle.centre_mm, girdle.semi_axes_mm)
    x = closest_point(relative, axes)
    squares = jnp.maximum((x / axes) ** 2, _SMALLEST_SQUARE)
    steepness = 2.0 * jnp.sqrt(jnp.sum((x / axes**2) ** 2, axis=0))
    return -0.5 * exponent * jnp.sum(squares * jnp.log(squares), axis=0) / steepness


def _adjust(girdle: Girdle, rotations: Rotations, exponent) -> tuple[Girdle, Rotations]:
    at = chain_landmarks(girdle, *rotations)
    ts = girdle.ts_distance_mm + _offset_mm(at.TS, girdle, exponent[0])
    ai = girdle.ai_distance_mm + _offset_mm(at.AI, girdle, exponent[0])
    return replace(girdle, ts_distance_mm=ts, ai_distance_mm=ai), rotations


EFFECT = Effect(
    name="thorax_shape",
    plain_name="thorax is no ellipsoid",
    what="the surface is not an ellipsoid (superquadric exponent - 2)",
    unit="1",
    directions=("exponent",),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(0.3,),
        source="sphere misfit 8-10 mm (Paquet 2019)",
    ),
    moves_landmarks=False,
)
