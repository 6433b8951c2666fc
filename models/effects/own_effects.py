"""Checks of user-defined effects before a fit uses them."""

from collections.abc import Iterable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from models.effects import EFFECTS, Effect
from models.effects.extended_girdle import ActiveEffects
from models.girdle import Girdle
from motions.rhythm import REST_DEG
from motions.rotations import DEG

_AWAY_DEG = 25.0
"""Distance from rest, in every angle, of the second posture of the check: effects of a raised arm act there too."""

_ROUNDING_MM = 1e-9

_FELT_MM = 1e-6


def is_user_defined(effect: Effect) -> bool:
    """Check whether an effect is user-defined: its name is not in ``EFFECTS``, or its ``adjust`` differs from there."""
    return effect.name not in EFFECTS or EFFECTS[effect.name].adjust is not effect.adjust


def check_own_effects(effects: Iterable[Effect], girdle: Girdle) -> None:
    """Check each user-defined effect: evaluate A1-A3 at strength 0 and at the prior's scale, at rest and off rest.

    ValueError where ``adjust`` fails or makes A1-A3 not finite, changes them at strength 0, or does not change them at
    the scale.
    """
    own = list(filter(is_user_defined, effects))
    if not own:
        return
    girdle = girdle.over_axes(1)
    postures = jnp.asarray(REST_DEG[:, None] + np.array([0.0, _AWAY_DEG])) / DEG
    base = np.asarray(girdle.residuals_mm(postures))
    for effect in own:
        channels = effect.basis.channels(len(effect.directions))
        scale = np.resize(effect.prior.scale, channels)
        at_zero = _residuals_mm(effect, girdle, postures, np.zeros(channels))
        if np.abs(at_zero - base).max() > _ROUNDING_MM:
            raise ValueError(f"effect {effect.name!r}: adjust changes A1-A3 at strength 0, the model without it")
        if np.abs(_residuals_mm(effect, girdle, postures, scale) - base).max() < _FELT_MM:
            raise ValueError(f"effect {effect.name!r}: adjust changes nothing at its scale {effect.prior.scale}")


def _residuals_mm(effect: Effect, girdle: Girdle, postures, strength) -> Float[np.ndarray, "3 postures"]:
    chain = ActiveEffects((jnp.asarray(strength)[:, None],), (effect,)).on(girdle)
    try:
        found = np.asarray(chain.residuals_mm(postures))
    except Exception as error:
        returns = "(girdle, (R_thorax_clavicle, R_thorax_scapula)), as it is given them"
        raise ValueError(f"effect {effect.name!r}: adjust fails: {error}. It returns {returns}") from error
    if not np.isfinite(found).all():
        raise ValueError(f"effect {effect.name!r}: adjust makes A1-A3 {found.ravel()} at strength {strength}")
    return found
