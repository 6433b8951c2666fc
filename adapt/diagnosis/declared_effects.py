"""What a motion file says of itself: effects that its angles have by the way they were made."""

import numpy as np
from jaxtyping import Bool

from motions.landmarks.girdle_angles import CLAVICLE_X
from motions.landmarks.sampled_postures import CLAVICLE_PLACED, ESTIMATED, SCAPULA_ROTATED, is_marked
from motions.table import Motions

_MADE_SO = (
    (ESTIMATED, "yes", "clavicle_axial_estimate"),  # an estimate of the axial rotation lags the true one
    (SCAPULA_ROTATED, "AA brought to AC", "scapula_landmark_bias"),  # a mean rotation is not the subject's
    (CLAVICLE_PLACED, "SC from|AC from", "clavicle_frame_bias"),  # nor is an offset: it turns the clavicle
)
"""Column, mark, effect."""


def declared_effects(motions: Motions) -> tuple[str, ...]:
    """Name the effects that most postures are marked with; an estimate only where the angle is there."""
    return tuple(effect for column, mark, effect in _MADE_SO if _marked(motions, column, mark).mean() > _MOST)


def _marked(motions: Motions, column: str, mark: str) -> Bool[np.ndarray, " postures"]:
    marked = is_marked(motions, column, mark)
    return marked & np.isfinite(motions.angles_deg[:, CLAVICLE_X]) if column == ESTIMATED else marked


_MOST = 0.5
