"""What an unmodelled effect is: a small change of the girdle, or of what was measured, with an amplitude.

Amplitude zero is the base model. An effect acts where the constraints are evaluated, on the girdle and on the bones'
rotations as they would be measured, so that every fit that takes constraints takes effects, alone or together.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from models.effects.course import CONSTANT, Course
from models.effects.prior import AmplitudePrior, EffectPrior, amplitude_prior
from models.girdle import Girdle
from motions.arrays import Array
from motions.table import Motions

Rotations = tuple[Float[Array, " 3 3 *batch"], Float[Array, " 3 3 *batch"]]
"""R_thorax_clavicle, R_thorax_scapula."""

Adjust = Callable[[Girdle, Rotations, Float[Array, " channels *batch"]], tuple[Girdle, Rotations]]
"""The girdle and the true rotations, from the base girdle, the rotations as measured, and the strength there."""


def cause_of(name: str) -> str:
    """Give the cause of an effect's name: what stands before the colon."""
    return name.partition(":")[0]


@dataclass(frozen=True)
class Effect:
    """One candidate: ``directions``, each with an amplitude in ``unit`` for each term of its course."""

    name: str
    """Of the cause; after a colon what its course goes with, where it has another course than the first."""
    what: str
    """What it changes, one line."""
    unit: str
    directions: tuple[str, ...]
    adjust: Adjust
    prior: EffectPrior
    """What is believed about its size before any data."""
    course: Course = CONSTANT
    """How the strength follows from the amplitudes at each posture."""
    may_follow: tuple[str, ...] = ()
    """Bone angles that it may follow in place of the elevation of the arm: then it has a second course
    (:func:`models.effects.by_posture.by_posture`)."""
    turns_thorax_about: Literal["", "IJ", "ellipsoid"] = ""
    """The point about which it turns the measured thorax frame, both bones alike, from the true one: the origin IJ or
    the centre of the ellipsoid. Positions were measured in that frame too. Empty: it does not."""
    moves_landmarks: bool = True
    """Whether SC, AC or a landmark of the scapula may lie elsewhere in the measured thorax with it; False of one that
    changes the surface of the thorax or a distance alone."""
    plain_name: str = ""
    """Of the cause, for a reader of the report who does not know the project; without one its name stands alone."""
    strength_unit: str = ""
    """Of what it does, where its amplitudes have another unit."""

    def __post_init__(self) -> None:
        """Check the prior. ValueError if scales or signs are not one a direction, or a scale is not above 0."""
        count = len(self.directions)
        if len(self.prior.scale) != count or len(self.prior.sign) not in (0, count):
            raise ValueError(
                f"effect {self.name!r}: prior.scale and prior.sign need one value for each of {count} directions"
            )
        if not all(scale > 0.0 for scale in self.prior.scale):
            raise ValueError(f"effect {self.name!r}: prior.scale is {self.prior.scale}, and an SD is above 0")

    @property
    def cause(self) -> str:
        """What is active, whatever its course: the name up to the colon."""
        return cause_of(self.name)

    @property
    def amplitudes(self) -> int:
        """How many numbers describe this effect."""
        return len(self.directions) * len(self.course.sd)

    @property
    def size_unit(self) -> str:
        """The unit of its size: of what it does, and of the scale of its prior."""
        return self.strength_unit or self.unit

    def amplitude_prior(self, motions: Motions) -> AmplitudePrior:
        """Compute the prior of each amplitude for these postures (:mod:`models.effects.prior`)."""
        return amplitude_prior(self.prior, self.course.sd, self.course.rms(len(self.directions), motions))

    def columns(self, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Give the strength in each channel that each amplitude of 1 has at every posture of the motions."""
        return self.course.columns(len(self.directions), motions)

    def strengths(
        self, amplitude: Float[np.ndarray, " amplitudes"], motions: Motions
    ) -> Float[np.ndarray, "channels postures"]:
        """Compute the strength in each channel at every posture of the motions."""
        return np.einsum("a,acp->cp", np.asarray(amplitude, float), self.columns(motions))
