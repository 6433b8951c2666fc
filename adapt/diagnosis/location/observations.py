"""The measurements of all subjects as padded arrays."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.padded_batch import Batch
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class Observed:
    """The postures of S subjects, padded to P."""

    angles: Float[np.ndarray, "6 postures subjects"]
    """Rad; those of a girdle at rest where not measured."""
    measured: Bool[np.ndarray, "6 postures subjects"]
    """In postures that count."""
    elevation_deg: Float[np.ndarray, "postures subjects"]
    motion: Int[np.ndarray, "postures subjects"]
    """Number of the motion among all of the data."""
    subjects: tuple[str, ...]
    motions: tuple[str, ...]


def observe(motions: Motions, batch: Batch) -> Observed:
    """Arrange the motions as the batch is. A missing elevation counts as the arm hanging."""
    angles = np.moveaxis(motions.angles_deg[batch.rows], -1, 0) / DEG
    names = tuple(dict.fromkeys(motions.motion.tolist()))
    number = np.array([names.index(name) for name in motions.motion.tolist()])
    return Observed(
        angles=np.where(np.isfinite(angles), angles, (REST_DEG / DEG)[:, None, None]),
        measured=np.isfinite(angles) & batch.counted,
        elevation_deg=np.nan_to_num(motions.humerus_elevation_deg)[batch.rows],
        motion=number[batch.rows],
        subjects=batch.subjects,
        motions=names,
    )
