"""The measured clavicle frame is turned in the bone by a constant rotation, mostly about the clavicle's axis.

Two landmarks do not determine the axial rotation of a clavicle, so each laboratory chooses its zero. A conoid
attachment turned round the clavicle by the same angle has the same effect.
"""

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Compute R_true = R_measured B of the clavicle."""
    R_thorax_measured, R_thorax_scapula = rotations
    return girdle, (compose(R_thorax_measured, rotation_from_vector(deg / DEG)), R_thorax_scapula)


EFFECT = Effect(
    name="clavicle_frame_bias",
    plain_name="clavicle frame turned",
    what="constant rotation of the measured clavicle in its own frame",
    unit="deg",
    directions=("about x", "about y", "about z"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(25.0, 8.0, 8.0),
        source="published axial zeros differ by 35 deg",
    ),
)
