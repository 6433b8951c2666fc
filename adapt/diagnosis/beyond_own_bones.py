"""Null hypothesis for every cause: people have own bones (``adapt.own_bones``).

A cause is named if it predicts what own bones do not. With a set of causes V, whose sizes come from other persons and
other motions,

    share(V) = (gap(V_0) - gap(V)) / (gap of own bones - gap of noise alone)

on motions held out of the person's bones, with gap(V) that of own bones and V, and V_0 the causes of V that are not
tested so: constants, known causes, and causes that positions show. Causes without which the others predict as well or
better are removed, the worst first. All are removed unless share(V) is at least ``LEAST_SHARE`` with a probability of
one half or more over resampled persons. Causes that measured positions show stay.

Own bones of each person may predict as well as a cause that all persons have, and yet need the same bones in all of
them. So where the best set leaves noise alone, causes also stand by the evidence of the persons s, unless the others
predict better:

    log odds(V : V_0) = sum over s of log p_s(V) - log p_s(V_0) - |x|^2 / 2 - log det(S L L' S) / 2 + log prior odds

with p_s the likelihood with own bones (``own_bones.scales``), x the sizes in their prior SDs S, and L L' the
posterior precision of the sizes.

Own bones can represent a constant cause: a constant of each person predicts as well as a constant common to all. Such a
cause is named if the common constant a exceeds the variation between persons. The persons' constants are N(a, s^2),
with s the scale learnt beside the causes times the SD between persons; for a bone, this SD is the SD of the cause. The
set is one person too, so a is N(0, s^2) without the cause and N(0, s^2 + SD^2) with the cause. Over resampled persons
the 95 % interval of its size must exclude 0: three persons may agree by chance.
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
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.computed_axial_rotation import is_its_zero
from adapt.diagnosis.inference.intervals import known_mean, resampled_persons
from adapt.diagnosis.inference.search import Search
from adapt.diagnosis.inference.weights import probabilities
from adapt.diagnosis.population_amplitudes import effects_of_folds, no_size, own_effects
from adapt.diagnosis.result import POSITIONS
from adapt.evaluation.held_out import HeldOut, adapt_with_folds, held_out_with_own_bones
from adapt.own_bones.own_adaptation import People, learn_people, misfit
from adapt.own_bones.scales import PRIOR
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
"""Smallest share of the null's gap beyond noise that the causes have to take away together."""

LEAST_PROBABILITY = 0.5
"""Smallest probability that the causes take this share, or are active by the evidence of the persons."""

WORSE = 0.9
"""Probability of a larger gap on held-out motions, from which evidence does not count."""

SURE = 0.8
"""Smallest probability of a common constant for which it is named."""

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
"""Causes that own bones, frames and thorax can represent. Causes in ``FRAMES`` vary between persons as frames do, the
other causes as bones do."""

_FEW = 4
"""Largest number of causes for which all (16) sets are predicted in one batch."""


class BudgetStep(NamedTuple):
    """Step of the gap budget: own bones with some causes, in every fold."""

    added: str
    """Effect that the step adds to the previous step; empty for the first step."""
    hypothesis: Hypothesis
    gaps_deg: Float[np.ndarray, "folds 6"]


class Gain(NamedTuple):
    """Improvement by one cause, beside own bones and the causes before it."""

    share: float
    """Share of the null's gap beyond noise that the cause takes away."""
    t: float
    """Mean of the paired differences of persons and motions, in standard errors."""


