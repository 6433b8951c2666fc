"""What an unmodelled effect is: a small change of the girdle, or of what was measured, with an amplitude.

Amplitude zero is the base model. An effect acts where the constraints are evaluated, on the girdle and on the bones'
rotations as they would be measured, so that every fit that takes constraints takes effects, alone or together.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from models.girdle import Girdle, bone_rotations, chain_landmarks, chain_residuals_mm
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
    """Most effects move the bones or misjudge their frames: landmarks are then seen where they are."""
    return points


COURSE_SD = (1.0, 0.3, 0.2)
"""Prior SD of the terms of a course over elevation, as shares of the effect's scale. Powers of the elevation from 1/2
to 3, a hinge at half the range and a smooth step have second terms of 0.2, -0.4, -0.5 and 0, third ones up to 0.2."""

FULL_ELEVATION_DEG = 150.0
"""Elevation at which the first term of a course is at its height."""


@dataclass(frozen=True)
class Effect:
    """One candidate. ``channels`` are its independent directions, ``scale`` their prior SD in ``unit``: as a vector,
    as long as the effect typically is.

    With ``over_elevation`` each channel follows a smooth course over humeral elevation that is zero with the arm
    hanging (:meth:`course`), and that is slow at first if ``late``; else it is one number a subject. ``adjust`` takes
    the amplitude at the posture, in ``unit``.
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
    show: Show = where_they_are
    sign: tuple[int, ...] = ()
    """Of each channel, where the effect's nature gives one: +1, -1, or 0 for either; empty for all 0."""
    late: bool = False
    axial: tuple[float, ...] = ()
    """How much farther the clavicle has turned about its own axis than was measured, deg a unit of each channel; empty
    where the effect does not hide such a turn."""
    between_motions: float = 0.1
    """Prior SD of a channel's amplitude in one motion about the mean of all motions, as a share of the scale."""
    leads: str = ""
    """The channel that is the effect's own direction, where there is one: along it the effect typically is as large as
    the scale, the other channels only lie beside it. Of a single direction it is that one."""
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
        return self.channels.index(self.leads) if self.leads else None

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
        return self.sign or (0,) * len(self.channels)

    @property
    def signs(self) -> tuple[int, ...]:
        """The expected sign of each amplitude; the later terms of a course have none."""
        more = (0,) * (self.terms - 1)
        return tuple(value for channel in self.channel_signs for value in (channel, *more))

    @property
    def prior_sd(self) -> Float[np.ndarray, " amplitudes"]:
        """Prior SD of each amplitude: the channel's scale, smaller for the later terms of a course."""
        return np.outer(self.scale, COURSE_SD if self.over_elevation else (1.0,)).ravel()

    @property
    def firsts(self) -> Int[np.ndarray, " directions"]:
        """Which of the amplitudes are the first term of a direction: what is left without bends and details."""
        return self.terms * np.arange(len(self.directions))

    def at(
        self, amplitude: Float[Array, " amplitudes *batch"], elevation_deg: Float[Array, " *batch"]
    ) -> Float[Array, " channels *batch"]:
        """The amplitude of each channel at the given elevations, in ``unit``."""
        terms = amplitude.reshape(len(self.channels), -1, *amplitude.shape[1:])
        return jnp.sum(terms * self.course(elevation_deg)[None], axis=1)

    def course(self, elevation_deg: Float[Array, " *batch"]) -> Float[Array, " terms *batch"]:
        """What each term of a channel's amplitude is times at these elevations: 1 for an effect that has no course.

        Else f, 4 f (1 - f) and 8 f (1 - f) (1 - 2 f) of f = elevation / 150 deg: a straight line, how much it bends,
        and where; f^2 in place of f for one that comes ``late``. All are zero with the arm hanging; the first alone is
        not with the arm up.
        """
        if not self.over_elevation:
            return xp.ones_like(elevation_deg)[None]
        f = elevation_deg / FULL_ELEVATION_DEG
        bend = 4.0 * f * (1.0 - f)
        return xp.stack([f**2 if self.late else f, bend, 2.0 * bend * (1.0 - 2.0 * f)])


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ActiveEffects:
    """Effects at work with their strengths, of postures that are laid out as the last axes say."""

    strengths: tuple[Float[Array, " channels *batch"], ...] = ()
    """Of each effect at each posture, in its unit (:meth:`Effect.at`)."""
    effects: tuple[Effect, ...] = field(default=(), metadata={"static": True})

    def on(self, girdle: Girdle) -> "Girdle | ExtendedGirdle":
        """The girdle with these effects; without any, the girdle itself."""
        return ExtendedGirdle(girdle, self) if self.effects else girdle

    def at(self, *index: Int[np.ndarray, " chosen"]) -> "ActiveEffects":
        """Those of some postures, by their place along each of the last axes."""
        return replace(self, strengths=tuple(np.asarray(one)[:, *index] for one in self.strengths))


NO_ACTIVE_EFFECTS = ActiveEffects()


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ExtendedGirdle:
    """A girdle with effects at work, usable where a :class:`Girdle` is: arrays have the same trailing batch."""

    girdle: Girdle
    active_effects: ActiveEffects

    def residuals_mm(self, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
        """A1-A3 in mm at angles as they would be measured, rad. Without effects, those of the base model."""
        *_, (girdle, rotations) = self._adjusted(angles)
        return chain_residuals_mm(girdle, *rotations)

    def landmarks_mm(self, angles: Float[Array, " 6 *batch"]) -> Points:
        """Where SHOWN would be seen at angles as they would be measured."""
        effects, strengths = self.active_effects.effects, self.active_effects.strengths
        *before, (girdle, rotations) = self._adjusted(angles)
        at = chain_landmarks(girdle, *rotations)
        points = jnp.stack(jnp.broadcast_arrays(girdle.sc_mm, at.AC, at.TS, at.AI), axis=1)
        for effect, strength, adjusted in reversed(list(zip(effects, strengths, before, strict=True))):
            points = effect.show(points, *adjusted, strength)
        return points

    def _adjusted(self, angles: Float[Array, " 6 *batch"]) -> list[tuple[Girdle, Rotations]]:
        """The girdle and the bones' rotations before the first effect, after it, ..., after the last."""
        steps = [(self.girdle, bone_rotations(angles))]
        for effect, strength in zip(self.active_effects.effects, self.active_effects.strengths, strict=True):
            steps.append(effect.adjust(*steps[-1], strength))
        return steps


def turned(R: Float[Array, " 3 3 *batch"], points: Points) -> Points:
    """Every point turned by R about the origin."""
    return rotate(R[:, :, None], points)
