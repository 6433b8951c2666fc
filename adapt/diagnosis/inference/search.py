"""The search over sets of causes: a beam of exact fits, each widened by what the linear prediction says of one more.

    V(H) = -N/2 log(mean_f q_f) + |H| log(expected / candidates) - 1/2 sum ((a - mean) / scale)^2

q_f is the mean |y|^2 of fold f, unseen; what shoulders have in common counts less. N = folds x the independent numbers
that a motion of a shoulder tells. ``inference.correlation`` finds both; at first all is independent but the postures of
a motion.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.joint_fit import Fitted, JointFit
from adapt.diagnosis.fit.prediction import Linearised, Predicted, linearise
from adapt.diagnosis.fit.unseen_folds import Folds
from adapt.diagnosis.inference.correlation import Independence, independence_of

EXPECTED_CAUSES = 2.0
"""Of all candidates, before any data."""

_ENOUGH = 0.02
"""Decrease of E + prior at which a fit of the search ends."""

_WIDTHS = ((1, 10, 10), (4, 4, 10), (3, 4, 8), (2, 4, 5), (1, 3, 3))
"""At each number of causes: sets to widen, candidates to add to each, and sets to fit exactly."""

_HOPELESS = 3.0
"""A level that is worse than the best by this much in V ends the search: an odds of 20."""

_PASSES = 2

_TRIED = 4
"""So many other causes are fitted exactly in the place of one."""

_WORST = -1e9


class Node(NamedTuple):
    """One hypothesis, fitted."""

    hypothesis: Hypothesis
    fitted: Fitted
    linearised: Linearised
    predicted: Predicted
    value: float
    """V, by ``Search.independence``."""


@dataclass
class Search:
    """All hypotheses that were fitted, by name."""

    joint: JointFit
    folds: Folds
    progress: Callable[[str], None] = lambda _: None
    nodes: dict[Hypothesis, Node] = field(default_factory=dict)
    predictions: dict[tuple[Hypothesis, Hypothesis], Predicted] = field(default_factory=dict)
    refits: dict[Hypothesis, Predicted] = field(default_factory=dict)
    """By exact fits without each fold, of the few sets of which they were made (``inference.budget``)."""
    independence: Independence = field(default_factory=Independence)
    """How much the unseen postures tell."""

    @cached_property
    def log_odds(self) -> float:
        """Of one more cause, before any data."""
        causes = set(self.joint.candidates.causes.values())
        return float(np.log(min(0.5, EXPECTED_CAUSES / max(1, len(causes)))))

    def q(self, predicted: Predicted) -> Float[np.ndarray, " folds"]:
        """Average |y|^2 of each fold, with the weight of what shoulders have in common."""
        return self.folds.by_fold(predicted.squares @ np.array([1.0, self.independence.common_weight]))

    def log_likelihood(
        self, q: Float[np.ndarray, "*sets folds"], weights: Float[np.ndarray, " folds"]
    ) -> Float[np.ndarray, " *sets"]:
        """Compute -N/2 log(mean q) of mean squares by fold; each fold counts as often as its weight says."""
        return -0.5 * self.independence.numbers * weights.sum() * np.log(q @ weights / weights.sum())

    def log_prior(self, hypothesis: Hypothesis, amplitude) -> float:
        """Compute the log prior of a hypothesis with its amplitudes."""
        return len(hypothesis) * self.log_odds + self.joint.candidates.log_prior(hypothesis, amplitude)

    def fit(self, names: Sequence[str], start: Node | None) -> Node:
        """Fit a hypothesis exactly, from the fit of another one; without one, no cause."""
        hypothesis = self.joint.candidates.ordered(names)
        if hypothesis in self.nodes:
            return self.nodes[hypothesis]
        if start is None:
            return self._add(hypothesis, self.joint.from_starts())
        return self.fit_all([(hypothesis, start)])[0]

    def fit_all(self, starts: Sequence[tuple[Hypothesis, Node]]) -> list[Node]:
        """Fit hypotheses side by side, each from the fit of another one."""
        missing = {hypothesis: start for hypothesis, start in starts if hypothesis not in self.nodes}
        if missing:
            thetas = [start.fitted.theta_mm for start in missing.values()]
            amplitudes = [self._amplitude_at(start, hypothesis) for hypothesis, start in missing.items()]
            found = self.joint.fit_side_by_side(list(missing), thetas, amplitudes, _ENOUGH)
            for hypothesis, fitted in zip(missing, found, strict=True):
                self._add(hypothesis, fitted)
        return [self.nodes[hypothesis] for hypothesis, _ in starts]

    def _amplitude_at(self, start: Node, hypothesis: Hypothesis) -> Float[np.ndarray, " own"]:
        """Where the amplitudes of a hypothesis begin: as in the fit, else where they are believed to be."""
        candidates = self.joint.candidates
        a = candidates.mean.copy()
        a[candidates.where(start.hypothesis)] = start.fitted.amplitude[0]
        return a[candidates.where(hypothesis)]

    def _add(self, hypothesis: Hypothesis, fitted: Fitted) -> Node:
        linearised = linearise(self.joint, self.folds, hypothesis, fitted)
        predicted = linearised.predict(hypothesis)
        value = self._value(hypothesis, fitted.amplitude[0], predicted)
        node = Node(hypothesis, fitted, linearised, predicted, value)
        self.nodes[hypothesis] = node
        self.progress(f"{len(self.nodes)} sets of causes")
        return node

    def _value(self, hypothesis: Hypothesis, amplitude, predicted: Predicted) -> float:
        if not self.joint.candidates.has_the_sign(hypothesis, amplitude):
            return _WORST
        q = self.q(predicted)
        return float(self.log_likelihood(q, np.ones(len(q)))) + self.log_prior(hypothesis, amplitude)

    def widened(self, node: Node) -> list[tuple[float, Hypothesis, Node]]:
        """Predict every set with one more cause, the best first."""
        candidates = self.joint.candidates
        causes = {candidates.causes[name] for name in node.hypothesis}
        found = []
        for effect in candidates.effects:
            if effect.cause in causes:
                continue
            hypothesis = candidates.ordered((*node.hypothesis, effect.name))
            if hypothesis in self.nodes:
                found.append((self.nodes[hypothesis].value, hypothesis, node))
            else:
                predicted = self.predicted(node, hypothesis)
                value = self._value(hypothesis, predicted.amplitude[0], predicted)
                found.append((value, hypothesis, node))
        return sorted(found, key=lambda one: -one[0])

    def predicted(self, node: Node, hypothesis: Hypothesis) -> Predicted:
        """Predict a larger set from a fit, once."""
        key = node.hypothesis, hypothesis
        if key not in self.predictions:
            self.predictions[key] = node.linearised.predict(hypothesis)
        return self.predictions[key]

    def beam(self, first: Sequence[str] = ()) -> None:
        """Search upwards from no cause, or from one that no straight line leads to."""
        none = self.fit((), None)
        level = [self.fit(first, none)] if first else [none]
        best = level[0].value
        for sets, each, exact in _WIDTHS:
            hopeful: dict[Hypothesis, tuple[float, Hypothesis, Node]] = {}
            for node in sorted(level, key=lambda node: -node.value)[:sets]:
                for one in self.widened(node)[:each]:
                    if one[1] not in hopeful or hopeful[one[1]][0] < one[0]:
                        hopeful[one[1]] = one
            chosen = sorted(hopeful.values(), key=lambda one: -one[0])[: exact // 2 if first else exact]
            level = self.fit_all([(hypothesis, node) for value, hypothesis, node in chosen if value > _WORST])
            if not level:
                return
            highest = max(node.value for node in level)
            if highest < best - _HOPELESS:
                return
            best = max(best, highest)

    def run(self) -> "Search":
        """Search from no cause, and from each effect whose size has been measured; again with the number of independent
        numbers that the best set leaves."""
        for _ in range(_PASSES):
            self.beam()
            for effect in self.joint.candidates.effects:
                if effect.prior.mean:
                    self.beam((effect.name,))
            best = max(self.usable, key=lambda node: node.value)
            self._count(independence_of(self.joint.shoulders, best.linearised.y))
        return self

    def _count(self, independence: Independence) -> None:
        """Value every set anew."""
        self.independence = independence
        for hypothesis, node in self.nodes.items():
            value = self._value(hypothesis, node.fitted.amplitude[0], node.predicted)
            self.nodes[hypothesis] = node._replace(value=value)

    def in_place_of(self, node: Node, own: str, set_aside: Collection[Hypothesis] = ()) -> dict[str, Node]:
        """Fit the most hopeful sets with another cause in the place of one; the best of each cause, its own among
        them, but for those ``set_aside``."""
        less = self.without(node, own)
        self.fit_all([(hypothesis, start) for _, hypothesis, start in self.widened(less)[:_TRIED]])
        others = set(less.hypothesis)
        found: dict[str, Node] = {}
        for one in sorted(self.usable, key=lambda one: one.value):
            fits = len(one.hypothesis) == len(node.hypothesis) and others < set(one.hypothesis)
            if fits and one.hypothesis not in set_aside:
                (name,) = set(one.hypothesis) - others
                found[self.joint.candidates.causes[name]] = one
        return found

    def without(self, node: Node, name: str) -> Node:
        """Fit a set with one cause less, from the largest set within it."""
        wanted = set(node.hypothesis) - {name}
        within = (one for one in self.nodes.values() if set(one.hypothesis) <= wanted)
        return self.fit(tuple(wanted), max(within, key=lambda one: (len(one.hypothesis), one.value)))

    @property
    def usable(self) -> list[Node]:
        """All fitted hypotheses whose effects act the right way."""
        return [node for node in self.nodes.values() if node.value > _WORST]
