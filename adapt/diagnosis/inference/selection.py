"""Which causes are named: those that are needed of the set that carries over, as long as each predicts unseen motions
and persons."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis, without
from adapt.diagnosis.inference.alternatives import LEVEL, CredibleSet, credible_set
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.inference.weights import probabilities
from adapt.tables.folds import MOTION, PERSON
from models.effects.effect import cause_of

LEAST_PROBABILITY = 0.8
"""Of sets with a cause in a place, whichever, against the set with none there, averaged over persons drawn anew."""


class Gain(NamedTuple):
    """What one cause adds to the prediction of unseen postures."""

    share: float
    """Of the gap without it, beyond what noise leaves."""
    motions_deg: float
    """Mean difference of unseen motions of persons who were seen."""

    @property
    def enough(self) -> bool:
        """Whether the cause may be named: unseen postures are predicted better, and unseen motions among them."""
        return self.share > 0.0 and self.motions_deg > 0.0


def gain(search: Search, less: Hypothesis, hypothesis: Hypothesis, floor_deg: float) -> Gain:
    """Compare the unseen gaps of two hypotheses, part by part; noise alone leaves ``floor_deg``."""
    folds, before = search.folds, search.unseen_gaps_deg(less)
    difference = known_mean(before - search.unseen_gaps_deg(hypothesis))
    by_part = folds.by_part(difference)
    beyond = folds.by_part(known_mean(before)).mean() - floor_deg
    share = by_part.mean() / max(beyond, by_part.mean(), 1e-9)
    return Gain(float(share), float(difference[folds.of_kind(MOTION)].mean()))


class Named(NamedTuple):
    """The causes that are named."""

    hypothesis: Hypothesis
    """Names of the candidates."""
    chosen: Node
    """The set of which they are."""
    sets: Mapping[str, CredibleSet] = MappingProxyType({})
    """The names that each cause may have."""
    seen: frozenset[str] = frozenset()
    """The causes that measured positions show, whatever the angles say."""


def name_causes(search: Search, floor_deg: float) -> Named:
    """Name the causes that predict, of the set that carries over; noise alone leaves a gap of ``floor_deg``."""
    chosen, places = _chosen(search)
    shown = [one for one in chosen.hypothesis if search.shown_by_positions(one, chosen.hypothesis) >= LEAST_PROBABILITY]
    hypothesis = _predicting(search, chosen, shown, floor_deg)
    sets = {name: credible_set(search.joint.candidates.causes[name], places[name]) for name in hypothesis}
    return Named(hypothesis, chosen, sets, frozenset(map(cause_of, shown)))


def nothing_named(search: Search) -> Named:
    """Name no cause."""
    return Named((), search.nodes[search.known])


def _chosen(search: Search) -> tuple[Node, dict[str, dict[str, Node]]]:
    """Find the set that carries over, less what is not needed, and what may stand in the place of each cause."""
    while True:
        best = node = carrying_over(search)
        while weak := _weakest(search, node, places := _places(search, node)):
            node = search.without(node, weak)
        if carrying_over(search).hypothesis == best.hypothesis:
            causes = search.joint.candidates.causes
            return node, places | {name: {causes[name]: node} for name in search.known}


def carrying_over(search: Search) -> Node:
    """Find the most probable set that predicts persons who were not seen, with the sizes of the others as they are, as
    well as any, to a standard error, of those that hold the truth with ``LEVEL`` between them (Breiman et al. 1984,
    Classification and regression trees, 3.4.3); of one person, the most probable."""
    if PERSON not in search.folds.kinds:
        return search.best
    sets = search.usable
    probability = probabilities([node.resampled for node in sets])
    likely = np.argsort(-probability)
    likely = likely[: np.searchsorted(np.cumsum(probability[likely]), LEVEL) + 1]
    hypotheses = [sets[k].hypothesis for k in likely]
    search.predict(hypotheses, own_sizes=False)
    gaps = np.array([known_mean(search.unseen_gaps_deg(one, own_sizes=False)) for one in hypotheses])
    beyond = gaps - gaps[np.argmin(gaps.mean(axis=1))]
    as_good = beyond.mean(axis=1) <= _standard_error(beyond)
    return sets[likely[np.argmax(as_good)]]


def _standard_error(differences: Float[np.ndarray, "*sets folds"]) -> Float[np.ndarray, "*sets"]:
    """Of the mean over the folds; without end of one fold."""
    folds = differences.shape[-1]
    if folds == 1:
        return np.full(differences.shape[:-1], np.inf)
    return differences.std(axis=-1, ddof=1) / np.sqrt(folds)


def _places(search: Search, node: Node) -> dict[str, dict[str, Node]]:
    """What may stand in the place of each cause that is not known to be at work."""
    return {name: search.in_place_of(node, name) for name in node.hypothesis if name not in search.known}


def _weakest(search: Search, node: Node, places: Mapping[str, dict[str, Node]]) -> str | None:
    """Find the place in a set where a cause is least needed, if that is not enough."""
    needed: dict[str, float] = {}
    for name, place in places.items():
        sets = search.without(node, name), *place.values()
        needed[name] = 1.0 - probabilities([one.resampled for one in sets])[0]
    weakest = min(needed, key=needed.__getitem__, default=None)
    return weakest if weakest and needed[weakest] < LEAST_PROBABILITY else None


def _predicting(search: Search, node: Node, shown: Sequence[str], floor_deg: float) -> Hypothesis:
    """Take the cause out of a set that predicts least beside the others, again and again until each predicts enough,
    but for those that are ``shown`` by more than the angles."""
    chosen = node.hypothesis
    while True:
        tested = [name for name in chosen if name not in shown]
        search.predict([chosen, *(without(chosen, name) for name in tested)])
        gains = {name: gain(search, without(chosen, name), chosen, floor_deg) for name in tested}
        short = [name for name in gains if not gains[name].enough]
        if not short:
            return chosen
        chosen = without(chosen, min(short, key=lambda name: gains[name].share))
