"""The thorax is not an ellipsoid but squarer or more pointed: a superquadric.

sum |x_i / a_i|^(2 + n) = 1 lies off the ellipsoid, along its normal, by

    h = -n sum u_i^2 ln |u_i| / (2 |x_i / a_i^2|),   u_i = x_i / a_i

to first order in n; the surface of this effect is the ellipsoid moved by just that. A superquadric may have one
exponent around its long axis and another along it (Barr 1981): the sum is that of the horizontal ellipses,

    u_x^2 ln |u_x| + u_z^2 ln |u_z| - l ln l / 2,   l = u_x^2 + u_z^2,

and of the arcs from pole to pole, the rest.
"""

from dataclasses import replace

import jax.numpy as jnp

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.ellipsoid import closest_point
from models.girdle import Girdle, chain_landmarks

_SMALLEST_SQUARE = 1e-12
"""u^2 ln u^2 goes to 0 with u; below this it is 0 to rounding and the logarithm must not be taken."""


def _offset_mm(point_mm, girdle: Girdle, around, along):
    """h at the point of the ellipsoid closest to the given one, for two exponents less 2."""
    relative, axes = jnp.broadcast_arrays(point_mm - girdle.centre_mm, girdle.semi_axes_mm)
    x = closest_point(relative, axes)
    squares = jnp.maximum((x / axes) ** 2, _SMALLEST_SQUARE)
    steepness = 2.0 * jnp.sqrt(jnp.sum((x / axes**2) ** 2, axis=0))
    x_part, y_part, z_part, level = (q * jnp.log(q) for q in (*squares, squares[0] + squares[2]))
    return -0.5 * (around * (x_part + z_part - level) + along * (level + y_part)) / steepness


def _adjust(girdle: Girdle, rotations: Rotations, exponents) -> tuple[Girdle, Rotations]:
    mean, apart = exponents
    at = chain_landmarks(girdle, *rotations)
    ts = girdle.ts_distance_mm + _offset_mm(at.TS, girdle, mean + apart, mean - apart)
    ai = girdle.ai_distance_mm + _offset_mm(at.AI, girdle, mean + apart, mean - apart)
    return replace(girdle, ts_distance_mm=ts, ai_distance_mm=ai), rotations


EFFECT = Effect(
    name="thorax_shape",
    what="the surface is not an ellipsoid (superquadric exponent - 2)",
    unit="1",
    channels=("exponent", "around less along, 1"),
    details=1,
    over_elevation=False,
    adjust=_adjust,
    prior=EffectPrior(
        scale=(0.3, 0.12),
        source="sphere misfit 8-10 mm (Paquet 2019)",
    ),
)
