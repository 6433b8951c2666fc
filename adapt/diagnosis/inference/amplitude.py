"""Sizes of the named causes with intervals, and the typical sizes of such effects."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.evidence import Given
from adapt.diagnosis.fit.positions.measured_sizes import MeasuredSize
from adapt.diagnosis.fit.positions.position_evidence import Shown, shown_sizes
from adapt.diagnosis.inference.extent import extent
from adapt.diagnosis.inference.intervals import resampled_persons
from adapt.diagnosis.inference.search import Search
from adapt.diagnosis.inference.weights import probabilities_of_draws
from adapt.diagnosis.result import CauseAmplitude, Interval
from adapt.evaluation.covariance import NORMAL_95
from models.effects import Effect
from models.effects.amplitudes import rounded
from models.effects.basis import root_mean_square

_DRAWS, _SEED = 400, 5

_AS_MANY = 2.0
"""Factor on the number of persons in each draw. The spread of a size contains the variance within a draw and the
variance between draws. With twice as many persons, each is half of its value for the measured persons where the model
is right (Huggins & Miller 2019, Robust inference and model criticism using bagged posteriors, arXiv 1912.07104)."""


def amplitudes(search: Search, hypothesis: Hypothesis, seen: Collection[str]) -> dict[str, CauseAmplitude]:
    """Compute the size of each effect of a set from its posterior, by name; for causes that were ``seen``, from what
    positions show."""
    if not hypothesis:
        return {}
    candidates, shoulders = search.joint.candidates, search.joint.shoulders
    sizes, found = search.sizes_of_shoulders(hypothesis, seen), {}
    shown = shown_sizes(search.likelihood.positions, candidates, hypothesis, seen)
    for effect, _ in candidates.slices(hypothesis):
        count = len(effect.directions)
        draws = draws_shown(search, shown, effect.name) if shown and effect.name in shown.names else None
        draws = draws_of(search, effect.name) if draws is None else draws
        a = draws.mean(axis=0)
        columns = effect.basis.strengths(count, shoulders.motions)
        felt = effect.basis.felt(count, shoulders.motions)
        shares = share_of(np.array([one[effect.name] for one in sizes]), a, columns)
        found[effect.name] = replace(
            _described(effect, a, draws, columns, felt, candidates),
            by_subject=dict(zip(shoulders.subjects, shares.tolist(), strict=True)),
            extent=extent(effect, np.einsum("a,acp->cp", a, felt), shoulders.motions),
        )
    return found


def draws_of(search: Search, name: str) -> Float[np.ndarray, "draws own"]:
    """Draw the population amplitudes of an effect from their posterior, over all fitted sets with the effect and over
    resampled persons.

    Each draw of persons gives the same number of amplitudes, from each set in proportion to its probability for these
    persons.
    """
    generator, candidates = np.random.default_rng(_SEED), search.joint.candidates
    within = [node for node in search.usable if name in node.hypothesis]
    share = probabilities_of_draws([search.resampled(node) for node in within])
    counts = generator.multinomial(_DRAWS // len(search.times), share.T)
    found, persons = [], _persons(search)
    for node, of_persons in zip(within, counts.T, strict=True):
        if not of_persons.any():
            continue
        given = search.given(node.posterior, node.hypothesis)
        (own,) = (place for effect, place in candidates.slices(node.hypothesis) if effect.name == name)
        for times, count in zip(persons, of_persons, strict=True):
            if count:
                found.append(_drawn(given, times, count, generator)[:, own])
    return np.concatenate(found)


def draws_shown(search: Search, shown: Shown, name: str) -> Float[np.ndarray, "draws own"]:
    """Draw the amplitudes of an effect that positions show, the same number for each draw of persons."""
    generator, candidates = np.random.default_rng(_SEED), search.joint.candidates
    (own,) = (place for effect, place in candidates.slices(shown.names) if effect.name == name)
    found = []
    for times in _persons(search):
        found.append(_drawn(shown.given, times, _DRAWS // len(search.times), generator)[:, own])
    return np.concatenate(found)


def _persons(search: Search) -> Float[np.ndarray, "draws subjects"]:
    return resampled_persons(search.joint.shoulders.person, _AS_MANY)


def _drawn(given: Given, times, count: int, generator: np.random.Generator) -> Float[np.ndarray, "count own"]:
    """Draw all amplitudes of a set, for shoulders with the weights ``times``."""
    amplitude, root = given.amplitude_of(times)
    return amplitude + np.linalg.solve(root.T, generator.standard_normal((len(amplitude), count))).T


def share_of(
    amplitudes: Float[np.ndarray, "some own"],
    a: Float[np.ndarray, " own"],
    columns: Float[np.ndarray, "own channels rows"],
) -> Float[np.ndarray, " some"]:
    """Project the strengths u_s at all postures on the strengths u of a: u_s'u / u'u, negative if opposite."""
    flat = columns.reshape(len(a), -1)
    u = a @ flat
    return amplitudes @ (flat @ u) / (u @ u)


def amplitude_without_size(effect: Effect) -> CauseAmplitude:
    """Describe an effect that is active without showing in any gap, and so has no size to adapt with."""
    unknown = Interval(np.nan, np.nan, np.nan)
    typical = float(np.linalg.norm(effect.prior.scale))
    directions = dict.fromkeys(effect.directions, unknown)
    return CauseAmplitude(
        effect.name, effect.what, effect.basis.word, effect.size_unit, unknown, typical, directions, None
    )


def of_landmarks(effect: Effect, size: MeasuredSize) -> dict[str, Interval]:
    """Return the size by landmarks of each direction with its 95 % interval, in the unit of the effect."""
    low, high = size.mean - NORMAL_95 * size.sd, size.mean + NORMAL_95 * size.sd
    return {
        direction: Interval(float(size.mean[k]), float(low[k]), float(high[k]))
        for k, direction in enumerate(effect.directions)
    }


def _described(effect: Effect, value, draws, columns, felt, candidates: Candidates) -> CauseAmplitude:
    terms = len(effect.basis.sd)
    scale = candidates.scale[candidates.places[effect.name]]
    mean = candidates.mean[candidates.places[effect.name]]
    typical = np.linalg.norm(np.hypot(scale, mean) * root_mean_square(felt))
    size = float(root_mean_square(np.einsum("a,acp->cp", value, felt)))
    low, high = size * np.percentile(share_of(draws, value, columns), [2.5, 97.5])
    spread = np.percentile(draws, [2.5, 97.5], axis=0)
    numbers = {
        direction: Interval(float(value[k * terms]), float(spread[0, k * terms]), float(spread[1, k * terms]))
        for k, direction in enumerate(effect.directions)
    }
    return CauseAmplitude(
        effect=effect.name,
        what=effect.what,
        basis=effect.basis.word,
        unit=effect.size_unit,
        size=Interval(size, float(low), float(high)),
        typical=float(typical),
        directions=numbers,
        amplitude=rounded(value.tolist()),
    )
