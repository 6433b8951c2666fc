"""How an effect's strength follows from its amplitudes: the same in all postures, or along the elevation of the arm."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.table import Motions

FULL_ELEVATION_DEG = 150.0
"""Elevation at which the first term of a course is at its height."""


@dataclass(frozen=True)
class Course:
    """Turns amplitudes into strengths. This one is constant, the strength is the amplitude; others derive from it."""

    sd: tuple[float, ...] = (1.0,)
    """Prior SD of each term, beside that of the first."""
    word: str = ""
    """What the strength goes with, for people: 'elevation of the arm'; empty for a constant."""

    def channels(self, directions: int) -> int:
        """Count the channels in which an effect of so many directions acts."""
        return directions

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Give the strength in each channel of amplitudes of 1: direction by direction, each with all terms."""
        return np.broadcast_to(np.eye(directions)[..., None], (directions, directions, len(motions.posture)))

    def strengths(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Give the strength of amplitudes of 1, along the angles as measured where it follows the bones."""
        return self.columns(directions, motions)

    def felt(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Give what counts as the size of an effect, of amplitudes of 1: all that it does."""
        return self.strengths(directions, motions)

    def rms(self, directions: int, motions: Motions) -> Float[np.ndarray, " amplitudes"]:
        """Compute the root mean square over the postures of what counts, of amplitudes of 1."""
        return root_mean_square(self.felt(directions, motions))


def root_mean_square(felt: Float[np.ndarray, "*any components postures"]) -> Float[np.ndarray, " *any"]:
    """Compute sqrt(mean over the postures of |vector|^2)."""
    return np.sqrt((felt**2).sum(axis=-2).mean(axis=-1))


@dataclass(frozen=True)
class Varying(Course):
    """A course that is not the same in all postures: of its size counts what a constant of each subject does not do."""

    least_rms: float = 0.0
    """Where postures hardly differ, an effect does less than where its size was measured: ``rms`` is no less."""

    def felt(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Give the strength of amplitudes of 1 less its mean over the postures of the subject."""
        found = np.array(self.strengths(directions, motions))
        for rows in motions.rows_by_subject():
            found[..., rows] -= found[..., rows].mean(axis=-1, keepdims=True)
        return found

    def rms(self, directions: int, motions: Motions) -> Float[np.ndarray, " amplitudes"]:
        """Compute the root mean square over the postures of what counts, of amplitudes of 1."""
        return np.maximum(super().rms(directions, motions), self.least_rms)


@dataclass(frozen=True)
class OverElevation(Varying):
    """A smooth course over humeral elevation that is zero with the arm hanging.

    Terms f, 4 f (1 - f) and 8 f (1 - f) (1 - 2 f) of f = elevation / 150 deg: a straight line, how much it bends, and
    where; f^2 in place of f for one that comes ``late``. The first alone is not zero with the arm up.
    """

    sd: tuple[float, ...] = (1.0, 0.3, 0.2)
    """Powers of the elevation from 1/2 to 3, a hinge at half the range and a smooth step have second terms of 0.2,
    -0.4, -0.5 and 0, third ones up to 0.2."""
    word: str = "elevation of the arm"
    least_rms: float = 0.12
    """Of a straight line over 60 degrees of elevation."""
    late: bool = False

    def terms(self, elevation_deg: Float[np.ndarray, " postures"]) -> Float[np.ndarray, "terms postures"]:
        """Compute the three terms; a missing elevation counts as the arm hanging."""
        f = np.nan_to_num(elevation_deg) / FULL_ELEVATION_DEG
        bend = 4.0 * f * (1.0 - f)
        return np.stack([f**2 if self.late else f, bend, 2.0 * bend * (1.0 - 2.0 * f)])

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Give the terms in the channel of each direction."""
        terms = self.terms(motions.humerus_elevation_deg)
        every = np.einsum("dc,tp->dtcp", np.eye(directions), terms)
        return every.reshape(directions * len(terms), directions, -1)


CONSTANT = Course()
ELEVATION = OverElevation()
LATE = OverElevation(late=True)
