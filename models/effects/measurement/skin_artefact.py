"""A marker on the skin lags behind the scapula, most of it above 90 degrees."""

import jax.numpy as jnp

from models.effects.effect import Effect, Points, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotate, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """R_true = R_measured exp(lag): the bone has turned further, about its own axes, than the skin shows."""
    R_thorax_clavicle, R_thorax_measured = rotations
    return girdle, (R_thorax_clavicle, compose(R_thorax_measured, rotation_from_vector(deg / DEG)))


def _show(points: Points, girdle: Girdle, rotations: Rotations, deg) -> Points:
    """TS and AI are found from the marker: they stay behind with it."""
    SC, AC, _, _ = jnp.moveaxis(points, 1, 0)
    _, R_thorax_measured = rotations
    TS, AI = (AC + rotate(R_thorax_measured, arm) for arm in (girdle.ts_mm, girdle.ai_mm))
    return jnp.stack([SC, AC, TS, AI], axis=1)


EFFECT = Effect(
    name="skin_artefact",
    what="a skin marker lags the scapula, more above 90 deg",
    unit="deg",
    channels=("about x", "about y", "about z"),
    over_elevation=True,
    late=True,
    adjust=_adjust,
    show=_show,
    prior=EffectPrior(
        scale=(5.0, 3.0, 7.0),
        sign=(1, 0, 1),
        source="Meskers 2007, van Andel 2009, Warner 2012: 6-13 deg",
    ),
)
