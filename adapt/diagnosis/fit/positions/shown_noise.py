"""What measured positions show of the noise of the angles: the nearest posture is nearest in all that was measured.

Landmarks are compared with the girdle at the angles as they were measured (``fit.positions.position_rows``). So noise
of the angles is in them, H e, as it is in y, B e. With C the covariance of the coordinates of a shoulder, what its
constants and curves do within it, the part of y that they do not show is

    y - K (c + A a_s),   K = cov(B e, H e) C^-1,   of the covariance cov(y) - K cov(H e, B e)

independent of them: log p(y, positions) = log p(y | positions) + log p(positions). What all shoulders have in common of
the coordinates is here taken for each shoulder's own.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.discrepancy import Discrepancy
from adapt.diagnosis.fit.evidence import without
from adapt.diagnosis.fit.positions.position_evidence import grams_with, sizes_of_curves
from adapt.diagnosis.fit.positions.position_rows import PositionRows
from adapt.diagnosis.fit.shoulders import Shoulders


class ShownNoise(NamedTuple):
    """What makes y independent of the positions."""

    added: Float[np.ndarray, "rows 3 amplitudes+1"]
    """To y: of every amplitude, and without any."""
    known: tuple[Float[np.ndarray, "3*own 3*own"], ...]
    """What goes from the covariance of y of each shoulder; all rows of one constraint, then of the next."""

    def of(self, where: Int[np.ndarray, " own"]) -> Float[np.ndarray, "rows 3 own+1"]:
        """Take what is added of some amplitudes, and without any."""
        return self.added[..., np.append(where, -1)]


def shown_noise(
    rows: PositionRows, shoulders: Shoulders, discrepancy: Discrepancy, seen: Bool[np.ndarray, " rows"] | None = None
) -> ShownNoise | None:
    """Compute what positions show, of all rows or of those that are seen; None where angles share no noise with it."""
    if rows.noise_in_y is None:
        return None
    noise_deg, sizes = discrepancy.noise_deg, sizes_of_curves(discrepancy)
    across = noise_deg**2 * rows.by_angle @ np.swapaxes(rows.noise_in_y, 1, 2)

    def both(own: Int[np.ndarray, " own"]) -> Float[np.ndarray, "own n 3*own"]:
        """Lay out cov(H e, B e) of a shoulder."""
        found, at = np.zeros((len(own), across.shape[1], 3, len(own))), np.arange(len(own))
        found[at, :, :, at] = across[own]
        return found.reshape(*found.shape[:2], -1)

    added, known = np.zeros((len(across), 3, rows.by_amplitude.shape[2] + 1)), []
    for own, gram in grams_with(rows, shoulders, noise_deg, discrepancy.length_deg, seen, both):
        size = sizes[gram.size]
        first = len(size) - added.shape[2] - 3 * len(own)
        matrix = size[:, None] * gram.matrix * size
        matrix[:first, :first] += np.eye(first)
        rest, _ = without(matrix, first)
        shown = rest[added.shape[2] :]
        added[own] = -np.moveaxis(shown[:, : added.shape[2]].reshape(3, len(own), -1), 0, 1)
        known.append(shown[:, added.shape[2] :])
    return ShownNoise(added, tuple(known))
