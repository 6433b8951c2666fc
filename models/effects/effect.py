"""What an unmodelled effect is: a small change of the girdle, or of what was measured, with an amplitude.

Amplitude zero is the base model. An effect acts where the constraints are evaluated, on the girdle and on the bones'
rotations as they would be measured, so that every fit that takes constraints takes effects, alone or together.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from models.effects.prior import COURSE_SD, EffectPrior
from models.girdle import Girdle
from motions.arrays import Array, xp
from motions.rotations import rotate

Rotations = tuple[Float[Array, " 3 3 *batch"], Float[Array, " 3 3 *batch"]]
"""R_thorax_clavicle, R_thorax_scapula."""

Adjust = Callable[[Girdle, Rotations, Float[Array, " channels *batch"]], tuple[Girdle, Rotations]]
"""The girdle and the true rotations, from the base girdle, the rotations as measured, and the amplitude there."""

SHOWN = ("SC", "AC", "TS", "AI")
"""The landmarks whose positions the model predicts."""

Points = Float[Array, " 3 shown *batch"]
"""Positions of SHOWN in the thorax frame, mm."""

Show = Callable[[Points, Girdle, Rotations, Float[Array, " channels *batch"]], Points]
"""Where the landmarks are seen, from where they are in the adjusted chain, the base girdle and the rotations as
measured, and the amplitude there."""


def where_they_are(points: Points, girdle: Girdle, rotations: Rotations, amplitude) -> Points:
    """Return the points unchanged: most effects move the bones or misjudge their frames, and landmarks are then seen
    where they are."""
    return points


FULL_ELEVATION_DEG = 150.0
"""Elevation at which the first term of a course is at its height."""


@dataclass(frozen=True)
class Effect:
    """One candidate. ``channels`` are its independent directions, each with an amplitude in ``unit``.

    With ``over_elevation`` each channel follows a smooth course over humeral elevation that is zero with the arm
    hanging (:meth:`course`), and that is slow at first if ``late``; else it is one number a subject. ``adjust`` takes
    the amplitude at the posture, in ``unit``.
    """

    name: str
    what: str
    """What it changes, one line."""
    unit: str
    channels: tuple[str, ...]
    over_elevation: bool
    adjust: Adjust
    prior: EffectPrior
    """What is believed about its amplitudes before any data."""
    show: Show = where_they_are
    late: bool = False
    details: int = 0
    """So many of the last channels say how the effect acts, not how large it is; the name of each says its unit. None
    of them is reported."""

    @property
    def directions(self) -> tuple[str, ...]:
        """The channels without the details."""
        return self.channels[: len(self.channels) - self.details]

    @property
    def leading(self) -> int | None:
        """The channel that leads, or None."""
        if len(self.directions) == 1:
            return 0
        return self.channels.index(self.prior.leads) if self.prior.leads else None

    @property
    def terms(self) -> int:
        """How many numbers describe the course of a channel."""
        return len(COURSE_SD) if self.over_elevation else 1

    @property
    def amplitudes(self) -> int:
        """How many numbers describe this effect in one subject."""
        return len(self.channels) * self.terms

    @property
    def channel_signs(self) -> tuple[int, ...]:
        """The expected sign of each channel: +1, -1, or 0 for either."""
        return self.prior.sign or (0,) * len(self.channels)

    @property
    def signs(self) -> tuple[int, ...]:
        """The expected sign of each amplitude; the later terms of a course have none."""
        more = (0,) * (self.terms - 1)
        return tuple(value for channel in self.channel_signs for value in (channel, *more))

    @property
    def prior_sd(self) -> Float[np.ndarray, " amplitudes"]:
        """Prior SD of each amplitude: the channel's scale, smaller for the later terms of a course."""
        return np.outer(self.prior.scale, COURSE_SD if self.over_elevation else (1.0,)).ravel()

    @property
    def firsts(self) -> Int[np.ndarray, " directions"]:
        """Which of the amplitudes are the first term of a direction: what is left without bends and details."""
        return self.terms * np.arange(len(self.directions))

    def at(
        self, amplitude: Float[Array, " amplitudes *batch"], elevation_deg: Float[Array, " *batch"]
    ) -> Float[Array, " channels *batch"]:
        """Compute the amplitude of each channel at the given elevations, in ``unit``."""
        terms = amplitude.reshape(len(self.channels), -1, *amplitude.shape[1:])
        return jnp.sum(terms * self.course(elevation_deg)[None], axis=1)

    def course(self, elevation_deg: Float[Array, " *batch"]) -> Float[Array, " terms *batch"]:
        """Compute the factor of each term of a channel's amplitude at these elevations: 1 for an effect without course.

        Else f, 4 f (1 - f) and 8 f (1 - f) (1 - 2 f) of f = elevation / 150 deg: a straight line, how much it bends,
        and where; f^2 in place of f for one that comes ``late``. All are zero with the arm hanging; the first alone is
        not with the arm up.
        """
        if not self.over_elevation:
            return xp.ones_like(elevation_deg)[None]
        f = elevation_deg / FULL_ELEVATION_DEG
        bend = 4.0 * f * (1.0 - f)
        return xp.stack([f**2 if self.late else f, bend, 2.0 * bend * (1.0 - 2.0 * f)])


def rotate_points(R: Float[Array, " 3 3 *batch"], points: Points) -> Points:
    """Rotate every point by R about the origin."""
    return rotate(R[:, :, None], points)
