"""The measured clavicle frame is turned in the bone by a constant, its axial zero foremost.

Landmarks give a clavicle two axes and no third: each laboratory chooses the zero of its axial rotation. A conoid
attachment turned round the clavicle by as much looks the same.
"""

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """R_true = R_measured B."""
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
