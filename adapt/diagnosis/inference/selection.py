"""Which causes are named: those of the most probable set that are needed, over persons drawn anew."""

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import NamedTuple

from adapt.diagnosis.fit.candidates import Hypothesis, without
from adapt.diagnosis.fit.positions.position_evidence import given_by_positions
from adapt.diagnosis.inference.alternatives import FRAMES, JOINTS, MOVES, CredibleSet, credible_set
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.inference.weights import probabilities
from models.effects.effect import cause_of

LEAST_PROBABILITY = 0.8
"""Of sets with a cause in a place, whichever, against the set with none there, averaged over persons drawn anew."""

LEAST_INCLUSION = 0.05
"""Probability over all sets, below which no cause is named."""

REJECTED = 0.9
"""Probability that all persons do something alike beside the best causes, from which these explain not all: simulated
worlds with a cause outside the list have 0.99 or more, with those of the list 0.6 or less."""

_MOST_LEFT_OVER = 0.5
"""Share of what is smooth that they leave, from which they explain nothing then."""

_WRONG_ANGLES_DEG = 1.0
"""Of what all have in common of how angles contradict landmarks: it takes the end of a clavicle of 150 mm by 2.6 mm, as
far as joints move."""


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


def name_causes(search: Search) -> Named:
    """Name the causes of the most probable set."""
    chosen, places = _chosen(search)
    hypothesis, causes = chosen.hypothesis, search.joint.candidates.causes
    shown = [one for one in hypothesis if by_positions(search, one, hypothesis) >= LEAST_PROBABILITY]
    sets = {name: credible_set(causes[name], places[name]) for name in hypothesis}
    return Named(hypothesis, chosen, sets, frozenset(map(cause_of, shown)))


def by_positions(search: Search, name: str, hypothesis: Hypothesis) -> float:
    """Compute how probable a cause is beside the others of a set by measured positions alone, whatever the angles say,
    over persons drawn anew; 0 without positions."""
    positions = search.likelihood.positions
    if positions is None:
        return 0.0
    less, more = (
        given_by_positions(positions, search.joint.candidates, one).resampled(search.times)
        for one in (without(hypothesis, name), hypothesis)
    )
    return float(probabilities([less, more + search.log_odds])[1])


def probable(named: Hypothesis, inclusion: Mapping[str, float], causes: Mapping[str, str]) -> Hypothesis:
    """Leave out causes that are hardly active in any probable set, however much the chosen one needs them."""
    return tuple(name for name in named if inclusion[causes[name]] >= LEAST_INCLUSION)


def standing(search: Search, named: Hypothesis, seen: Collection[str], inclusion: Mapping[str, float]) -> Hypothesis:
    """Keep what stands though all persons do something alike that no cause explains: what is known and what was
    ``seen``; and, where the best set leaves less than half, what is probably active whatever else is. That is no
    movement, of which angles tell which constraint gives way and not what moves, unless both joints were seen to move:
    what gives way beside them is of one constraint alone. Nor is it, but for a frame, what is larger than such an
    effect is: it takes the place of what is not explained. Where angles contradict the landmarks, only what is
    known."""
    known = set(map(cause_of, search.known))
    if angles_contradict_landmarks(search):
        return tuple(name for name in named if cause_of(name) in known)
    little = search.left_over_share <= _MOST_LEFT_OVER
    sure = {*seen, *known}
    if little:
        sizes = amplitudes(search, named, seen)
        physical = {cause_of(name) for name, one in sizes.items() if not one.too_large or name in FRAMES}
        untold = JOINTS if set(JOINTS) <= sure else MOVES
        sure |= {cause for cause in physical.difference(untold) if inclusion[cause] >= REJECTED}
    return tuple(name for name in named if cause_of(name) in sure)


def angles_contradict_landmarks(search: Search) -> bool:
    """Tell whether angles and landmarks of all persons contradict each other along a motion as no cause explains."""
    return search.shared_turn_deg >= _WRONG_ANGLES_DEG


def nothing_named(search: Search) -> Named:
    """Name no cause."""
    return Named((), search.nodes[search.known])


def _chosen(search: Search) -> tuple[Node, dict[str, dict[str, Node]]]:
    """Find the most probable set, less what is not needed, and what may stand in the place of each cause."""
    while True:
        best = node = search.best
        while weak := _weakest(search, node, places := _places(search, node)):
            node = search.without(node, weak)
        if search.best is best:
            causes = search.joint.candidates.causes
            return node, places | {name: {causes[name]: node} for name in search.known}


def _places(search: Search, node: Node) -> dict[str, dict[str, Node]]:
    """What may stand in the place of each cause that is not known to be active."""
    return {name: search.in_place_of(node, name) for name in node.hypothesis if name not in search.known}


def _weakest(search: Search, node: Node, places: Mapping[str, dict[str, Node]]) -> str | None:
    """Find the place in a set where a cause is least needed, if that is not enough."""
    needed: dict[str, float] = {}
    for name, place in places.items():
        sets = search.without(node, name), *place.values()
        needed[name] = 1.0 - probabilities([one.resampled for one in sets])[0]
    weakest = min(needed, key=needed.__getitem__, default=None)
    return weakest if weakest and needed[weakest] < LEAST_PROBABILITY else None
