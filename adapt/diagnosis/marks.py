"""Marks in a motion file: effects that its angles have by the way they were made, and landmark outliers.

A landmark outlier turns one bone in one posture. It cannot be a candidate: candidates are judged on motions and persons
that they were not fitted to, and an outlier in one posture predicts nothing about other postures. ``girdle convert``
finds outliers in the distances between landmarks, which no other cause changes, and marks them; a diagnosis leaves
these postures out.
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
    is_yes,
    marked_outliers,
)
from motions.table import Motions

_MADE_SO = (
    (ESTIMATED, "yes", "clavicle_axial_estimate"),  # an estimate of the axial rotation lags the true one
    (SCAPULA_ROTATED, "AA brought to AC", "scapula_landmark_bias"),  # a mean rotation is not the subject's
    (SCAPULA_FROM, ".", "skin_artefact"),  # a cluster lies on the skin
    (CLAVICLE_PLACED, "SC from|AC from", "clavicle_frame_bias"),  # an offset is not the subject's: it turns the bone
)
"""Column of the file, pattern of the mark, and the effect that it declares."""

_MOST = 0.5
"""Share of marked postures above which a mark counts for all postures."""


def declared_effects(motions: Motions) -> tuple[str, ...]:
    """List the effects that most postures are marked with; an estimated axial rotation only where there is one."""
    return tuple(effect for column, mark, effect in _MADE_SO if _marked(motions, column, mark).mean() > _MOST)


def _marked(motions: Motions, column: str, mark: str) -> Bool[np.ndarray, " postures"]:
    if column == ESTIMATED:
        return is_yes(motions, column) & np.isfinite(motions.angles_deg[:, CLAVICLE_X])
    return is_marked(motions, column, mark)


def angles_are_of_landmarks(motions: Motions) -> bool:
    """Check whether the angles were computed from the same landmarks, so that one error would count twice."""
    return bool(is_yes(motions, ANGLES_FROM_LANDMARKS).any())


def scapula_is_carried(motions: Motions) -> bool:
    """Check whether a cluster on the skin, and not the bone, carried AC and the landmarks of the scapula."""
    return bool(is_marked(motions, SCAPULA_FROM, ".").any())


def without_outliers(motions: Motions) -> tuple[Motions, tuple[str, ...]]:
    """Leave out the postures that are marked with a landmark outlier, and describe each outlier in a phrase."""
    outliers = marked_outliers(motions)
    if not outliers:
        return motions, ()
    named = tuple(
        f"{names} slipped in {motions.subject[row]}, {motions.motion[row]} {motions.posture[row]}"
        for row, names in outliers.items()
    )
    return motions.select(~np.isin(np.arange(len(motions.posture)), list(outliers))), named
