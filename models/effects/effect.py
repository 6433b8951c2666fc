"""Definition of an unmodelled effect: a small change of the girdle or of the measurement, with an amplitude.

Amplitude zero is the base model. An effect acts in the evaluation of the constraints, on the girdle and on the measured
rotations of the bones. Every fit that uses constraints can therefore use effects, one or several.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from models.effects.basis import CONSTANT, Basis
from models.effects.prior import AmplitudePrior, EffectPrior, amplitude_prior
from models.girdle import Girdle
from motions.arrays import Array
from motions.table import Motions

Rotations = tuple[Float[Array, " 3 3 *batch"], Float[Array, " 3 3 *batch"]]
"""Rotations R_thorax_clavicle and R_thorax_scapula of the bones."""

Adjust = Callable[[Girdle, Rotations, Float[Array, " channels *batch"]], tuple[Girdle, Rotations]]
"""Function of the base girdle, the measured rotations and the strength that returns the changed girdle and the true
rotations."""


def cause_of(name: str) -> str:
    """Return the cause in an effect's name: the part before the colon."""
    return name.partition(":")[0]


@dataclass(frozen=True)
class Effect:
    """Candidate effect with ``directions``; each has one amplitude, in ``unit``, per term of the basis."""

    name: str
    """Name of the cause; for a second basis, followed by a colon and the quantity that this basis follows."""
    what: str
    """Description of the change in one line."""
    unit: str
    directions: tuple[str, ...]
    adjust: Adjust
    prior: EffectPrior
    """Prior of the size."""
    basis: Basis = CONSTANT
    """Basis: turns amplitudes into the strength at each posture."""
    may_follow: tuple[str, ...] = ()
    """Bone angles that the effect may follow in place of the elevation of the arm, in a second basis
    (:func:`models.effects.by_posture.by_posture`)."""
    turns_thorax_about: Literal["", "IJ", "ellipsoid"] = ""
    """Centre about which the effect turns the measured thorax frame, in which bones and positions were measured, from
    the true frame: the origin IJ or the centre of the ellipsoid. Empty for an effect that does not turn this frame."""
    moves_landmarks: bool = True
    """True where the effect may move SC, AC or a landmark of the scapula in the measured thorax frame; False where it
    changes only the surface of the thorax or a distance."""
    plain_name: str = ""
    """Name of the cause for a reader of the report who does not know the project; if empty, the report has only
    ``name``."""
    strength_unit: str = ""
    """Unit of the strength, if it differs from the unit of the amplitudes."""

    def __post_init__(self) -> None:
        """Check the prior. ValueError if there is not one scale or sign per direction, or if a scale is not above 0."""
        count = len(self.directions)
        if len(self.prior.scale) != count or len(self.prior.sign) not in (0, count):
            raise ValueError(
                f"effect {self.name!r}: prior.scale and prior.sign need one value for each of {count} directions"
            )
        if not all(scale > 0.0 for scale in self.prior.scale):
            raise ValueError(f"effect {self.name!r}: prior.scale is {self.prior.scale}, and an SD is above 0")

    @property
    def cause(self) -> str:
        """Name up to the colon, the same for every basis of the effect."""
        return cause_of(self.name)

    @property
    def amplitudes(self) -> int:
        """Number of amplitudes: directions times terms of the basis."""
        return len(self.directions) * len(self.basis.sd)

    @property
    def size_unit(self) -> str:
        """Unit of the size, which is the unit of the strength and of the prior's scale."""
        return self.strength_unit or self.unit

    def amplitude_prior(self, motions: Motions) -> AmplitudePrior:
        """Compute the prior of each amplitude at these postures (:mod:`models.effects.prior`)."""
        return amplitude_prior(self.prior, self.basis.sd, self.basis.rms(len(self.directions), motions))

    def columns(self, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Compute the strength in each channel of each amplitude of 1, at every posture of the motions."""
        return self.basis.columns(len(self.directions), motions)

    def strengths(
        self, amplitude: Float[np.ndarray, " amplitudes"], motions: Motions
    ) -> Float[np.ndarray, "channels postures"]:
        """Compute the strength of the amplitudes in each channel, at every posture of the motions."""
        return np.einsum("a,acp->cp", np.asarray(amplitude, float), self.columns(motions))
