"""Search over sets of causes: a beam of posterior modes, each widened by one cause with the linear model, and then the
sets around the best sets.

    V(H) = log sum_k w_k evidence_k(H) + |H| log(expected / candidates)

The evidence is computed as in ``fit.posterior``, with each belief k about the unexplained part (``Belief``): noise
alone, something of each shoulder, or something common to all shoulders. The first two beliefs have equal weights w. The
common part acts like a cause that is not in the list, so the weight of its belief is that of two more causes. The
variances of the beliefs are estimated from what the best set leaves unexplained: first of the beams, with noise alone,
then of the search around their sets. The common belief is also used with the variances where nothing is named. The
weights include the integral over the variances (``fit.likeliest.log_volume``).
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis, build_design, without
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
"""Expected number of active causes among all candidates, before any data."""

_WIDTHS = ((1, 10, 10), (4, 4, 10), (3, 4, 8), (2, 4, 5), (1, 3, 3))
"""Beam widths per number of causes: sets to widen, candidates to add to each set, and sets to fit."""

_HOPELESS = 3.0
"""Difference in V between the best set so far and the best of a level (odds of 20), beyond which a beam ends."""

_MOST_PASSES = 4
"""Largest number of passes with variances learnt from the best set; most searches end after two, at the same set."""

_AROUND, _FITTED_AROUND = 3, 8
"""Number of best sets whose neighbours are searched, and number of neighbours that are fitted in one batch."""

_TRIED = 4
"""Number of alternatives that are fitted in place of a cause."""

_KEPT = 20
"""Number of sets that a pass hands to the next pass."""

_WORST = -1e9


@dataclass(frozen=True, eq=False)
class Node:
    """Fitted hypothesis."""

    hypothesis: Hypothesis
    posterior: Posterior
    value: float
    """V for all persons."""


class Hope(NamedTuple):
    """Prediction for a set by the linear model around the mode of another set."""

    value: float
    """Predicted V."""
    hypothesis: Hypothesis
    start: Node
    """Set at whose mode the prediction is made, the starting point of a fit."""


@dataclass
class Search:
    """Search over sets of causes, with all fitted hypotheses."""

    joint: JointFit
    folds: Folds
    progress: Callable[[str], None] = lambda _: None
    known: Hypothesis = ()
    """Causes that are known to be active, in every set of the search."""
    nodes: dict[Hypothesis, Node] = field(default_factory=dict)
    predicted: dict[tuple[Hypothesis, Hypothesis], float] = field(default_factory=dict)
    """Cache of V predicted from the mode of another set, by the names of both sets."""
    draws: dict[Node, Float[np.ndarray, "beliefs draws"]] = field(default_factory=dict)
    """Cache of the terms of V of fitted sets by draw of persons; only few sets need them."""
    posteriors: dict[Hypothesis, Posterior] = field(default_factory=dict)
    """Cache of the modes of the few sets whose predictions were needed (``mode``)."""
    discrepancy: Discrepancy = TYPICAL
    """Discrepancy of the belief that is most probable with the best set, used to find modes."""
    beliefs: tuple[Belief, ...] = (Belief("common", TYPICAL),)
    learnt: Hypothesis = ()
    """Set from whose residuals the beliefs were learnt."""
    likelihoods: dict[tuple[Discrepancy, str | None], Likelihood] = field(default_factory=dict)
    """Cache of likelihoods by the discrepancy and the held-out motion."""

    @cached_property
    def log_odds(self) -> float:
        """Log odds of one more cause, before any data."""
        causes = set(self.joint.candidates.causes.values())
        return float(np.log(min(0.5, EXPECTED_CAUSES / max(1, len(causes)))))

    @cached_property
    def times(self) -> Float[np.ndarray, "draws subjects"]:
        """Weight of each shoulder in each draw of persons."""
        return resampled_persons(self.joint.shoulders.person)

    @property
    def likelihood(self) -> Likelihood:
        """Likelihood with the present discrepancy."""
        return self.likelihood_without(None)

    def likelihood_without(self, motion: str | None) -> Likelihood:
        """Return the likelihood with a motion held out."""
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
        """Fit a hypothesis from the fit ``start`` of another one, or else from the adaptation without causes and from
        the parameter set."""
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
        """Fit hypotheses in one batch, each from the fit of another hypothesis and from the fit of the known causes.

        For measured shoulders a set has several modes, up to 30 nats apart, and some starts do not converge.
        """
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
        """Return starting amplitudes of a hypothesis: as in the fit ``start``, or else the prior mean."""
        candidates = self.joint.candidates
        a = candidates.mean.copy()
        a[candidates.where(start.hypothesis)] = start.posterior.amplitude
        return a[candidates.where(hypothesis)]

    def _add(self, posterior: Posterior) -> Node:
        """Add a fitted hypothesis, unless another mode of the hypothesis has more evidence."""
        hypothesis = posterior.hypothesis
        amplitude = self.given(posterior, hypothesis).amplitude
        possible = self.joint.candidates.has_the_sign(hypothesis, amplitude, self.known)
        value = self._value(posterior, hypothesis) if possible else _WORST
        node, other = Node(hypothesis, posterior, value), self.nodes.get(hypothesis)
        if other is None or node.value > other.value:
            self.nodes[hypothesis] = node
        self.progress(f"{len(self.nodes)} sets of causes")
        return self.nodes[hypothesis]

    def _log_prior(self, hypothesis: Hypothesis) -> Float[np.ndarray, " beliefs"]:
        """Compute log w_k + |H| log odds."""
        return len(hypothesis) * self.log_odds + log_weights(self.beliefs, self.log_odds)

    def _by_belief(self, posterior: Posterior, hypothesis: Hypothesis) -> Float[np.ndarray, " beliefs"]:
        """Compute the terms log w_k evidence_k + |H| log odds of V for all persons."""
        each = self._each_given(posterior, hypothesis, posterior.by_belief)
        return np.array([one.log_evidence for one in each]) + self._log_prior(hypothesis)

    def _value(self, posterior: Posterior, hypothesis: Hypothesis) -> float:
        """Compute V of a set in the linear model around the mode of a subset."""
        return float(np.logaddexp.reduce(self._by_belief(posterior, hypothesis)))

    def by_belief(self, near: Node, hypothesis: Hypothesis) -> Float[np.ndarray, "beliefs draws"]:
        """Predict the terms of V for each belief and draw of persons from the mode of another set."""
        each = self._each_given(near.posterior, hypothesis, near.posterior.by_belief)
        return np.array([one.resampled(self.times) for one in each]) + self._log_prior(hypothesis)[:, None]

    def of_draws(self, node: Node) -> Float[np.ndarray, "beliefs draws"]:
        """Compute the terms of V of a fitted set for each belief and draw of persons."""
        if node not in self.draws:
            self.draws[node] = self.by_belief(node, node.hypothesis)
        return self.draws[node]

    def resampled(self, node: Node) -> Float[np.ndarray, " draws"]:
        """Compute V of a fitted set for each draw of persons."""
        return np.logaddexp.reduce(self.of_draws(node))

    def given(self, posterior: Posterior, hypothesis: Hypothesis) -> Given:
        """Return the evidence given a set of causes, in the linear model around the mode of a subset."""
        return self._each_given(posterior, hypothesis, [posterior.evidence])[0]

    def _each_given(self, at: Posterior, hypothesis: Hypothesis, evidence: Sequence[Evidence]) -> list[Given]:
        """Return each of some evidences at a mode given a set of causes."""
        candidates = self.joint.candidates
        where, here = candidates.where(hypothesis), candidates.among_all(at.hypothesis, at.amplitude)
        return [one.given(where, here[where], candidates.mean[where], candidates.scale[where]) for one in evidence]

    def widened(self, node: Node) -> list[Hope]:
        """Predict V of every set with one more cause, the best first."""
        found, candidates = [], self.joint.candidates
        causes = {candidates.causes[name] for name in node.hypothesis}
        for name in (one.name for one in candidates.effects if one.cause not in causes):
            hypothesis = candidates.ordered((*node.hypothesis, name))
            known = self.nodes.get(hypothesis)
            found.append(Hope(known.value if known else self._predicted(node, hypothesis), hypothesis, node))
        return sorted(found, key=lambda one: -one.value)

    def _predicted(self, node: Node, hypothesis: Hypothesis) -> float:
        """Predict V of a set from the mode of another set, and cache it."""
        both = node.hypothesis, hypothesis
        if both not in self.predicted:
            self.predicted[both] = self._value(node.posterior, hypothesis)
        return self.predicted[both]

    def beam(self, first: Sequence[str] = ()) -> None:
        """Search from the known causes to larger sets. ``first``: a further cause to start from, for causes that the
        linear model cannot predict from amplitude 0."""
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
        """Run the whole search.

        The beams, from the known causes and from each effect of measured size beside them, treat all that is
        unexplained where nothing is named as noise. Searches around their best sets follow, with the variances that the
        best set leaves, until it stays the same.
        """
        first = self.fit(self.known, None)
        smooth = likeliest(self.joint, first.posterior)
        left = smooth.discrepancy
        noise = left._replace(**dict.fromkeys(NOTHING_OF["noise"], 0.0))
        self._place_landmarks(first, noise)
        self._share_noise(first, left)
        white_deg = float(np.sqrt(left.noise_deg**2 + left.smooth_deg2))  # with less, modes take many more steps
        self._believe([Belief("noise", noise._replace(noise_deg=white_deg))])
        self.beam()
        for effect in self.joint.candidates.effects:
            if effect.prior.mean and effect.name not in self.known:
                self.beam((effect.name,))
        self._learn(self.best, smooth)
        for _ in range(_MOST_PASSES):
            self.around()
            if self.best.hypothesis == self.learnt:
                break
            self._learn(self.best, smooth)
        return self

    def around(self) -> None:
        """Fit the most promising neighbours of the best sets (one cause more, less or replaced) until none is better.

        The beam misses pairs of causes that improve V only together. Sets with a cause less are fitted before another
        is added in its place: the linear model predicts well what a cause adds, but of measured shoulders what is left
        without a large one up to 60 nats too high.
        """
        while True:
            best, near = self.best.value, _highest(self.usable, _AROUND)
            less = {
                without(node.hypothesis, name): node
                for node in near
                for name in node.hypothesis
                if name not in self.known
            }
            bases = dict.fromkeys((*near, *self.fit_all(list(less.items()))))
            more = [one for node in bases for one in self.widened(node) if one.hypothesis not in self.nodes]
            self.fit_all(_most_hopeful(more, _FITTED_AROUND))
            if self.best.value <= best:
                return

    def _place_landmarks(self, first: Node, discrepancy: Discrepancy) -> None:
        """Decide whether the landmarks of the scapula are on the bone or carried by its marker.

        They count as carried where a cause that turns the measured frame in the bone then explains more.
        """
        candidates, rows = self.joint.candidates, self.joint.positions
        turning = [one.name for one in candidates.effects if one.cause in TURN_THE_SCAPULA_FRAME]
        if rows and rows.landmarks and turning:
            sets = [candidates.ordered((*first.hypothesis, name)) for name in turning]
            self._take_the_likelier([rows, rows.carried(candidates)], first, sets, discrepancy)

    def _share_noise(self, first: Node, discrepancy: Discrepancy) -> None:
        """Let the positions share the noise of the angles where this explains more.

        This is not so where one marker gave both angles and landmarks.
        """
        rows = self.joint.positions
        if rows:
            both = [rows, replace(rows, noise_in_y=self.noise_in_y)]
            self._take_the_likelier(both, first, [first.hypothesis], discrepancy)

    def _take_the_likelier(
        self, rows: Sequence[PositionRows], first: Node, sets: Sequence[Hypothesis], discrepancy: Discrepancy
    ) -> None:
        """Choose the position rows that are most probable with the best of some sets."""
        joints, values = [replace(self.joint, positions=one) for one in rows], []
        for joint in joints:
            at = replace(first.posterior, by_belief=(self._linear(Likelihood.of(joint, discrepancy), first.posterior),))
            values.append(max(self._value(at, one) for one in sets))
        self.joint = joints[int(np.argmax(values))]
        self.likelihoods.clear()

    def _linear(self, likelihood: Likelihood, at: Posterior) -> Evidence:
        """Compute the evidence for all candidates in the linear model around a mode."""
        candidates = self.joint.candidates
        here = candidates.among_all(at.hypothesis, at.amplitude)
        return likelihood.evidence(at.theta_mm, at.y, at.Z, np.arange(len(candidates.scale)), here)

    def _learn(self, best: Node, smooth: Belief) -> None:
        """Learn each belief from the best set, and refit the best sets. ``smooth``: common belief where nothing is
        named."""
        self.learnt = best.hypothesis
        before = {one.left: one.discrepancy for one in reversed(self.beliefs)}
        beliefs = [
            likeliest(self.joint, best.posterior, left, before.get(left, smooth.discrepancy)) for left in NOTHING_OF
        ]
        if best.hypothesis != self.known:
            beliefs.append(smooth)
        self._believe(beliefs)

    def _believe(self, beliefs: Sequence[Belief]) -> None:
        """Refit the best sets with these beliefs."""
        best = _highest(self.usable, _KEPT)
        before = list({one.hypothesis: one for one in (*best, self.nodes[self.known])}.values())
        self.beliefs = tuple(beliefs)
        self.discrepancy = self._most_probable(before[0])
        self.nodes = {}
        self.predicted.clear()
        self.draws.clear()
        thetas, amplitudes = zip(*((one.posterior.theta_mm, one.posterior.amplitude) for one in before), strict=True)
        for posterior in self._modes([one.hypothesis for one in before], thetas, amplitudes):
            self._add(posterior)

    def _most_probable(self, node: Node) -> Discrepancy:
        """Find the discrepancy of the belief that is most probable with a set."""
        at = node.posterior
        by_belief = tuple(self._linear(self._with(one.discrepancy), at) for one in self.beliefs)
        return self._belief_with(replace(at, by_belief=by_belief), node.hypothesis).discrepancy

    def _belief_with(self, posterior: Posterior, hypothesis: Hypothesis) -> Belief:
        """Find the belief that is most probable with a set."""
        return self.beliefs[int(np.argmax(self._by_belief(posterior, hypothesis)))]

    def in_place_of(self, node: Node, own: str) -> dict[str, Node]:
        """Fit the most promising sets with another cause in place of ``own``; return the best set by cause, including
        the cause of ``own``."""
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
        """Fit a set without one of its causes, from its largest fitted subset or else from ``node``."""
        wanted = without(node.hypothesis, name)
        within = (one for one in self.nodes.values() if set(one.hypothesis) <= set(wanted))
        return self.fit(wanted, max(within, key=lambda one: (len(one.hypothesis), one.value), default=node))

    def mode(self, hypothesis: Hypothesis) -> Posterior:
        """Return the mode of a set; sets without the known causes were not searched and are fitted here, once."""
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
        """Compute the amplitudes of every shoulder by effect at their posterior mode, optionally without a motion.

        Causes that were ``seen`` have the amplitudes that positions show.
        """
        candidates, at, likelihood = self.joint.candidates, self.mode(hypothesis), self.likelihood_without(motion)
        sizes = self._each_given(at, hypothesis, [self._linear(likelihood, at)])[0].of_shoulders
        if shown := shown_sizes(likelihood.positions, candidates, hypothesis, seen):
            sizes[:, shown.where] = shown.given.of_shoulders
        return [{effect.name: a[own] for effect, own in candidates.slices(hypothesis)} for a in sizes]

    @cached_property
    def without_causes(self) -> Linearised:
        """Linear model around the adaptation without causes, as in ``girdle adapt``."""
        return linearise(self.joint, self.joint.from_starts().theta_mm.T)

    @property
    def noise_in_y(self) -> Float[np.ndarray, "rows 3 6"]:
        """Change of y per degree of noise in each measured angle."""
        return self.without_causes.B / DEG * self.joint.shoulders.measured.T[:, None]

    @property
    def best(self) -> Node:
        """Set with the highest V."""
        return max(self.usable, key=lambda node: node.value)

    @property
    def leaves_noise(self) -> bool:
        """Check whether beside the best set noise alone is the most probable belief."""
        return self._belief_with(self.best.posterior, self.best.hypothesis).left == "noise"

    @property
    def unexplained_share(self) -> float:
        """Smooth variance along the motions with the best set, as a share of the variance where nothing is named."""
        best, *nothing = self.left_by("common")
        return best.smooth_deg2 / nothing[0].smooth_deg2 if nothing else 1.0

    def left_by(self, left: str) -> list[Discrepancy]:
        """List the discrepancies of a kind of belief: beside the best set and, if they differ, where nothing is
        named."""
        return [one.discrepancy for one in self.beliefs if one.left == left]

    def log_evidence(self, discrepancy: Discrepancy) -> float:
        """Compute the log evidence of the best set with a discrepancy."""
        at, hypothesis = self.best.posterior, self.best.hypothesis
        return self._each_given(at, hypothesis, [self._linear(self._with(discrepancy), at)])[0].log_evidence

    @property
    def usable(self) -> list[Node]:
        """Fitted hypotheses whose effects all have the right sign."""
        return [node for node in self.nodes.values() if node.value > _WORST]


def _highest(nodes: Sequence[Node], most: int) -> list[Node]:
    return sorted(nodes, key=lambda one: -one.value)[:most]


def _most_hopeful(hopes: Sequence[Hope], most: int) -> list[tuple[Hypothesis, Node]]:
    """Keep the ``most`` best sets, each with its most probable start, the best first."""
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
    """Prepare the search for causes among these effects, with the landmarks; fit nothing.

    ``position_noise_mm``: SD of a coordinate of a measured landmark; with it, positions are data, as angles are.
    Without it, or where the angles were computed from these landmarks, the landmarks determine the sizes of bones.
    """
    fitted = Model.of(model, shoulders.subjects, tuple(effects))
    girdle = fitted.sets.girdle
    apart = position_noise_mm is None or angles_are_of_landmarks
    sizes, rows = measured_sizes(shoulders, girdle, effects) if apart else {}, None
    candidates = build_design(effects, shoulders, sizes)
    if position_noise_mm is not None:
        rows = position_rows(model, girdle, candidates, shoulders, position_noise_mm)
        if rows and angles_are_of_landmarks:
            rows = rows.beside_angles_of_them(shoulders.angles, not scapula_is_carried(shoulders.motions))
    joint = JointFit(fitted, shoulders, candidates, everybody(shoulders), rows)
    return Search(joint, folds_of(shoulders), progress, known)
