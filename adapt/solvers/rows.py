"""Measured postures of motions as arrays: one row per posture, or padded to equally many postures per subject.

Component first; the last axis is the row, or the last two axes are postures and subjects. Subjects have different
numbers of postures: padding postures are copies of the subject's last posture and do not count. The padded number is
rounded up, so that few distinct shapes are ever compiled.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import DTypeLike

from adapt.solvers.unmeasured import at_rest
from models.effects import EFFECTS, ActiveEffects, Effect
from models.effects.amplitudes import NO_EFFECTS, Amplitudes, active_effects
from motions.landmarks.sampled_postures import measured_places_mm
from motions.rotations import DEG
from motions.table import Motions

_POSTURE_STEP = 2
"""Postures are padded to a multiple of this number."""


@dataclass(frozen=True)
class PostureRows:
    """Rows of the motions of S subjects."""

    angles: Float[np.ndarray, "6 rows"]
    """Measured angles s, rad; angles of the arm at rest where not measured."""
    measured: Bool[np.ndarray, "6 rows"]
    subject: Int[np.ndarray, " rows"]
    """Index of the subject."""
    motion: Int[np.ndarray, " rows"]
    """Index among the kinds of motion."""
    previous: Int[np.ndarray, " rows"]
    """Row of the previous posture in the motion, -1 for the first."""
    subjects: tuple[str, ...]
    """Names of the subjects."""
    landmarks_mm: Mapping[str, Float[np.ndarray, "3 rows"]]
    """Measured positions, thorax frame, by landmark; NaN where the landmark was not measured, was estimated or is an
    outlier."""
    active_effects: ActiveEffects
    """Effects with strengths (channels, rows)."""

    @cached_property
    def counted(self) -> Bool[np.ndarray, "postures subjects"]:
        """True where a posture of the padded subjects is a row, False for padding."""
        counts = np.bincount(self.subject, minlength=len(self.subjects))
        postures = -(-counts.max(initial=0) // _POSTURE_STEP) * _POSTURE_STEP
        return np.arange(postures)[:, None] < counts

    @cached_property
    def place(self) -> Int[np.ndarray, "postures subjects"]:
        """Row of each posture of the padded subjects."""
        counts = self.counted.sum(axis=0)
        nearest = np.minimum(np.arange(len(self.counted))[:, None], counts - 1)
        return np.argsort(self.subject, kind="stable")[np.cumsum(counts) - counts + nearest]

    @cached_property
    def posture(self) -> Int[np.ndarray, " rows"]:
        """Index of every row among the postures of its subject."""
        return self.unpacked(np.indices(self.counted.shape)[0])

    def packed(self, values: Float[np.ndarray, "*k rows"]) -> Float[np.ndarray, "*k postures subjects"]:
        """Arrange values of the rows by subject, with padding."""
        return values[..., self.place]

    def unpacked(self, values: Float[np.ndarray, "*k postures subjects"]) -> Float[np.ndarray, "*k rows"]:
        """Return the values of the counted postures in the order of the rows; axes before the postures stay."""
        result = np.empty((*values.shape[:-2], len(self.subject)), values.dtype)
        result[..., self.place[self.counted]] = values[..., self.counted]
        return result

    def repeated(self, times: int, dtype: DTypeLike = float) -> "PostureRows":
        """Repeat all rows, as for several models, with angles of type ``dtype``."""
        count = len(self.subject)
        before = [np.where(self.previous < 0, -1, self.previous + k * count) for k in range(times)]
        return replace(
            self,
            angles=np.tile(self.angles, times).astype(dtype, copy=False),
            measured=np.tile(self.measured, times),
            subject=np.tile(self.subject, times),
            motion=np.tile(self.motion, times),
            previous=np.concatenate(before),
            landmarks_mm={name: np.tile(place, times) for name, place in self.landmarks_mm.items()},
            active_effects=self.active_effects.at(np.tile(np.arange(count), times)),
        )


def posture_rows(
    motions: Motions, effects: Amplitudes = NO_EFFECTS, library: Mapping[str, Effect] = EFFECTS
) -> PostureRows:
    """Convert the motions of one or many subjects to rows, with effects that are known to be active.

    ``library``: effects by name.
    """
    measured = np.isfinite(motions.angles_deg.T)
    return PostureRows(
        angles=at_rest(motions.angles_deg.T / DEG, measured),
        measured=measured,
        subject=motions.subject_number,
        motion=np.unique(motions.motion.astype(str), return_inverse=True)[1],
        previous=motions.previous_rows(),
        subjects=motions.subjects,
        landmarks_mm=measured_places_mm(motions),
        active_effects=active_effects(effects, motions, library),
    )


def one_in_so_many(subjects: Sequence[str], most: int) -> tuple[str, ...]:
    """Select at most ``most`` subjects at regular intervals, in the order of the files."""
    return tuple(subjects[:: -(-len(subjects) // most)])
