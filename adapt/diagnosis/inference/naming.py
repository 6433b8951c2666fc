"""Which causes are named: those that are probable, and without which unseen motions and persons are predicted worse."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.alternatives import Alternative, CredibleSet, credible_set, in_place_of
from adapt.diagnosis.inference.budget import Rung, ladder, refitted, without_the_weakest
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.inference.weights import probabilities

LEAST_GAIN = 0.05
"""Share of the unseen gap beyond noise that a named cause takes away: less is no answer to anybody."""

LEAST_PROBABILITY = 0.9
"""That a cause is at work beside the others of its set, over the bootstrap of persons and motions."""


class Gain(NamedTuple):
    """What one cause adds to the prediction of unseen postures."""

    share: float
    """Of the gap without it, beyond what noise leaves."""
    t: float
    """Of the paired differences of the folds, in their standard errors."""
    worst_deg: float
    """The smaller of the mean differences of motions, and of persons and motions."""
    probability: float
    """That the cause is at work, of the set with it and the set without it."""

    @property
    def enough(self) -> bool:
        """Whether the cause may be named."""
        return self.share >= LEAST_GAIN and self.probability >= LEAST_PROBABILITY and self.worst_deg > 0.0


def gain(search: Search, less: Node, node: Node, floor_deg: float) -> Gain:
    """Compare the unseen gaps of two hypotheses, fold by fold; noise alone leaves ``floor_deg``."""
    folds, without = search.folds, less.predicted.gaps_deg
    difference = known_mean(without - node.predicted.gaps_deg)
    by_fold = folds.by_fold(difference)
    error = by_fold.std(ddof=1) / np.sqrt(len(by_fold)) if len(by_fold) > 1 else np.inf
    worst = min(difference[folds.of_kind(kind)].mean() for kind in folds.kinds)
    beyond = folds.by_fold(known_mean(without)).mean() - floor_deg
    share = by_fold.mean() / max(beyond, by_fold.mean(), 1e-9)
    t = float(by_fold.mean() / error) if error > 0 else np.inf
    return Gain(float(share), t, float(worst), float(probabilities(search, [less, node])[1]))


class Named(NamedTuple):
    """The causes that are named, with what each of them adds to the others."""

    node: Node
    gains: dict[str, Gain]
    rungs: list[Rung]
    """Of the gap budget."""
    sets: Mapping[str, CredibleSet] = MappingProxyType({})
    """The names that each cause may have."""

    @property
    def hypothesis(self) -> Hypothesis:
        """Names of the candidates."""
        return self.node.hypothesis


def name_causes(search: Search, floor_deg: float) -> Named:
    """Name the most probable set of causes of which each predicts; noise alone leaves a gap of ``floor_deg``.

    Of a set that is looked at subsets are fitted too; of one that passes, what could stand in the place of each cause;
    last its gap budget by exact refits, which must fall to its end.
    """
    rejected: set[Hypothesis] = set()
    while len(rejected) < _MOST_LOOKED_AT:
        node = max((one for one in search.usable if one.hypothesis not in rejected), key=lambda one: one.value)
        if not node.hypothesis:
            break
        gains = _gains(search, node, floor_deg)
        if gains:
            others = [one for name in node.hypothesis for one in search.in_place_of(node, name).values()]
            if any(one.value > node.value and one.hypothesis not in rejected for one in others):
                continue
            if named := _with_budget(search, node, gains):
                return settle(search, named, floor_deg)
        rejected.add(node.hypothesis)
    return nothing_named(search)


def _with_budget(search: Search, node: Node, gains: dict[str, Gain]) -> Named | None:
    """Give what a set names, if each of its causes predicts and its budget falls."""
    return Named(node, gains, ladder(search, node)) if gains and _falls(search, node) else None


def nothing_named(search: Search) -> Named:
    """Name no cause."""
    none = search.nodes[()]
    return Named(none, {}, ladder(search, none))


def settle(search: Search, named: Named, floor_deg: float) -> Named:
    """Put in the place of each cause the one that exact fits find most probable there; a set of which a cause does not
    predict, or with which the budget does not fall, is set aside."""
    tried, set_aside = {named.hypothesis}, set[Hypothesis]()
    while True:
        places = {name: in_place_of(search, named.node, name, set_aside) for name in named.hypothesis}
        better = next((one for one in map(_best, places.values()) if one.hypothesis != named.hypothesis), None)
        if better is None:
            return named._replace(sets={name: credible_set(found) for name, found in places.items()})
        new = better.hypothesis not in tried
        if new and (found := _with_budget(search, better, _gains(search, better, floor_deg))):
            named = found
            tried.add(better.hypothesis)
        else:
            set_aside.add(better.hypothesis)


def _best(alternatives: dict[str, Alternative]) -> Node:
    return max(alternatives.values(), key=lambda one: one.share).node


def _falls(search: Search, node: Node) -> bool:
    """Whether the last cause of the budget lowers the gap of unseen motions, and of unseen persons, where it is fitted
    exactly."""
    _, less = without_the_weakest(search, node)
    before, after = (refitted(search, one).predicted.gaps_deg for one in (less, node))
    difference = known_mean(before - after)
    return all(difference[search.folds.of_kind(kind)].mean() > 0.0 for kind in search.folds.kinds)


_MOST_LOOKED_AT = 60
"""Sets, the most probable first; of measured motions the first ten have one that holds."""


def _gains(search: Search, node: Node, floor_deg: float) -> dict[str, Gain]:
    """Give what each cause of a set adds to the others; nothing if one of them is not enough."""
    causes = node.hypothesis
    fitted = {name: tuple(one for one in causes if one != name) in search.nodes for name in causes}
    found = {}
    for name in sorted(causes, key=lambda name: not fitted[name]):  # one that is not enough saves the other fits
        found[name] = gain(search, search.without(node, name), node, floor_deg)
        if not found[name].enough:
            return {}
    return {name: found[name] for name in causes}
