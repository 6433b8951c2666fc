"""What a motion file says of itself: effects that its angles have by the way they were made, and slips.

A slip turns one bone in one posture. A candidate is judged by what it predicts of motions and persons that it was not
fitted to, and the slip of one posture predicts nothing of another: it can be no candidate. ``girdle convert`` finds it
in the distances between landmarks, which no other cause changes, and marks it; the posture is no part of a diagnosis.
"""

import numpy as np
from jaxtyping import Bool

from motions.landmarks.clusters.carried_columns import SCAPULA_FROM
from motions.landmarks.girdle_angles import CLAVICLE_X
from motions.landmarks.sampled_postures import (
    ANGLES_FROM_LANDMARKS,
    CLAVICLE_PLACED,
    ESTIMATED,
    SCAPULA_ROTATED,
    is_marked,
    marked_slips,
)
from motions.table import Motions

_MADE_SO = (
    (ESTIMATED, "yes", "clavicle_axial_estimate"),  # an estimate of the axial rotation lags the true one
    (SCAPULA_ROTATED, "AA brought to AC", "scapula_landmark_bias"),  # a mean rotation is not the subject's
    (SCAPULA_FROM, ".", "skin_artefact"),  # a cluster lies on the skin
    (CLAVICLE_PLACED, "SC from|AC from", "clavicle_frame_bias"),  # nor is an offset: it turns the clavicle
)
"""Column, mark, effect."""

_YES = r"(?i)^\s*(?:yes|y|true|1)\s*$"
"""What people write for it: a word that is not known would let one error count twice in silence."""

_MOST = 0.5
"""Of the postures, from which a mark is of all of them."""


def declared_effects(motions: Motions) -> tuple[str, ...]:
    """Name the effects that most postures are marked with; an estimate only where the angle is there."""
    return tuple(effect for column, mark, effect in _MADE_SO if _marked(motions, column, mark).mean() > _MOST)


def _marked(motions: Motions, column: str, mark: str) -> Bool[np.ndarray, " postures"]:
    marked = is_marked(motions, column, mark)
    return marked & np.isfinite(motions.angles_deg[:, CLAVICLE_X]) if column == ESTIMATED else marked


def angles_are_of_landmarks(motions: Motions) -> bool:
    """Tell whether angles were computed from the same landmarks: one error would count twice."""
    return bool(is_marked(motions, ANGLES_FROM_LANDMARKS, _YES).any())


def scapula_is_carried(motions: Motions) -> bool:
    """Tell whether a cluster on the skin carried the landmarks of the scapula and AC: they are not on the bone."""
    return bool(is_marked(motions, SCAPULA_FROM, ".").any())


def without_slips(motions: Motions) -> tuple[Motions, tuple[str, ...]]:
    """Leave out the postures that are marked with a slip; and say which landmark slipped where."""
    slips = marked_slips(motions)
    if not slips:
        return motions, ()
    named = tuple(
        f"{names} slipped in {motions.subject[row]}, {motions.motion[row]} {motions.posture[row]}"
        for row, names in slips.items()
    )
    return motions.select(~np.isin(np.arange(len(motions.posture)), list(slips))), named
