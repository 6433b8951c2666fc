"""A girdle with active effects: constraints and landmarks where the effects adjust the girdle and the rotations."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import jax
import numpy as np
from jaxtyping import Float, Int

from models.effects.effect import Effect, Rotations
from models.girdle import Girdle, bone_rotations, chain_residuals_mm
from motions.arrays import Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ActiveEffects:
    """Active effects with their strengths, of postures that are laid out as the last axes say."""

    strengths: tuple[Float[Array, " channels *batch"], ...] = ()
    """Of each effect at each posture, in its unit (:meth:`Effect.at`)."""
    effects: tuple[Effect, ...] = field(default=(), metadata={"static": True})
    own: tuple[Float[Array, " sizes channels *batch"], ...] = ()
    """Of each effect, the strengths of a size that is an SD off the mean of persons, in every way in which persons
    differ; empty where none differs in any."""

    def with_sizes(self, sizes: Float[np.ndarray, "sizes problems"]) -> "ActiveEffects":
        """Give every person its own sizes, in SDs off the mean, effect by effect: of strengths (channels, postures,
        problems). What is left is known."""
        if not self.own:
            return self
        ends = np.cumsum([len(one) for one in self.own])
        each = np.split(sizes, ends[:-1])
        strengths = (
            strength + np.einsum("kcp...,k...->cp...", own, size)
            for strength, own, size in zip(self.strengths, self.own, each, strict=True)
        )
        return replace(self, strengths=tuple(strengths), own=())

    def on(self, girdle: Girdle) -> "Girdle | ExtendedGirdle":
        """Put these effects on the girdle; without any, return the girdle itself."""
        return ExtendedGirdle(girdle, self) if self.effects else girdle

    def at(self, *index: Int[np.ndarray, " chosen"]) -> "ActiveEffects":
        """Select the effects of some postures, by their place along each of the last axes."""
        return replace(
            self,
            strengths=tuple(np.asarray(one)[:, *index] for one in self.strengths),
            own=tuple(np.asarray(one)[:, :, *index] for one in self.own),
        )


NO_ACTIVE_EFFECTS = ActiveEffects()


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ExtendedGirdle:
    """A girdle with active effects, usable where a :class:`Girdle` is: arrays have the same trailing batch."""

    girdle: Girdle
    active_effects: ActiveEffects

    def residuals_mm(self, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
        """Compute A1-A3 in mm at angles as they would be measured, rad. Without effects, those of the base model."""
        *_, (girdle, rotations) = self.steps(angles)
        return chain_residuals_mm(girdle, *rotations)

    def steps(self, angles: Float[Array, " 6 *batch"]) -> Iterator[tuple[Girdle, Rotations]]:
        """Give the girdle and the rotations of the bones as they would be measured, and after each effect."""
        girdle, rotations = self.girdle, bone_rotations(angles)
        yield girdle, rotations
        for effect, strength in zip(self.active_effects.effects, self.active_effects.strengths, strict=True):
            girdle, rotations = effect.adjust(girdle, rotations, strength)
            yield girdle, rotations


AnyGirdle = Girdle | ExtendedGirdle
"""One with effects active or without."""
