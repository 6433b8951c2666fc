"""The measured scapula frame is turned in the bone by a constant rotation: AC for AA, or a landmark palpated wrong."""

from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.arrays import xp
from motions.rotations import DEG, compose, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Compute R_true = R_measured B' of the scapula, from R_measured = R_true B."""
    R_thorax_clavicle, R_thorax_measured = rotations
    R_measured_scapula = xp.swapaxes(rotation_from_vector(deg / DEG), 0, 1)
    return girdle, (R_thorax_clavicle, compose(R_thorax_measured, R_measured_scapula))


EFFECT = Effect(
    name="scapula_landmark_bias",
    plain_name="scapula frame turned",
    what="constant rotation of the measured scapula in its own frame",
    unit="deg",
    directions=("about x", "about y", "about z"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(7.0, 7.0, 7.0),
        source="Ludewig 2010: 12.4 / 6.1 / 11.6 deg between AC and AA frames",
    ),
)
