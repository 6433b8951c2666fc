"""What an unmodelled effect is: a small change of the girdle, or of what was measured, with an amplitude.

Amplitude zero is the base model. An effect acts where the constraints are evaluated, on the girdle and on the bones'
rotations as they would be measured, so that every fit that takes constraints takes effects, alone or together.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from models.girdle import Girdle, bone_rotations, chain_residuals_mm

Rotations = tuple[Float[Array, " 3 3 *batch"], Float[Array, " 3 3 *batch"]]
"""R_thorax_clavicle, R_thorax_scapula."""

Adjust = Callable[[Girdle, Rotations, Float[Array, " channels *batch"]], tuple[Girdle, Rotations]]
"""The girdle and the true rotations, from the base girdle, the rotations as measured, and the amplitude there."""

PROFILE_TERMS = 3
"""Terms of an amplitude's course over elevation."""

_FULL_ELEVATION_DEG = 150.0
"""Elevation at which the first term of a course is at its height."""


@dataclass(frozen=True)
class Effect:
    """One candidate. ``channels`` are its independent directions, ``scale`` their prior SD in ``unit``.

    With ``over_elevation`` each channel follows a smooth course over humeral elevation that is zero with the arm
    hanging (:func:`course`); else it is one number a subject. ``adjust`` takes the amplitude at the posture, in
    ``unit``.
    """

    name: str
    what: str
    """What it changes, one line."""
    unit: str
    channels: tuple[str, ...]
    scale: tuple[float, ...]
    over_elevation: bool
    source: str
    adjust: Adjust

    @property
    def amplitudes(self) -> int:
        """How many numbers describe this effect in one subject."""
        return len(self.channels) * (PROFILE_TERMS if self.over_elevation else 1)

    @property
    def prior_sd(self) -> Float[Array, " amplitudes"]:
        """Prior SD of each amplitude: the channel's scale, smaller for the later terms of a course."""
        scale = jnp.asarray(self.scale)
        if not self.over_elevation:
            return scale
        return (scale[:, None] / (2.0 * jnp.arange(PROFILE_TERMS) + 1.0) ** 1.5).reshape(-1)

    def at(
        self, amplitude: Float[Array, " amplitudes *batch"], elevation_deg: Float[Array, " *batch"]
    ) -> Float[Array, " channels *batch"]:
        """The amplitude of each channel at the given elevations, in ``unit``."""
        if not self.over_elevation:
            return amplitude
        terms = amplitude.reshape(len(self.channels), PROFILE_TERMS, *amplitude.shape[1:])
        return jnp.sum(terms * course(elevation_deg)[None], axis=1)


def course(elevation_deg: Float[Array, " *batch"]) -> Float[Array, " terms *batch"]:
    """sin((2 k - 1) pi / 2 * elevation / 150 deg), k = 1, 2, ...: zero with the arm hanging, then any smooth course.

    The Karhunen-Loeve basis of a random walk from zero; the prior of the later terms falls faster than a random
    walk's, for a course that is smooth.
    """
    fraction = elevation_deg / _FULL_ELEVATION_DEG
    return jnp.stack([jnp.sin((k + 0.5) * jnp.pi * fraction) for k in range(PROFILE_TERMS)])


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ExtendedGirdle:
    """A girdle with effects at work, usable where a :class:`Girdle` is: arrays have the same trailing batch."""

    girdle: Girdle
    amplitudes: tuple[Float[Array, " amplitudes *batch"], ...]
    """In the unit of each effect."""
    elevation_deg: Float[Array, " *batch"]
    """Of the humerus, at each posture."""
    effects: tuple[Effect, ...] = field(metadata={"static": True})

    def residuals_mm(self, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
        """A1-A3 in mm at angles as they would be measured, rad. Without effects, those of the base model."""
        girdle, rotations = self.girdle, bone_rotations(angles)
        for effect, amplitude in zip(self.effects, self.amplitudes, strict=True):
            girdle, rotations = effect.adjust(girdle, rotations, effect.at(amplitude, self.elevation_deg))
        return chain_residuals_mm(girdle, *rotations)
