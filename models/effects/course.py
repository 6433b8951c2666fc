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
    """Prior SD of each term, as a fraction of the effect's scale."""
    word: str = ""
    """What the strength goes with, for people: 'elevation of the arm'; empty for a constant."""

    def channels(self, directions: int) -> int:
        """Count the channels in which an effect of so many directions acts."""
        return directions

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Give the strength in each channel of amplitudes of 1: direction by direction, each with all terms."""
        return np.broadcast_to(np.eye(directions)[..., None], (directions, directions, len(motions.posture)))


@dataclass(frozen=True)
class OverElevation(Course):
    """A smooth course over humeral elevation that is zero with the arm hanging.

    Terms f, 4 f (1 - f) and 8 f (1 - f) (1 - 2 f) of f = elevation / 150 deg: a straight line, how much it bends, and
    where; f^2 in place of f for one that comes ``late``. The first alone is not zero with the arm up.
    """

    sd: tuple[float, ...] = (1.0, 0.3, 0.2)
    """Powers of the elevation from 1/2 to 3, a hinge at half the range and a smooth step have second terms of 0.2,
    -0.4, -0.5 and 0, third ones up to 0.2."""
    word: str = "elevation of the arm"
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
