"""The null that every cause is held against: people have own bones (``adapt.own_bones``).

A cause is named if it predicts what own bones do not. With a set of causes V, their sizes from other
persons on other motions,

    share(V) = (gap of own bones - gap of own bones and V) / (gap of own bones - what noise leaves)

of motions held out of the person's bones. Causes with which the others predict no better go, the worst first;
all go unless share(V) is ``LEAST_SHARE`` or more, more probably than not over persons drawn anew. What measured
positions show stands.

A constant is one that own bones hold: each person's own predicts as well as one that all have alike. It is named if
what all have in common of it, a, is beyond how persons differ. Their own are N(a, s^2), s the scale that is learnt
beside the causes, times the SD of persons: of a bone that of the cause, SD. The set is one person too, so without a
cause a is N(0, s^2), and with one N(0, s^2 + SD^2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from adapt.diagnosis.adapted_gaps import AdaptedGaps, gaps_of
from adapt.diagnosis.fit.candidates import Hypothesis, without
from adapt.diagnosis.inference.alternatives import FRAMES
from adapt.diagnosis.inference.computed_axial_rotation import is_its_zero
from adapt.diagnosis.inference.intervals import known_mean, resampled_persons
from adapt.diagnosis.inference.search import Search
from adapt.diagnosis.inference.weights import probabilities
from adapt.diagnosis.population_amplitudes import effects_of_folds, no_size, own_effects
from adapt.evaluation.held_out import HeldOut, adapt_with_folds, held_out_with_own_bones
from adapt.own_bones.own_adaptation import People, learn_people
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.tables.folds import MOTION, PERSON, Fold, motions_and_persons, motions_and_thirds
from models.effects import Effect
from models.effects.amplitudes import NO_EFFECTS, Amplitudes, active_effects
from models.effects.effect import cause_of
from models.effects.set_numbers import NUMBER_EFFECTS
from models.person.family import AnyModel
from models.person.own_bones import sds_of
from motions.table import Motions

LEAST_SHARE = 0.1
"""Of the null's gap beyond noise, that causes take together."""

LEAST_PROBABILITY = 0.5
"""That they take it."""

SURE = 0.8
"""Probability of a constant that all have in common, from which it is named."""

OWN_CONSTANTS = frozenset(
    (
        *FRAMES,
        "clavicle_length",
        "scapula_size",
        "ac_offset",
        "thorax_tilt",
        "thorax_asymmetry",
        "thorax_shape",
        *(effect.name for effect in NUMBER_EFFECTS.values()),
    )
)
"""Causes that bones, frames and a thorax of a person's own hold; those of ``FRAMES`` differ between persons as frames
do, the others as bones do."""

_FEW = 4
"""Causes, of which all 16 sets are predicted side by side."""


class BudgetStep(NamedTuple):
    """Own bones with some causes, in every fold."""

    added: str
    """The effect that it adds to the one before; empty for the first."""
    hypothesis: Hypothesis
    gaps_deg: Float[np.ndarray, "folds 6"]


class Gain(NamedTuple):
    """What one cause adds beside own bones and the causes before it."""

    share: float
    """Of the null's gap beyond noise."""
    t: float
    """Of the paired differences of persons and motions, in their standard errors."""


