"""The measured scapula frame is turned in the bone by a constant: AC for AA, or a landmark palpated wrong.

Where TS and AI themselves are palpated wrong, they are also seen in a wrong place: turned about AC, like the frame.
"""

import jax.numpy as jnp

from models.effects.effect import Effect, Points, Rotations, rotate_points
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """R_measured = R_true B, so R_true = R_measured B'."""
    R_thorax_clavicle, R_thorax_measured = rotations
    R_measured_scapula = jnp.swapaxes(rotation_from_vector(deg[:3] / DEG), 0, 1)
    return girdle, (R_thorax_clavicle, compose(R_thorax_measured, R_measured_scapula))


def _show(points: Points, girdle: Girdle, rotations: Rotations, deg) -> Points:
    """R_measured P R_measured' turns TS and AI about AC; with P = B they are where the measured frame has them."""
    R_thorax_measured = rotations[1]
    palpated = compose(R_thorax_measured, rotation_from_vector(deg[3:] / DEG))
    turn = compose(palpated, jnp.swapaxes(R_thorax_measured, 0, 1))
    seen_there, AC, TS_AI = points[:, :2], points[:, 1:2], points[:, 2:]
    return jnp.concatenate([seen_there, AC + rotate_points(turn, TS_AI - AC)], axis=1)


EFFECT = Effect(
    name="scapula_landmark_bias",
    what="constant rotation of the measured scapula in its own frame",
    unit="deg",
    channels=(
        *("about x", "about y", "about z"),
        *("TS and AI about x, deg", "TS and AI about y, deg", "TS and AI about z, deg"),
    ),
    details=3,
    over_elevation=False,
    adjust=_adjust,
    show=_show,
    prior=EffectPrior(
        scale=(7.0,) * 6,
        source="Ludewig 2010: 12.4 / 6.1 / 11.6 deg between AC and AA frames",
    ),
)
