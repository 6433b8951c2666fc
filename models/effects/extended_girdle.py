"""A girdle with active effects: they adjust girdle and rotations, from which constraints and landmarks are computed."""

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
    """Active effects with their strengths at a batch of postures."""

    strengths: tuple[Float[Array, " channels *batch"], ...] = ()
    """Strengths of each effect at each posture, in its unit (:meth:`Effect.strengths`)."""
    effects: tuple[Effect, ...] = field(default=(), metadata={"static": True})
    own: tuple[Float[Array, " sizes channels *batch"], ...] = ()
    """Strengths that a deviation of one SD from the population amplitudes adds, for each effect and each amplitude in
    which persons differ; empty if persons differ in none."""

    def with_sizes(self, sizes: Float[np.ndarray, "sizes problems"]) -> "ActiveEffects":
        """Return the effects with known subject-level amplitudes, given as deviations from the mean in SDs, effect by
        effect. ``strengths`` have the shape (channels, postures, problems)."""
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
        """Return the girdle with these effects; without effects, the girdle itself."""
        return ExtendedGirdle(girdle, self) if self.effects else girdle

    def at(self, *index: Int[np.ndarray, " chosen"]) -> "ActiveEffects":
        """Select postures by their indices along each batch axis."""
        return replace(
            self,
            strengths=tuple(np.asarray(one)[:, *index] for one in self.strengths),
            own=tuple(np.asarray(one)[:, :, *index] for one in self.own),
        )


NO_ACTIVE_EFFECTS = ActiveEffects()


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ExtendedGirdle:
    """A girdle with active effects, usable in place of a :class:`Girdle`; all arrays have the same trailing batch."""

    girdle: Girdle
    active_effects: ActiveEffects

    def residuals_mm(self, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
        """Compute A1-A3 in mm at measured angles (rad); without effects, the residuals of the base model."""
        *_, (girdle, rotations) = self.steps(angles)
        return chain_residuals_mm(girdle, *rotations)

    def steps(self, angles: Float[Array, " 6 *batch"]) -> Iterator[tuple[Girdle, Rotations]]:
        """Yield the girdle and the bones' rotations: first at the measured angles, then after each effect."""
        girdle, rotations = self.girdle, bone_rotations(angles)
        yield girdle, rotations
        for effect, strength in zip(self.active_effects.effects, self.active_effects.strengths, strict=True):
            girdle, rotations = effect.adjust(girdle, rotations, strength)
            yield girdle, rotations


AnyGirdle = Girdle | ExtendedGirdle
"""A girdle with or without active effects."""