@dataclass(frozen=True)
class OwnBonesNull:
    """Adaptations with own bones, with causes or without."""

    search: Search
    model: AnyModel
    motions: Motions
    library: Mapping[str, Effect]
    person: Mapping[str, int]
    """Person number of each subject."""
    found: dict[tuple[Hypothesis, Hypothesis], HeldOut] = field(default_factory=dict)
    """Cache of held-out predictions by the set of causes and the causes named together."""
    learnt: dict[Hypothesis, People] = field(default_factory=dict)
    """Cache of the variation between persons beside each set of causes."""
    seen: frozenset[str] = frozenset()
    """Causes that measured positions show."""

    @cached_property
    def rows(self) -> PostureRows:
        """Postures without effects."""
        return posture_rows(self.motions)

    @property
    def people(self) -> People:
        """Variation between these persons where no cause is active."""
        return self.people_with((), ())

    def people_with(self, hypothesis: Hypothesis, named: Hypothesis) -> People:
        """Learn the variation between persons beside some of the ``named`` causes, whose share of the gap is then not
        attributed to bones."""
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
        """Folds of each motion with each person; of a single person each motion, of a single motion each third."""
        every = motions_and_persons(self.motions, self.search.joint.shoulders.person)[0]
        kind = PERSON if PERSON in self.search.folds.kinds else MOTION
        return [fold for fold in every if fold.kind == kind]

    def adapted(self, amplitudes: Amplitudes = NO_EFFECTS) -> AdaptedGaps:
        """Adapt with these effects, as ``girdle adapt --own-bones --effect`` does. Where measured positions are data,
        each person has the sizes that the positions show."""
        rows, folds = posture_rows(self.motions, amplitudes, self.library), motions_and_thirds(self.motions)
        own = None
        if amplitudes and self.search.joint.positions:
            names = self.search.joint.candidates.ordered(list(amplitudes))
            own = own_effects(self.search, names, self.motions, rows, folds, self.library, self.seen)
        return gaps_of(adapt_with_folds(rows, [self.model], folds, people=self.people, effects=own), self.person)

    def misfit(self, noise_deg: float, own_bones: bool) -> tuple[float, int]:
        """Compute the misfit of all postures, in units of the noise, and its degrees of freedom: with own bones, or
        with the six adapted parameters alone."""
        six_alone = {self.model.name: PRIOR._replace(bones=0.0, frames=0.0)}
        people = self.people if own_bones else replace(self.people, everybody=six_alone)
        return misfit(self.rows, self.model, people, noise_deg)

    def predict(self, hypotheses: Sequence[Hypothesis], named: Hypothesis) -> None:
        """Predict the held-out postures with each set of causes, in one batch and only once.

        The sizes are fitted without the held-out postures. Causes that are ``named`` but not in a set have the size 0,
        so that one compiled program serves all sets.
        """
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
        """Return the held-out predictions with a set of causes."""
        self.predict([hypothesis], named)
        return self.found[hypothesis, named]

    def gaps_deg(self, hypothesis: Hypothesis, named: Hypothesis) -> Float[np.ndarray, "folds 6"]:
        """Compute the mean gap of each angle in each fold."""
        return np.array([known_mean(gaps) for gaps in self.held_out(hypothesis, named).gaps_deg])

    def beyond(self, named: Hypothesis, floor_deg: float) -> Hypothesis:
        """Keep common constants, and causes that take a share of the gap of own bones.

        ``floor_deg``: gap of noise alone.
        """
        chosen = tuple(name for name in named if not self.is_constant(name) or self._is_common(name, named))
        while held := [name for name in chosen if self.is_held(name)]:
            self.predict([chosen, *(without(chosen, name) for name in held)], named)
            gaps = {name: self._mean(without(chosen, name), named) for name in held}
            with_all = self._mean(chosen, named)
            idle = [
                name
                for name, gap in gaps.items()
                if gap <= with_all and self.evident(without(chosen, name), chosen, named) < LEAST_PROBABILITY
            ]
            if not idle:
                break
            chosen = without(chosen, min(idle, key=gaps.__getitem__))
        return self.tested(chosen, named, floor_deg)

    def tested(self, chosen: Hypothesis, named: Hypothesis, floor_deg: float) -> Hypothesis:
        """Remove all causes that are tested against own bones, if beside the others they take too little of the gap."""
        return chosen if self.probability(chosen, named, floor_deg) >= LEAST_PROBABILITY else self._constants(chosen)

    def probability(self, chosen: Hypothesis, named: Hypothesis, floor_deg: float) -> float:
        """Compute the probability over resampled persons that causes go beyond own bones, by prediction or by evidence;
        1 where no cause is tested against own bones."""
        constants = self._constants(chosen)
        if len(chosen) == len(constants):
            return 1.0
        return max(self.predicts(chosen, named, floor_deg), self.evident(constants, chosen, named))

    def predicts(self, chosen: Hypothesis, named: Hypothesis, floor_deg: float) -> float:
        """Compute the probability that causes take ``LEAST_SHARE`` or more of the gap of own bones."""
        null, takes = self._taken(self._constants(chosen), chosen, named)
        return float(np.mean((takes >= LEAST_SHARE * (null - floor_deg)) & (takes > 0.0)))

    def evident(self, less: Hypothesis, more: Hypothesis, named: Hypothesis) -> float:
        """Compute the probability by the evidence of the persons that the further causes of ``more`` are active.

        The probability is 0 where more than noise is left, where the gap grows, and for persons too few to learn how
        they differ.
        """
        search = self.search
        if self.people.are_few or not search.leaves_noise:
            return 0.0
        if float(np.mean(self._taken(less, more, named)[1] < 0.0)) >= WORSE:
            return 0.0
        after, before = (self.people_with(one, named).log_likelihood[self.model.name] for one in (more, less))
        both = after.keys() & before.keys()
        gains = np.array([after[s] - before[s] if s in both else 0.0 for s in search.joint.shoulders.subjects])
        log_prior = (len(more) - len(less)) * search.log_odds + self._log_occam(less, more)
        log_odds = search.times @ gains + log_prior
        return float(probabilities([np.zeros_like(log_odds), log_odds])[1])

    def _log_occam(self, less: Hypothesis, more: Hypothesis) -> float:
        """Compute what the sizes of the further causes cost: log evidence less log likelihood at the mode."""
        at, candidates = self.search.mode(more), self.search.joint.candidates
        where, slices = candidates.where(more), candidates.slices(more)
        new = np.concatenate([np.arange(len(where))[own] for effect, own in slices if effect.name not in less])
        scale = candidates.scale[where][new]
        x = (at.amplitude[new] - candidates.mean[where][new]) / scale
        _, root = self.search.given(at, more).amplitude_of(np.ones(len(at.theta_mm)))
        precision = scale[:, None] * (root @ root.T)[np.ix_(new, new)] * scale
        return -0.5 * float(x @ x + np.linalg.slogdet(precision).logabsdet)

    def _taken(
        self, less: Hypothesis, more: Hypothesis, named: Hypothesis
    ) -> tuple[Float[np.ndarray, " draws"], Float[np.ndarray, " draws"]]:
        """Compute the gap of own bones alone, and how much ``more`` causes take of the gap with ``less``, for draws of
        persons."""
        gaps = [known_mean(self.gaps_deg(one, named)) for one in ((), less, more)]
        known = np.isfinite(sum(gaps))
        weights = resampled_persons(self.persons)[:, known]
        weights /= weights.sum(axis=1, keepdims=True)
        null, before, after = (weights @ gap[known] for gap in gaps)
        return null, before - after

    def probability_beyond(self, kept: Hypothesis, named: Hypothesis, floor_deg: float) -> float:
        """Compute the probability that causes go beyond own bones: the ``kept`` causes, or all ``named`` causes if no
        kept cause is tested against own bones."""
        return self.probability(kept if any(map(self.is_held, kept)) else named, named, floor_deg)

    def budget(self, chosen: Hypothesis, named: Hypothesis) -> list[BudgetStep]:
        """Add the causes ``chosen`` from ``named`` one by one, the cause that takes most of the held-out gap first."""
        sets, order = [chosen], []
        if len(chosen) <= _FEW:  # one batch takes less time than several predictions in turn
            self.predict([one for count in range(len(chosen) + 1) for one in combinations(chosen, count)], named)
        while sets[-1]:
            self.predict([without(sets[-1], name) for name in sets[-1]], named)
            dropped = min(sets[-1], key=lambda name: self._mean(without(sets[-1], name), named))
            order.append(dropped)
            sets.append(without(sets[-1], dropped))
        pairs = zip(["", *reversed(order)], reversed(sets), strict=True)
        return [BudgetStep(name, one, self.gaps_deg(one, named)) for name, one in pairs]

    def gains(self, steps: list[BudgetStep], named: Hypothesis, floor_deg: float) -> dict[str, Gain]:
        """Compute the gain of each cause of a gap budget beside the causes before it."""
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
        """Person number of each fold."""
        return np.array([self.person[self.motions.subjects[fold.subject]] for fold in self.folds])

    def _constants(self, chosen: Hypothesis) -> Hypothesis:
        return tuple(name for name in chosen if not self.is_held(name))

    def _mean(self, hypothesis: Hypothesis, named: Hypothesis) -> float:
        return float(np.nanmean(known_mean(self.gaps_deg(hypothesis, named))))

    def _is_common(self, name: str, named: Hypothesis) -> bool:
        """Check whether a constant is common to all persons, of a size whose interval excludes 0, and no consequence of
        a computed axial rotation."""
        if is_its_zero(cause_of(name), self.search.known) or self.common(name, named) < SURE:
            return False
        return not amplitudes(self.search, named, self.seen)[name].may_be_0

    def common(self, name: str, hypothesis: Hypothesis) -> float:
        """Compute the probability, over resampled persons, that a constant cause of a set is common to all persons."""
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
        """Check whether a cause is one that own bones can represent, and is not known to be active."""
        return cause_of(name) in OWN_CONSTANTS and name not in self.search.known

    def tested_on(self, name: str, kept: Hypothesis, named: Hypothesis, floor_deg: float) -> tuple[str, ...]:
        """List the data that confirm a cause of the ``kept`` causes (``Cause.tested_on``)."""
        if cause_of(name) in self.seen:
            return (POSITIONS,)
        if not self.is_held(name):
            return ("angles",) if name in self.search.known else ("evidence",)
        if self.predicts(kept, named, floor_deg) < LEAST_PROBABILITY:
            return ("evidence",)
        kinds = "other_motion", "other_person"
        return kinds if self.folds[0].kind == PERSON else kinds[:1]

    def is_held(self, name: str) -> bool:
        """Check whether a cause is tested against own bones: no constant, not known to be active, and not seen."""
        known = self.is_constant(name) or name in self.search.known
        return not known and cause_of(name) not in self.seen


def _log_evidence(
    precision: Float[np.ndarray, "n n"], slope: Float[np.ndarray, " n"], variance: Float[np.ndarray, " n"]
) -> float:
    """Integrate exp(slope a - a' precision a / 2) over a ~ N(0, ``variance``); return the logarithm."""
    whole = np.eye(len(variance)) + precision * variance
    return float(0.5 * (slope * variance @ np.linalg.solve(whole, slope) - np.linalg.slogdet(whole).logabsdet))


def _standard_error(differences: Float[np.ndarray, " folds"], persons: np.ndarray) -> float:
    """Compute the standard error of the mean over persons or, for one person, over folds."""
    known = np.isfinite(differences)
    different = np.unique(persons[known])
    means = differences[known]
    if len(different) > 1:
        means = np.array([differences[known & (persons == one)].mean() for one in different])
    return float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) > 1 else 0.0
