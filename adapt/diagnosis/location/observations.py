"""Measurements of all subjects as padded arrays."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.rows import PostureRows
from motions.table import Motions


@dataclass(frozen=True)
class Observed:
    """Postures of S subjects, padded to P."""

    angles: Float[np.ndarray, "6 postures subjects"]
    """Measured angles, rad; those of a girdle at rest where not measured."""
    measured: Bool[np.ndarray, "6 postures subjects"]
    """True where an angle was measured; False in padding."""
    elevation_deg: Float[np.ndarray, "postures subjects"]
    motion: Int[np.ndarray, "postures subjects"]
    """Index of the motion in ``motions``."""
    subjects: tuple[str, ...]
    motions: tuple[str, ...]


def observe(motions: Motions, rows: PostureRows) -> Observed:
    """Arrange the motions by subject, packed like ``rows``. A missing elevation counts as the arm hanging."""
    names = tuple(dict.fromkeys(motions.motion.tolist()))
    number = np.array([names.index(name) for name in motions.motion.tolist()])
    return Observed(
        angles=rows.packed(rows.angles),
        measured=rows.packed(rows.measured) & rows.counted,
        elevation_deg=rows.packed(np.nan_to_num(motions.humerus_elevation_deg)),
        motion=rows.packed(number),
        subjects=rows.subjects,
        motions=names,
    )
