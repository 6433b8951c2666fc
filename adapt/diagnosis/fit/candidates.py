"""Candidate effects: the strength of each in every channel at every posture, and the prior of its amplitudes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.positions.measured_sizes import MeasuredSize
from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.solvers.projection.grouped_problems import acting
from adapt.solvers.projection.nearest_posture import strengths_of
from models.effects import EFFECTS, Effect
from models.effects.set_numbers import NUMBER_EFFECTS, doubtful_numbers, with_sizes_of
from models.parameter_sets import ParameterSet
from models.person.family import AnyModel, unique_sets

Hypothesis = tuple[str, ...]
"""Names of the effects that are active together, in the order of the candidates."""

_SHARE_OF_MEAN = 1.0 / 3.0
"""Smallest share of the measured size at which an effect counts as active."""


def without(hypothesis: Hypothesis, name: str) -> Hypothesis:
    """Remove a cause from a hypothesis."""
    return tuple(one for one in hypothesis if one != name)


def candidate_effects(model: AnyModel, subjects: Sequence[str]) -> tuple[Effect, ...]:
    """Return the effects to try with the parameter sets of these subjects.

    Candidates of a set are its doubtful numbers, with their ranges, and all other listed effects except sizes that the
    set has measured. If every subject has a set of its own, the candidates are those of any set, each with its widest
    prior.
    """
    widest: dict[str, Effect] = {}
    for one in unique_sets([model], subjects)[0]:
        for effect in _of_set(one):
            other = widest.setdefault(effect.name, effect)
            if effect.prior.scale > other.prior.scale:
                widest[effect.name] = effect
    return tuple(widest[name] for name in EFFECTS if name in widest)


def _of_set(model: ParameterSet) -> Iterator[Effect]:
    doubtful = doubtful_numbers(model)
    numbers = {effect.name for effect in NUMBER_EFFECTS.values()}
    listed = (doubtful.get(name, effect) for name, effect in EFFECTS.items() if name in doubtful or name not in numbers)
    return with_sizes_of(model, listed)


@dataclass(frozen=True)
class Candidates:
    """All candidates side by side: their amplitudes in one vector, their channels in another."""

    effects: tuple[Effect, ...]
    columns: Float[np.ndarray, "amplitudes channels rows"]
    scale: Float[np.ndarray, " amplitudes"]
    mean: Float[np.ndarray, " amplitudes"]
    sizes: Mapping[str, MeasuredSize]
    """Amplitudes measured by landmarks, by name of the effect."""

    @cached_property
    def acting(self) -> tuple[Int[np.ndarray, "some amplitudes"], Float[np.ndarray, "some amplitudes rows"]]:
        """Channels in which each amplitude acts, and its strength in them."""
        return acting(self.columns)

    @cached_property
    def places(self) -> dict[str, Int[np.ndarray, " own"]]:
        """Indices of the amplitudes of each effect, by name."""
        ends = np.cumsum([one.amplitudes for one in self.effects])
        return {one.name: np.arange(end - one.amplitudes, end) for one, end in zip(self.effects, ends, strict=True)}

    def where(self, hypothesis: Sequence[str]) -> Int[np.ndarray, " amplitudes"]:
        """Find the indices of the amplitudes of a hypothesis, effect by effect."""
        return np.concatenate([np.zeros(0, int), *(self.places[name] for name in hypothesis)]).astype(int)

    def among_all(
        self, hypothesis: Sequence[str], amplitude: Float[np.ndarray, " own"]
    ) -> Float[np.ndarray, " amplitudes"]:
        """Put the amplitudes of a hypothesis at their indices among all amplitudes; the others are 0."""
        found = np.zeros(len(self.scale))
        found[self.where(hypothesis)] = amplitude
        return found

    def effect(self, name: str) -> Effect:
        """Return the effect of this name."""
        return next(one for one in self.effects if one.name == name)

    def slices(self, hypothesis: Sequence[str]) -> Iterator[tuple[Effect, slice]]:
        """Yield each effect of a hypothesis, and the slice of its amplitudes among those of the hypothesis."""
        start = 0
        for name in hypothesis:
            effect = self.effect(name)
            yield effect, slice(start, start + effect.amplitudes)
            start += effect.amplitudes

    def by_amplitude(self, by_channel: Float[np.ndarray, "rows 3 channels"]) -> Float[np.ndarray, "rows 3 amplitudes"]:
        """Convert derivatives with respect to the channel strengths into derivatives with respect to the amplitudes."""
        found = np.empty((*by_channel.shape[:2], len(self.scale)))
        end = 0
        for effect in self.effects:
            own = self.places[effect.name]
            start, end = end, end + effect.basis.channels(len(effect.directions))
            found[..., own] = np.einsum("ric,kcr->rik", by_channel[..., start:end], self.columns[own, start:end])
        return found

    @cached_property
    def causes(self) -> dict[str, str]:
        """Cause of each effect, by name of the effect."""
        return {one.name: one.cause for one in self.effects}

    def ordered(self, names: Sequence[str]) -> Hypothesis:
        """Put names in the order of the candidates."""
        return tuple(one.name for one in self.effects if one.name in names)

    def has_the_sign(
        self, hypothesis: Sequence[str], amplitude: Float[np.ndarray, " own"], known: Sequence[str] = ()
    ) -> bool:
        """Check whether every effect has the sign of its prior, and at least ``_SHARE_OF_MEAN`` of a measured mean.

        The first amplitude of each direction counts, where the prior has a sign. Effects that are ``known`` to be
        active pass in any case: few data may give their size the wrong sign.
        """
        for effect, place in self.slices(hypothesis):
            if effect.name in known:
                continue
            own = amplitude[place]
            firsts = own[:: len(effect.basis.sd)]
            signs = np.array(effect.prior.sign or (0,) * len(firsts))
            means = self.mean[self.places[effect.name]][:: len(effect.basis.sd)]
            if (firsts * signs < _SHARE_OF_MEAN * means * np.abs(signs)).any():
                return False
        return True


def build_design(
    effects: Sequence[Effect], shoulders: Shoulders, sizes: Mapping[str, MeasuredSize] = MappingProxyType({})
) -> Candidates:
    """Lay out the effects for these postures; ``sizes`` measured by landmarks, by name, replace the priors."""
    columns = [effect.columns(shoulders.motions) for effect in effects]
    priors = (sizes.get(effect.name) or effect.amplitude_prior(shoulders.motions) for effect in effects)
    mean, scale = (np.concatenate(every) for every in zip(*priors, strict=True))
    return Candidates(tuple(effects), strengths_of(columns), scale, mean, sizes)
