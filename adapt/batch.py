"""Motions as padded arrays: component first, then the postures of a subject, then subjects.

Subjects have different numbers of postures. Padding postures are copies of the subject's last one and do not count;
padding subjects are copies of the last subject and are dropped from every result. Shapes are rounded up, so that few
distinct ones are ever compiled.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from motions.rotations import DEG
from motions.table import Motions

_POSTURE_STEP = 4
"""Postures are padded to a multiple of this."""


@dataclass(frozen=True)
class Batch:
    """P postures of S subjects, padding included."""

    angles: Float[Array, " 6 postures subjects"]
    """Measured angles s, rad; 0 where not measured."""
    measured: Bool[Array, " 6 postures subjects"]
    counted: Bool[Array, " postures subjects"]
    rows: Int[np.ndarray, "postures subjects"]
    """Row of the motions that each element came from."""
    subjects: tuple[str, ...]
    """Names of the real subjects, the first ones along the last axis."""

    def unpack(self, values: Float[np.ndarray, " *k postures subjects"]) -> Float[np.ndarray, " *k rows"]:
        """Values of the counted postures in the order of the motions' rows; axes before the postures stay."""
        real = np.array(self.counted)
        real[:, len(self.subjects) :] = False
        result = np.empty((*values.shape[:-2], int(real.sum())), values.dtype)
        result[..., self.rows[real]] = values[..., real]
        return result


def pack(motions: Motions) -> Batch:
    """The motions of one or many subjects as one batch."""
    subjects = motions.subjects
    rows = [np.flatnonzero(motions.subject == name) for name in subjects]
    postures = -(-max(map(len, rows)) // _POSTURE_STEP) * _POSTURE_STEP
    lanes = 1 << (len(rows) - 1).bit_length()
    padded = [np.pad(r, (0, postures - len(r)), mode="edge") for r in rows]
    index = np.stack(padded + [padded[-1]] * (lanes - len(rows)), axis=1)
    counts = np.array([len(r) for r in rows] + [len(rows[-1])] * (lanes - len(rows)))
    angles = np.moveaxis(motions.angles_deg[index], -1, 0)
    measured = np.isfinite(angles)
    return Batch(
        angles=jnp.asarray(np.where(measured, angles, 0.0) / DEG),
        measured=jnp.asarray(measured),
        counted=jnp.asarray(np.arange(postures)[:, None] < counts),
        rows=index,
        subjects=subjects,
    )
