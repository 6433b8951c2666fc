"""Basis of an effect, which turns amplitudes into strengths: constant, or over the elevation of the arm."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.table import Motions

FULL_ELEVATION_DEG = 150.0
"""Elevation at which the first term of a basis is 1."""


@dataclass(frozen=True)
class Basis:
    """Basis that turns amplitudes into strengths. The base class is constant: the strength is the amplitude."""

    sd: tuple[float, ...] = (1.0,)
    """Prior SD of each term, relative to the first term."""
    word: str = ""
    """Quantity that the strength follows, for the reader, such as 'elevation of the arm'; empty for a constant."""

    def channels(self, directions: int) -> int:
        """Return the number of channels in which an effect with this number of directions acts."""
        return directions

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Compute the strength in each channel of amplitudes of 1: direction by direction, each with all terms."""
        return np.broadcast_to(np.eye(directions)[..., None], (directions, directions, len(motions.posture)))

    def strengths(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Compute the strength of amplitudes of 1; a basis over bone angles takes the measured angles."""
        return self.columns(directions, motions)

    def felt(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Compute the part of the strength of amplitudes of 1 that counts towards the size: here the whole strength."""
        return self.strengths(directions, motions)

    def rms(self, directions: int, motions: Motions) -> Float[np.ndarray, " amplitudes"]:
        """Compute the size of amplitudes of 1: the root mean square of ``felt`` over the postures."""
        return root_mean_square(self.felt(directions, motions))


def root_mean_square(felt: Float[np.ndarray, "*any components postures"]) -> Float[np.ndarray, " *any"]:
    """Compute sqrt(mean over the postures of |vector|^2)."""
    return np.sqrt((felt**2).sum(axis=-2).mean(axis=-1))


@dataclass(frozen=True)
class Varying(Basis):
    """Basis that varies with the posture; its size leaves out the part that a constant of each subject explains."""

    least_rms: float = 0.0
    """Lower limit of ``rms``, for postures that differ less than those in which the size of the effect was measured."""

    def felt(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Compute the strength of amplitudes of 1 minus its mean over the postures of the subject."""
        found = np.array(self.strengths(directions, motions))
        for rows in motions.rows_by_subject():
            found[..., rows] -= found[..., rows].mean(axis=-1, keepdims=True)
        return found

    def rms(self, directions: int, motions: Motions) -> Float[np.ndarray, " amplitudes"]:
        """Compute the size of amplitudes of 1: the root mean square of ``felt``, at least ``least_rms``."""
        return np.maximum(super().rms(directions, motions), self.least_rms)


@dataclass(frozen=True)
class OverElevation(Varying):
    """Smooth basis over humeral elevation that is zero with the arm hanging.

    Terms with f = elevation / 150 deg: f, 4 f (1 - f) and 8 f (1 - f) (1 - 2 f), for a straight line, the amount of its
    bend, and the place of the bend. A ``late`` basis has f^2 in place of the first term. At f = 1 only the first term
    is not zero.
    """

    sd: tuple[float, ...] = (1.0, 0.3, 0.2)
    """Prior SD of each term, relative to the first term. Relative to the first, the second term is 0.2 to -0.4 for
    powers of the elevation from 1/2 to 3, -0.5 for a hinge at half the range, 0 for a smooth step; the third is up to
    0.2."""
    word: str = "elevation of the arm"
    least_rms: float = 0.12
    """Lower limit of ``rms``: that of a straight line over 60 degrees of elevation."""
    late: bool = False

    def terms(self, elevation_deg: Float[np.ndarray, " postures"]) -> Float[np.ndarray, "terms postures"]:
        """Compute the three terms; a missing elevation counts as 0, the arm hanging."""
        f = np.nan_to_num(elevation_deg) / FULL_ELEVATION_DEG
        bend = 4.0 * f * (1.0 - f)
        return np.stack([f**2 if self.late else f, bend, 2.0 * bend * (1.0 - 2.0 * f)])

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Compute the terms in the channel of each direction."""
        terms = self.terms(motions.humerus_elevation_deg)
        every = np.einsum("dc,tp->dtcp", np.eye(directions), terms)
        return every.reshape(directions * len(terms), directions, -1)


CONSTANT = Basis()
ELEVATION = OverElevation()
LATE = OverElevation(late=True)