@dataclass(frozen=True)
class OwnBonesNull:
    """Adaptations with own bones, with causes or without."""

    search: Search
    model: AnyModel
    motions: Motions
    library: Mapping[str, Effect]
    person: Mapping[str, int]
    """Number of the person of each subject."""
    found: dict[tuple[Hypothesis, Hypothesis], HeldOut] = field(default_factory=dict)
    """What is held out with sets of causes, each among those that were named together."""
    learnt: dict[Hypothesis, People] = field(default_factory=dict)
    """How persons differ beside them."""
    seen: frozenset[str] = frozenset()
    """Causes that measured positions show."""

    @cached_property
    def rows(self) -> PostureRows:
        """The postures, without effects."""
        return posture_rows(self.motions)

    @property
    def people(self) -> People:
        """How these persons differ where no cause is active."""
        return self.people_with((), ())

    def people_with(self, hypothesis: Hypothesis, named: Hypothesis) -> People:
        """Learn how these persons differ beside some of the causes that were named: what they take was in nobody's
        bones."""
        if hypothesis not in self.learnt:
            rows = self.rows
            if hypothesis:
                at, slices = self.search.mode(hypothesis), self.search.joint.candidates.slices(hypothesis)
                sizes: Amplitudes = {effect.name: at.amplitude[own].tolist() for effect, own in slices}
                rows = posture_rows(self.motions, no_size(named, self.library) | sizes, self.library)
            self.learnt[hypothesis] = learn_people(rows, [self.model])
        return self.learnt[hypothesis]

    @cached_property
    def folds(self) -> list[Fold]:
        """Each motion together with each person, of one person each motion (of one motion each third)."""
        every = motions_and_persons(self.motions, self.search.joint.shoulders.person)[0]
        kind = PERSON if PERSON in self.search.folds.kinds else MOTION
        return [fold for fold in every if fold.kind == kind]

    def adapted(self, amplitudes: Amplitudes = NO_EFFECTS) -> AdaptedGaps:
        """Adapt with these effects, as `girdle adapt --own-bones --effect` does; with the sizes of each person that
        measured positions show, where they are data."""
        rows, folds = posture_rows(self.motions, amplitudes, self.library), motions_and_thirds(self.motions)
        own = None
        if amplitudes and self.search.joint.positions:
            names = self.search.joint.candidates.ordered(list(amplitudes))
            own = own_effects(self.search, names, self.motions, rows, folds, self.library, self.seen)
        return gaps_of(adapt_with_folds(rows, [self.model], folds, people=self.people, effects=own), self.person)

    def predict(self, hypotheses: Sequence[Hypothesis], named: Hypothesis) -> None:
        """Predict what is held out with sets of causes, their sizes fitted without it, each once, side by side.

        Those ``named`` that are not in a set have the size 0: one compiled program serves all sets of them."""
        missing = [one for one in dict.fromkeys(hypotheses) if (one, named) not in self.found]
        if not missing:
            return
        none = active_effects(no_size(named, self.library), self.motions, self.library)
        rows = replace(self.rows, active_effects=none)
        laid_out = self.motions, rows, self.folds, self.library, named, self.seen
        each = [effects_of_folds(self.search, one, *laid_out) for one in missing]
        effects = jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *each)
        folds, count = self.folds * len(missing), len(self.folds)
        people = [self.people_with(one, named) for one in missing for _ in self.folds]
        every = held_out_with_own_bones(rows, self.model, folds, people, effects)
        for k, one in enumerate(missing):
            self.found[one, named] = every.of(np.arange(k * count, (k + 1) * count))

    def held_out(self, hypothesis: Hypothesis, named: Hypothesis) -> HeldOut:
        """Give what is held out with a set of causes."""
        self.predict([hypothesis], named)
        return self.found[hypothesis, named]

    def gaps_deg(self, hypothesis: Hypothesis, named: Hypothesis) -> Float[np.ndarray, "folds 6"]:
        """Average what it leaves of each angle in each fold."""
        return np.array([known_mean(gaps) for gaps in self.held_out(hypothesis, named).gaps_deg])

    def beyond(self, named: Hypothesis, floor_deg: float) -> Hypothesis:
        """Keep the causes that take a share of what own bones leave; noise alone leaves ``floor_deg``."""
        chosen = tuple(name for name in named if not self.is_constant(name) or self._is_common(name, named))
        while held := [name for name in chosen if self.is_held(name)]:
            self.predict([chosen, *(without(chosen, name) for name in held)], named)
            gaps = {name: self._mean(without(chosen, name), named) for name in held}
            worst = min(held, key=gaps.__getitem__)
            if gaps[worst] > self._mean(chosen, named):
                break
            chosen = without(chosen, worst)
        return self.tested(chosen, named, floor_deg)

    def tested(self, chosen: Hypothesis, named: Hypothesis, floor_deg: float) -> Hypothesis:
        """Leave out what own bones are a null for, if it takes no share of what they leave beside the others chosen."""
        return chosen if self.probability(chosen, named, floor_deg) >= LEAST_PROBABILITY else self._constants(chosen)

    def probability(self, chosen: Hypothesis, named: Hypothesis, floor_deg: float) -> float:
        """Compute how probably, over persons drawn anew, causes take ``LEAST_SHARE`` or more of what own bones leave;
        1 of those that rest on the evidence alone."""
        constants = self._constants(chosen)
        if len(chosen) == len(constants):
            return 1.0
        null, less, more = (known_mean(self.gaps_deg(one, named)) for one in ((), constants, chosen))
        known = np.isfinite(null + less + more)
        weights = resampled_persons(self.persons)[:, known]
        takes, beyond = weights @ (less - more)[known], weights @ (null[known] - floor_deg)
        return float(np.mean((takes >= LEAST_SHARE * beyond) & (takes > 0.0)))

    def probability_beyond(self, kept: Hypothesis, named: Hypothesis, floor_deg: float) -> float:
        """Compute how probably anything is beyond own bones: of what is kept, or, where that is constants alone, of all
        that was named."""
        return self.probability(kept if any(map(self.is_held, kept)) else named, named, floor_deg)

    def budget(self, chosen: Hypothesis, named: Hypothesis) -> list[BudgetStep]:
        """Add causes one by one, the one that takes most of the held-out gap first; they were chosen of ``named``."""
        sets, order = [chosen], []
        if len(chosen) <= _FEW:  # all at once takes less time than a few one after the other
            self.predict([one for count in range(len(chosen) + 1) for one in combinations(chosen, count)], named)
        while sets[-1]:
            self.predict([without(sets[-1], name) for name in sets[-1]], named)
            dropped = min(sets[-1], key=lambda name: self._mean(without(sets[-1], name), named))
            order.append(dropped)
            sets.append(without(sets[-1], dropped))
        pairs = zip(["", *reversed(order)], reversed(sets), strict=True)
        return [BudgetStep(name, one, self.gaps_deg(one, named)) for name, one in pairs]

    def gains(self, steps: list[BudgetStep], named: Hypothesis, floor_deg: float) -> dict[str, Gain]:
        """Say what each cause of a gap budget takes beside those before it."""
        return {
            step.added: self._gain(before.hypothesis, step.hypothesis, named, floor_deg)
            for before, step in pairwise(steps)
        }

    def _gain(self, less: Hypothesis, more: Hypothesis, named: Hypothesis, floor_deg: float) -> Gain:
        beyond = self._mean((), named) - floor_deg
        takes = known_mean(self.gaps_deg(less, named) - self.gaps_deg(more, named))
        error, mean = _standard_error(takes, self.persons), float(np.nanmean(takes))
        return Gain(mean / beyond if beyond > 0.0 else np.nan, mean / error if error else np.inf)

    @cached_property
    def persons(self) -> np.ndarray:
        """Number of the person of each fold."""
        return np.array([self.person[self.motions.subjects[fold.subject]] for fold in self.folds])

    def _constants(self, chosen: Hypothesis) -> Hypothesis:
        return tuple(name for name in chosen if not self.is_held(name))

    def _mean(self, hypothesis: Hypothesis, named: Hypothesis) -> float:
        return float(np.nanmean(known_mean(self.gaps_deg(hypothesis, named))))

    def _is_common(self, name: str, named: Hypothesis) -> bool:
        """Tell whether all have something in common of a constant that no computed axial rotation brings with it."""
        return not is_its_zero(cause_of(name), self.search.known) and self.common(name, named) >= SURE

    def common(self, name: str, hypothesis: Hypothesis) -> float:
        """Compute how probably all have something in common of a constant of a set, over persons drawn anew."""
        search, scales = self.search, self.people_with(hypothesis, hypothesis).everybody[self.model.name]
        candidates, at = search.joint.candidates, search.mode(hypothesis)
        where, causes = candidates.where(hypothesis), [candidates.causes[one] for one in hypothesis]
        between = np.full(len(where), search.discrepancy.between_shoulders)
        for (_, own), cause in zip(candidates.slices(hypothesis), causes, strict=True):
            if cause in FRAMES:
                between[own] = scales.frames * sds_of(FRAMES[cause]) / candidates.scale[where][own]
            elif cause in OWN_CONSTANTS:
                between[own] = scales.bones
        evidence = at.evidence._replace(between=between)
        given = evidence.given(where, at.amplitude, candidates.mean[where], candidates.scale[where])
        (own,) = (place for effect, place in candidates.slices(hypothesis) if effect.name == name)
        mean, variance = candidates.mean[where][own], candidates.scale[where][own] ** 2
        of_persons, none, some = between[own] ** 2 * variance, [], []
        for times in search.times:
            a, root = given.amplitude_of(times)
            precision = np.linalg.inv(np.linalg.inv(root @ root.T)[own, own])
            told = precision - np.diag(1.0 / variance), precision @ a[own] - mean / variance
            none.append(_log_evidence(*told, of_persons))
            some.append(_log_evidence(*told, of_persons + variance))
        return float(probabilities([np.array(none), np.array(some)])[1])

    def is_constant(self, name: str) -> bool:
        """Tell whether a cause is one that own bones hold, and not known to be active."""
        return cause_of(name) in OWN_CONSTANTS and name not in self.search.known

    def tested_on(self, name: str) -> tuple[str, ...]:
        """Say what shows a cause that is named (``Cause.tested_on``)."""
        if cause_of(name) in self.seen:
            return ("positions",)
        if not self.is_held(name):
            return ("angles",) if name in self.search.known else ("evidence",)
        kinds = "other_motion", "other_person"
        return kinds if self.folds[0].kind == PERSON else kinds[:1]

    def is_held(self, name: str) -> bool:
        """Tell whether own bones are a null for this cause, which neither is known to be active nor was seen."""
        known = self.is_constant(name) or name in self.search.known
        return not known and cause_of(name) not in self.seen


def _log_evidence(
    precision: Float[np.ndarray, "n n"], slope: Float[np.ndarray, " n"], variance: Float[np.ndarray, " n"]
) -> float:
    """Integrate exp(slope a - a' precision a / 2) over a of these variances about 0."""
    whole = np.eye(len(variance)) + precision * variance
    return float(0.5 * (slope * variance @ np.linalg.solve(whole, slope) - np.linalg.slogdet(whole).logabsdet))


def _standard_error(differences: Float[np.ndarray, " folds"], persons: np.ndarray) -> float:
    """Of the mean over persons; of one person, over folds."""
    known = np.isfinite(differences)
    different = np.unique(persons[known])
    means = differences[known]
    if len(different) > 1:
        means = np.array([differences[known & (persons == one)].mean() for one in different])
    return float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) > 1 else 0.0
