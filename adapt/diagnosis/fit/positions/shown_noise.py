"""Noise of the angles that measured positions show: the nearest posture is then nearest to all measurements.

Landmarks are compared with the girdle at the angles as they were measured (``fit.positions.position_rows``). The noise
e of the angles is therefore in the coordinates (H e) as well as in y (B e). Let C be the covariance of the coordinates
of a shoulder, constants and curves included. With c = ``PositionRows.values_mm`` the part of y that the coordinates do
not show is

    y - K (c + A a_s),   K = cov(B e, H e) C^-1,   of the covariance cov(y) - K cov(H e, B e)

It is independent of the coordinates: log p(y, positions) = log p(y | positions) + log p(positions). The part of the
coordinates that all shoulders have in common is taken for each shoulder's own here.
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
    """Terms that make y independent of the positions."""

    added: Float[np.ndarray, "rows 3 amplitudes+1"]
    """Terms added to y: one per amplitude, and a constant at the end."""
    known: tuple[Float[np.ndarray, "3*own 3*own"], ...]
    """Covariance subtracted from that of y of each shoulder; all rows of one constraint, then of the next."""

    def of(self, where: Int[np.ndarray, " own"]) -> Float[np.ndarray, "rows 3 own+1"]:
        """Select the terms of some amplitudes, and the constant."""
        return self.added[..., np.append(where, -1)]


def shown_noise(
    rows: PositionRows, shoulders: Shoulders, discrepancy: Discrepancy, seen: Bool[np.ndarray, " rows"] | None = None
) -> ShownNoise | None:
    """Compute ``ShownNoise`` of all rows or where ``seen`` is True; None where the positions share no noise with y."""
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
