"""The search over sets of causes: a beam of posterior modes, each widened by what the linear model says of one more,
and then the sets around the best.

    V(H) = log sum_k w_k evidence_k(H) + |H| log(expected / candidates)

The evidence is that of ``fit.posterior``, with each belief k about what no cause explains (``Belief``): noise alone,
what shoulders do each in its own way, what all do alike. w is that of two more causes for the last, which acts
like one that is not in the list; the others are alike. Their variances are those that the best set of a first pass
leaves, in which noise alone is left, then those of the best set with these; and of what all do alike those besides that
are left where nothing is named.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis, lay_out, without
from adapt.diagnosis.fit.discrepancy import NOTHING_OF, TYPICAL, Belief, Discrepancy, log_weights
from adapt.diagnosis.fit.evidence import Evidence, Given
from adapt.diagnosis.fit.joint_fit import JointFit, Linearised, Model, everybody, linearise
from adapt.diagnosis.fit.likeliest import likeliest
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.positions.measured_sizes import measured_sizes
from adapt.diagnosis.fit.positions.position_evidence import shown_sizes
from adapt.diagnosis.fit.positions.position_rows import TURN_THE_SCAPULA_FRAME, PositionRows, position_rows
from adapt.diagnosis.fit.posterior import Posterior, modes
from adapt.diagnosis.fit.search_folds import Folds, folds_of
from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.diagnosis.inference.intervals import resampled_persons
from adapt.diagnosis.marks import scapula_is_carried
from models.effects import Effect
from models.person.family import AnyModel
from motions.rotations import DEG

EXPECTED_CAUSES = 2.0
"""Of all candidates, before any data."""

_WIDTHS = ((1, 10, 10), (4, 4, 10), (3, 4, 8), (2, 4, 5), (1, 3, 3))
"""At each number of causes: sets to widen, candidates to add to each, and sets to fit."""

_HOPELESS = 3.0
"""A level that is worse than the best by this much in V ends the search: an odds of 20."""

_MOST_PASSES = 4
"""With what the best set leaves; most end after two, with the same set."""

_AROUND, _FITTED_AROUND = 3, 8
"""Best sets around which others are looked for, and how many of these are fitted at once."""

_TRIED = 4
"""So many other causes are fitted in the place of one."""

_KEPT = 20
"""Sets that a pass hands to the next."""

_WORST = -1e9


class Node(NamedTuple):
    """One hypothesis, fitted."""

    hypothesis: Hypothesis
    posterior: Posterior
    by_belief: Float[np.ndarray, "beliefs draws"]
    """log w_k evidence_k + |H| log odds: of all persons, and of persons drawn anew."""

    @property
    def value(self) -> float:
        """V."""
        return float(np.logaddexp.reduce(self.by_belief[:, 0]))

    @property
    def resampled(self) -> Float[np.ndarray, " draws"]:
        """V of persons drawn anew."""
        return np.logaddexp.reduce(self.by_belief[:, 1:])


class Hope(NamedTuple):
    """What the linear model says of a set."""

    value: float
    """V."""
    hypothesis: Hypothesis
    start: Node
    """The set in whose mode that is, where a fit begins."""


@dataclass
class Search:
    """All hypotheses that were fitted, by name."""

    joint: JointFit
    folds: Folds
    progress: Callable[[str], None] = lambda _: None
    known: Hypothesis = ()
    """Causes that are active whatever the gap says."""
    nodes: dict[Hypothesis, Node] = field(default_factory=dict)
    predicted: dict[tuple[Hypothesis, Hypothesis], float] = field(default_factory=dict)
    """V of sets from the modes of others, by both names."""
    posteriors: dict[Hypothesis, Posterior] = field(default_factory=dict)
    """Of the few sets of which it was asked what they predict (``mode``)."""
    discrepancy: Discrepancy = TYPICAL
    """Of the belief that is most probable with the best set; modes are found with it."""
    beliefs: tuple[Belief, ...] = (Belief("common", TYPICAL),)
    learnt: Hypothesis = ()
    """The set that left what the beliefs say."""
    likelihoods: dict[tuple[Discrepancy, str | None], Likelihood] = field(default_factory=dict)
    """By the discrepancy, and what is held out of them."""

    @cached_property
    def log_odds(self) -> float:
        """Of one more cause, before any data."""
        causes = set(self.joint.candidates.causes.values())
        return float(np.log(min(0.5, EXPECTED_CAUSES / max(1, len(causes)))))

    @cached_property
    def times(self) -> Float[np.ndarray, "draws subjects"]:
        """How much each shoulder counts, of persons drawn anew."""
        return resampled_persons(self.joint.shoulders.person)

    @property
    def likelihood(self) -> Likelihood:
        """With the discrepancy as it is known now."""
        return self.likelihood_without(None)

    def likelihood_without(self, motion: str | None) -> Likelihood:
        """Hold a motion out."""
        return self._with(self.discrepancy, motion)

    def _with(self, discrepancy: Discrepancy, motion: str | None = None) -> Likelihood:
        key = discrepancy, motion
        if key not in self.likelihoods:
            seen = None if motion is None else self.folds.label != motion
            self.likelihoods[key] = Likelihood.of(self.joint, discrepancy, seen)
        return self.likelihoods[key]

    def _modes(self, hypotheses: Sequence[Hypothesis], thetas_mm, amplitudes) -> list[Posterior]:
        beliefs = [self._with(one.discrepancy) for one in self.beliefs]
        return modes(self.joint, self.likelihood, hypotheses, thetas_mm, amplitudes, beliefs)

    def fit(self, names: Sequence[str], start: Node | None) -> Node:
        """Fit a hypothesis, from the fit of another one; without one, what is known."""
        hypothesis = self.joint.candidates.ordered(names)
        if hypothesis in self.nodes:
            return self.nodes[hypothesis]
        if start is None:
            theta = [self.without_causes.theta_mm, self.joint.model.theta_mm]
            believed = self.joint.candidates.mean[self.joint.candidates.where(hypothesis)]
            found = self._modes([hypothesis] * 2, theta, [believed] * 2)
            return self._add(max(found, key=lambda one: self._value(one, hypothesis)))
        return self.fit_all([(hypothesis, start)])[0]

    def fit_all(self, starts: Sequence[tuple[Hypothesis, Node]]) -> list[Node]:
        """Fit hypotheses side by side, each from the fit of another one and from that of what is known: of measured
        shoulders a set has several modes, which are up to 30 nats apart, and some starts lead nowhere."""
        missing = {hypothesis: start for hypothesis, start in starts if hypothesis not in self.nodes}
        if missing:
            known = self.nodes[self.known]
            pairs = [*missing.items(), *((one, known) for one, start in missing.items() if start is not known)]
            thetas = [start.posterior.theta_mm for _, start in pairs]
            amplitudes = [self._amplitude_at(start, hypothesis) for hypothesis, start in pairs]
            for posterior in self._modes([hypothesis for hypothesis, _ in pairs], thetas, amplitudes):
                self._add(posterior)
        return [self.nodes[hypothesis] for hypothesis, _ in starts]

    def _amplitude_at(self, start: Node, hypothesis: Hypothesis) -> Float[np.ndarray, " own"]:
        """Where the amplitudes of a hypothesis begin: as in the fit, else where they are believed to be."""
        candidates = self.joint.candidates
        a = candidates.mean.copy()
        a[candidates.where(start.hypothesis)] = start.posterior.amplitude
        return a[candidates.where(hypothesis)]

    def _add(self, posterior: Posterior) -> Node:
        """Add a fitted hypothesis, unless another of its modes has more evidence."""
        hypothesis = posterior.hypothesis
        by_belief = np.full((len(self.beliefs), 1 + len(self.times)), _WORST)
        amplitude = self.given(posterior, hypothesis).amplitude
        if self.joint.candidates.has_the_sign(hypothesis, amplitude, self.known):
            by_belief = self._by_belief(posterior, hypothesis, self.times)
        node, other = Node(hypothesis, posterior, by_belief), self.nodes.get(hypothesis)
        if other is None or node.value > other.value:
            self.nodes[hypothesis] = node
        self.progress(f"{len(self.nodes)} sets of causes")
        return self.nodes[hypothesis]

    def _by_belief(
        self, posterior: Posterior, hypothesis: Hypothesis, times: Float[np.ndarray, "draws subjects"]
    ) -> Float[np.ndarray, "beliefs 1+draws"]:
        """Compute what V is of with each belief, in the linear model around the mode of a set within it: of all
        persons, and of those that count so much."""
        candidates = self.joint.candidates
        where, here = candidates.where(hypothesis), candidates.among_all(posterior.hypothesis, posterior.amplitude)
        believed = candidates.mean[where], candidates.scale[where]
        each = [one.given(where, here[where], *believed) for one in posterior.by_belief]
        found = [np.append(one.log_evidence, one.resampled(times) if len(times) else []) for one in each]
        return np.array(found) + len(hypothesis) * self.log_odds + log_weights(self.beliefs, self.log_odds)[:, None]

    def by_belief(self, near: Node, hypothesis: Hypothesis) -> Float[np.ndarray, "beliefs draws"]:
        """Predict those of persons drawn anew from the mode of another set."""
        return self._by_belief(near.posterior, hypothesis, self.times)[:, 1:]

    def _value(self, posterior: Posterior, hypothesis: Hypothesis) -> float:
        """Compute V of a set in the linear model around the mode of one within it."""
        return float(np.logaddexp.reduce(self._by_belief(posterior, hypothesis, self.times[:0])[:, 0]))

    def given(self, posterior: Posterior, hypothesis: Hypothesis) -> Given:
        """Give a set, in the linear model around the mode of one within it."""
        candidates = self.joint.candidates
        where, here = candidates.where(hypothesis), candidates.among_all(posterior.hypothesis, posterior.amplitude)
        return posterior.evidence.given(where, here[where], candidates.mean[where], candidates.scale[where])

    def widened(self, node: Node) -> list[Hope]:
        """Predict every set with one more cause, the best first."""
        found = []
        for hypothesis in self._with_one_more(node.hypothesis):
            known = self.nodes.get(hypothesis)
            found.append(Hope(known.value if known else self._predicted(node, hypothesis), hypothesis, node))
        return sorted(found, key=lambda one: -one.value)

    def _with_one_more(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Every set with one more cause."""
        candidates = self.joint.candidates
        causes = {candidates.causes[name] for name in hypothesis}
        more = (one.name for one in candidates.effects if one.cause not in causes)
        return [candidates.ordered((*hypothesis, name)) for name in more]

    def _predicted(self, node: Node, hypothesis: Hypothesis) -> float:
        """Predict V of a set from the mode of another one, once."""
        both = node.hypothesis, hypothesis
        if both not in self.predicted:
            self.predicted[both] = self._value(node.posterior, hypothesis)
        return self.predicted[both]

    def beam(self, first: Sequence[str] = ()) -> None:
        """Search upwards from what is known, or beside it from a cause that no straight line leads to."""
        known = self.fit(self.known, None)
        level = [self.fit((*self.known, *first), known)]
        best = level[0].value
        for sets, each, fits in _WIDTHS:
            widened = [one for node in _highest(level, sets) for one in self.widened(node)[:each] if one.value > _WORST]
            level = self.fit_all(_most_hopeful(widened, fits // 2 if first else fits))
            if not level:
                return
            highest = max(node.value for node in level)
            if highest < best - _HOPELESS:
                return
            best = max(best, highest)

    def run(self) -> "Search":
        """Search from what is known, and beside it from each effect whose size has been measured: as if noise alone
        were left, as large as all that nothing explains where nothing is named; again with what the best set leaves;
        and around the best sets with what the best of these leaves, until it is the same."""
        first = self.fit(self.known, None)
        smooth = likeliest(self.joint, first.posterior)
        noise = smooth._replace(**dict.fromkeys(NOTHING_OF["noise"], 0.0))
        self._place_landmarks(first, noise)
        self._share_noise(first, smooth)
        white_deg = float(np.sqrt(noise.noise_deg**2 + smooth.smooth_deg2))  # with less, modes take many more steps
        self._believe([Belief("noise", noise._replace(noise_deg=white_deg))])
        self._beams()
        self._learn(self.best, smooth)
        self._beams()
        for _ in range(_MOST_PASSES):
            self.around()
            if self.best.hypothesis == self.learnt:
                break
            self._learn(self.best, smooth)
        return self

    def _beams(self) -> None:
        self.beam()
        for effect in self.joint.candidates.effects:
            if effect.prior.mean and effect.name not in self.known:
                self.beam((effect.name,))

    def around(self) -> None:
        """Fit what has one cause more, less or in the place of another than the best sets, the most hopeful first,
        until none is better: two that belong together do not come one after the other."""
        while True:
            best = self.best.value
            beside = [one for node in _highest(self.usable, _AROUND) for one in self.beside(node)]
            self.fit_all(_most_hopeful(beside, _FITTED_AROUND))
            if self.best.value <= best:
                return

    def beside(self, node: Node) -> list[Hope]:
        """Predict every set that is not fitted with one cause more, less, or in the place of another than one has."""
        less = [without(node.hypothesis, name) for name in node.hypothesis if name not in self.known]
        sets = {*less, *(one for kept in (node.hypothesis, *less) for one in self._with_one_more(kept))}
        return [Hope(self._predicted(node, one), one, node) for one in sorted(sets.difference(self.nodes))]

    def _place_landmarks(self, first: Node, discrepancy: Discrepancy) -> None:
        """Take the landmarks of the scapula for carried by its marker, and not on the bone, where a cause that turns
        the measured frame in the bone explains more so."""
        candidates, rows = self.joint.candidates, self.joint.positions
        turning = [one.name for one in candidates.effects if one.cause in TURN_THE_SCAPULA_FRAME]
        if rows and rows.landmarks and turning:
            sets = [candidates.ordered((*first.hypothesis, name)) for name in turning]
            self._take_the_likelier([rows, rows.carried(candidates)], first, sets, discrepancy)

    def _share_noise(self, first: Node, discrepancy: Discrepancy) -> None:
        """Take the noise of the angles for what the landmarks are compared with as well, where that explains more: not
        where one marker gave both."""
        rows = self.joint.positions
        if rows:
            both = [rows, replace(rows, noise_in_y=self.noise_in_y)]
            self._take_the_likelier(both, first, [first.hypothesis], discrepancy)

    def _take_the_likelier(
        self, rows: Sequence[PositionRows], first: Node, sets: Sequence[Hypothesis], discrepancy: Discrepancy
    ) -> None:
        """Take positions as they are the most probable with the best of some sets."""
        joints, values = [replace(self.joint, positions=one) for one in rows], []
        for joint in joints:
            at = replace(first.posterior, by_belief=(self._linear(Likelihood.of(joint, discrepancy), first.posterior),))
            values.append(max(self._value(at, one) for one in sets))
        self.joint = joints[int(np.argmax(values))]
        self.likelihoods.clear()

    def _linear(self, likelihood: Likelihood, at: Posterior) -> Evidence:
        """Compute the evidence of all candidates in the linear model around a mode."""
        candidates = self.joint.candidates
        here = candidates.among_all(at.hypothesis, at.amplitude)
        return likelihood.evidence(at.theta_mm, at.y, at.Z, np.arange(len(candidates.scale)), here)

    def _learn(self, best: Node, smooth: Discrepancy) -> None:
        """Estimate what the best set leaves to each belief, and fit the best sets anew with them; where nothing is
        named ``smooth`` is left."""
        self.learnt = best.hypothesis
        before = {one.left: one.discrepancy for one in reversed(self.beliefs)}
        beliefs = [
            Belief(left, likeliest(self.joint, best.posterior, none, before.get(left, smooth)))
            for left, none in NOTHING_OF.items()
        ]
        if best.hypothesis != self.known:
            beliefs.append(Belief("common", smooth))
        self._believe(beliefs)

    def _believe(self, beliefs: Sequence[Belief]) -> None:
        """Fit the best sets anew with these beliefs."""
        best = _highest(self.usable, _KEPT)
        before = list({one.hypothesis: one for one in (*best, self.nodes[self.known])}.values())
        self.beliefs = tuple(beliefs)
        self.discrepancy = self._most_probable(before[0])
        self.nodes = {}
        self.predicted.clear()
        thetas, amplitudes = zip(*((one.posterior.theta_mm, one.posterior.amplitude) for one in before), strict=True)
        for posterior in self._modes([one.hypothesis for one in before], thetas, amplitudes):
            self._add(posterior)

    def _most_probable(self, node: Node) -> Discrepancy:
        """Find the belief that is most probable with a set."""
        at = node.posterior
        by_belief = tuple(self._linear(self._with(one.discrepancy), at) for one in self.beliefs)
        found = self._by_belief(replace(at, by_belief=by_belief), node.hypothesis, self.times[:0])[:, 0]
        return self.beliefs[int(np.argmax(found))].discrepancy

    def in_place_of(self, node: Node, own: str) -> dict[str, Node]:
        """Fit the most hopeful sets with another cause in the place of one; the best of each cause, its own among
        them."""
        less = self.without(node, own)
        self.fit_all([(hypothesis, start) for _, hypothesis, start in self.widened(less)[:_TRIED]])
        others = set(less.hypothesis)
        found: dict[str, Node] = {}
        for one in sorted(self.usable, key=lambda one: one.value):
            if len(one.hypothesis) == len(node.hypothesis) and others < set(one.hypothesis):
                (name,) = set(one.hypothesis) - others
                found[self.joint.candidates.causes[name]] = one
        return found

    def without(self, node: Node, name: str) -> Node:
        """Fit a set with one cause less, from the largest set within it, or from itself."""
        wanted = without(node.hypothesis, name)
        within = (one for one in self.nodes.values() if set(one.hypothesis) <= set(wanted))
        return self.fit(wanted, max(within, key=lambda one: (len(one.hypothesis), one.value), default=node))

    def mode(self, hypothesis: Hypothesis) -> Posterior:
        """Give the mode of a set. A set without the known causes was not searched, and is fitted here, once."""
        if hypothesis not in self.posteriors:
            near = min(self.nodes.values(), key=lambda one: (len(set(one.hypothesis) ^ set(hypothesis)), -one.value))
            found = near.posterior
            if near.hypothesis != hypothesis:
                start = near.posterior.theta_mm, self._amplitude_at(near, hypothesis)
                (found,) = self._modes([hypothesis], [start[0]], [start[1]])
            self.posteriors[hypothesis] = found
        return self.posteriors[hypothesis]

    def sizes_of_shoulders(
        self, hypothesis: Hypothesis, seen: Collection[str], motion: str | None = None
    ) -> list[dict[str, np.ndarray]]:
        """Give the amplitudes of every shoulder by effect, where their posterior is highest, without a motion; of the
        causes that were ``seen``, those that positions show."""
        candidates, at, likelihood = self.joint.candidates, self.mode(hypothesis), self.likelihood_without(motion)
        where, here = candidates.where(hypothesis), candidates.among_all(at.hypothesis, at.amplitude)
        evidence = likelihood.evidence(at.theta_mm, at.y, at.Z, np.arange(len(here)), here)
        sizes = evidence.given(where, here[where], candidates.mean[where], candidates.scale[where]).of_shoulders
        if shown := shown_sizes(likelihood.positions, candidates, hypothesis, seen):
            sizes[:, shown.where] = shown.given.of_shoulders
        return [{effect.name: a[own] for effect, own in candidates.slices(hypothesis)} for a in sizes]

    @cached_property
    def without_causes(self) -> Linearised:
        """Adapt as `girdle adapt` does without effects."""
        return linearise(self.joint, self.joint.from_starts().theta_mm.T)

    @property
    def noise_in_y(self) -> Float[np.ndarray, "rows 3 6"]:
        """What a degree of noise in each measured angle does to y."""
        return self.without_causes.B / DEG * self.joint.shoulders.measured.T[:, None]

    @property
    def best(self) -> Node:
        """The set of the highest V."""
        return max(self.usable, key=lambda node: node.value)

    @property
    def left_over_share(self) -> float:
        """Share of the variance that is smooth along the motions, where nothing is named, that the best set leaves."""
        best, *nothing = self._common
        return best.smooth_deg2 / nothing[0].smooth_deg2 if nothing else 1.0

    @property
    def shared_turn_deg(self) -> float:
        """What all shoulders have in common of how angles contradict landmarks, beside the best set."""
        return self._common[0].common_turn_deg

    @property
    def _common(self) -> list[Discrepancy]:
        """What all do alike is, beside the best set; and, if another is, where nothing is named."""
        return [one.discrepancy for one in self.beliefs if one.left == "common"]

    @property
    def usable(self) -> list[Node]:
        """All fitted hypotheses whose effects act the right way."""
        return [node for node in self.nodes.values() if node.value > _WORST]


def _highest(nodes: Sequence[Node], most: int) -> list[Node]:
    return sorted(nodes, key=lambda one: -one.value)[:most]


def _most_hopeful(hopes: Sequence[Hope], most: int) -> list[tuple[Hypothesis, Node]]:
    """Keep so many sets, and of each where it is most probable, the best first."""
    best: dict[Hypothesis, Hope] = {}
    for one in sorted(hopes, key=lambda one: -one.value):
        best.setdefault(one.hypothesis, one)
    return [(one.hypothesis, one.start) for one in best.values()][:most]


def search_of(
    model: AnyModel,
    shoulders: Shoulders,
    effects: Sequence[Effect],
    known: Hypothesis = (),
    position_noise_mm: float | None = None,
    angles_are_of_landmarks: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Search:
    """Lay out the search for causes among these effects, with what landmarks say of them; nothing is fitted.

    ``position_noise_mm``: of a coordinate of a measured landmark; with it, positions are data as angles are. Without
    it, they say what size bones have; and so do landmarks from which the angles were computed.
    """
    fitted = Model.of(model, shoulders.subjects, tuple(effects))
    girdle = fitted.sets.girdle
    apart = position_noise_mm is None or angles_are_of_landmarks
    candidates, rows = lay_out(effects, shoulders, measured_sizes(shoulders, girdle, effects) if apart else {}), None
    if position_noise_mm is not None:
        rows = position_rows(model, girdle, candidates, shoulders, position_noise_mm)
        if rows and angles_are_of_landmarks:
            rows = rows.beside_angles_of_them(shoulders.angles, not scapula_is_carried(shoulders.motions))
    joint = JointFit(fitted, shoulders, candidates, everybody(shoulders), rows)
    return Search(joint, folds_of(shoulders), progress, known)
