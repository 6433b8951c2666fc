"""The measurements of all subjects: angles and landmark positions as padded arrays."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.padded_batch import Batch, pack
from models.effects.effect import SHOWN
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class Observed:
    """The postures of S subjects, padded to P."""

    values: Float[np.ndarray, "quantities postures subjects"]
    """Six angles in rad and, where any landmark was measured, the coordinates of SHOWN in mm; where an angle was not
    measured that of a girdle at rest, where a coordinate was not, 0."""
    measured: Bool[np.ndarray, "quantities postures subjects"]
    elevation_deg: Float[np.ndarray, "postures subjects"]
    counted: Bool[np.ndarray, "postures subjects"]
    motion: Int[np.ndarray, "postures subjects"]
    """Number of the motion among all of the data."""
    subjects: tuple[str, ...]
    motions: tuple[str, ...]

    def without(self, left_out: Bool[np.ndarray, "postures subjects"]) -> "Observed":
        """Leave some postures out: they stay, but are not counted."""
        return replace(self, counted=self.counted & ~left_out)


def observe(motions: Motions, batch: Batch | None = None) -> Observed:
    """Arrange the motions by subject, as padded arrays. A missing elevation counts as the arm hanging."""
    batch = pack(motions) if batch is None else batch
    rows = batch.rows
    values = motions.angles_deg / DEG
    if any(name in motions.landmarks_mm for name in SHOWN):
        nothing = np.full((len(values), 3), np.nan)
        positions = [motions.landmarks_mm.get(name, nothing) for name in SHOWN]
        values = np.concatenate([values, np.stack(positions, axis=1).reshape(len(values), -1)], axis=1)
    values = np.moveaxis(np.asarray(values)[rows], -1, 0)
    names = tuple(dict.fromkeys(motions.motion.tolist()))
    number = np.array([names.index(name) for name in motions.motion.tolist()])
    absent = np.zeros(len(values))
    absent[:6] = REST_DEG / DEG
    return Observed(
        values=np.where(np.isfinite(values), values, absent[:, None, None]),
        measured=np.isfinite(values),
        elevation_deg=np.nan_to_num(motions.humerus_elevation_deg)[rows],
        counted=batch.counted,
        motion=number[rows],
        subjects=batch.subjects,
        motions=names,
    )
