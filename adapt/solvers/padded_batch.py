"""Motions as padded arrays: component first, then the postures of a subject, then subjects.

Subjects have different numbers of postures. Padding postures are copies of the subject's last one and do not count.
Their number is rounded up, so that few distinct shapes are ever compiled.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from motions.landmarks.sampled_postures import marked_slips
from motions.rotations import DEG
from motions.table import Motions

ON_THE_THORAX = ("TS", "AI")
"""The landmarks whose distance to the ellipsoid the model keeps, in the order of A1 and A2."""

_POSTURE_STEP = 2
"""Postures are padded to a multiple of this."""


@dataclass(frozen=True)
class Batch:
    """P postures, padding included, of S subjects."""

    angles: Float[np.ndarray, " 6 postures subjects"]
    """Measured angles s, rad; 0 where not measured."""
    measured: Bool[np.ndarray, " 6 postures subjects"]
    counted: Bool[np.ndarray, " postures subjects"]
    rows: Int[np.ndarray, "postures subjects"]
    """Row of the motions that each element came from."""
    subjects: tuple[str, ...]
    """Their names, along the last axis."""
    landmarks_mm: Float[np.ndarray, " 3 2 postures subjects"] | None
    """Measured TS and AI, thorax frame, NaN where not measured or slipped; None where nobody has one."""

    def unpack(self, values: Float[np.ndarray, " *k postures subjects"]) -> Float[np.ndarray, " *k rows"]:
        """Put the values of the counted postures in the order of the motions' rows; axes before the postures stay."""
        result = np.empty((*values.shape[:-2], int(self.counted.sum())), values.dtype)
        result[..., self.rows[self.counted]] = values[..., self.counted]
        return result


def pack(motions: Motions) -> Batch:
    """Pack the motions of one or many subjects into one batch."""
    subjects = motions.subjects
    number = {name: k for k, name in enumerate(subjects)}
    of_row = np.array([number[name] for name in motions.subject])
    counts = np.bincount(of_row, minlength=len(subjects))
    postures = -(-counts.max(initial=0) // _POSTURE_STEP) * _POSTURE_STEP
    place = np.minimum(np.arange(postures)[:, None], counts - 1)
    index = np.argsort(of_row, kind="stable")[np.cumsum(counts) - counts + place]
    angles = np.moveaxis(motions.angles_deg[index], -1, 0)
    measured = np.isfinite(angles)
    return Batch(
        angles=np.where(measured, angles, 0.0) / DEG,
        measured=measured,
        counted=np.arange(postures)[:, None] < counts,
        rows=index,
        subjects=subjects,
        landmarks_mm=_landmarks_mm(motions, index),
    )


def _landmarks_mm(motions: Motions, index: Int[np.ndarray, "postures subjects"]):
    if not any(name in motions.landmarks_mm for name in ON_THE_THORAX):
        return None
    nothing = np.full((len(motions.posture), 3), np.nan)
    both = np.stack([motions.landmarks_mm.get(name, nothing) for name in ON_THE_THORAX])
    for row, names in marked_slips(motions).items():
        both[np.isin(ON_THE_THORAX, names.split()), row] = np.nan
    return np.moveaxis(both[:, index], -1, 0)
