"""Selection of the named causes: the causes of the most probable set that it needs, over resampled persons."""

from collections.abc import Collection, Mapping
from itertools import chain
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from adapt.diagnosis.fit.candidates import Hypothesis, without
from adapt.diagnosis.fit.discrepancy import Discrepancy
from adapt.diagnosis.fit.positions.position_evidence import given_by_positions
from adapt.diagnosis.inference.alternatives import FRAMES, JOINTS, MOVES, CredibleSet, credible_set
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.inference.weights import probabilities
from models.effects.effect import cause_of

LEAST_PROBABILITY = 0.8
"""Smallest probability of the sets with any cause in a place against the set without one there, averaged over
resampled persons, for which a cause is named."""

LEAST_INCLUSION = 0.05
"""Inclusion probability below which no cause is named."""

REJECTED = 0.9
"""Probability of something common to all persons beside the best causes, from which these causes count as rejected.
Simulated worlds have 0.99 or more with a cause outside the list, and 0.6 or less with listed causes only."""

_MOST_UNEXPLAINED = 0.5
"""Largest share of the smooth variance that rejected causes may leave if some of them are still to stand."""

_WRONG_ANGLES_DEG = 1.0
"""SD of the contradiction between angles and landmarks from which the angles count as wrong. One degree moves the end
of a clavicle of 150 mm by 2.6 mm, as far as joints move."""


class Named(NamedTuple):
    """Named causes."""

    hypothesis: Hypothesis
    """Candidates that are named."""
    chosen: Node
    """Fitted set that the named causes belong to."""
    sets: Mapping[str, CredibleSet] = MappingProxyType({})
    """Credible set of names for each cause."""
    seen: frozenset[str] = frozenset()
    """Causes that measured positions alone show, without the angles."""


def name_causes(search: Search) -> Named:
    """Name the causes of the most probable set."""
    chosen, places = _chosen(search)
    hypothesis, causes = chosen.hypothesis, search.joint.candidates.causes
    shown = [one for one in hypothesis if by_positions(search, one, hypothesis) >= LEAST_PROBABILITY]
    sets = {name: credible_set(causes[name], _shares(search, places[name])) for name in hypothesis}
    return Named(hypothesis, chosen, sets, frozenset(map(cause_of, shown)))


def _shares(search: Search, place: Mapping[str, Node]) -> dict[str, float]:
    """Compute the probability of each cause in a place, over resampled persons."""
    return dict(zip(place, probabilities([search.resampled(one) for one in place.values()]).tolist(), strict=True))


def by_positions(search: Search, name: str, hypothesis: Hypothesis) -> float:
    """Compute the probability of a cause beside the other causes of a set from measured positions alone, over resampled
    persons; 0 without positions."""
    positions = search.likelihood.positions
    if positions is None:
        return 0.0
    less, more = (
        given_by_positions(positions, search.joint.candidates, one).resampled(search.times)
        for one in (without(hypothesis, name), hypothesis)
    )
    return float(probabilities([less, more + search.log_odds])[1])


def probable(named: Hypothesis, inclusion: Mapping[str, float], causes: Mapping[str, str]) -> Hypothesis:
    """Leave out causes with a small inclusion probability, even if the chosen set needs them."""
    return tuple(name for name in named if inclusion[causes[name]] >= LEAST_INCLUSION)


def standing(
    search: Search, named: Hypothesis, seen: Collection[str], inclusion: Mapping[str, float], contradicted: bool
) -> Hypothesis:
    """Keep the causes that stand when the set is rejected, because all persons have something unexplained in common, or
    angles are ``contradicted`` by the landmarks.

    Causes that are known or were ``seen`` stand. If the best set leaves at most half of the smooth variance, causes
    with a high inclusion probability stand too, with two exceptions. Movements do not, because angles show which
    constraint gives way and not what moves; but where both joints were seen to move, the other movements stand, because
    each is of one constraint alone. Causes that are too large do not, except frames, because they take the place of
    something unexplained, and none whose size may be 0. Where angles are contradicted, only known causes stand.
    """
    known = set(map(cause_of, search.known))
    if contradicted:
        return tuple(name for name in named if cause_of(name) in known)
    little = search.unexplained_share <= _MOST_UNEXPLAINED
    sure = {*seen, *known}
    if little:
        sizes = amplitudes(search, named, seen)
        sized = {name: one for name, one in sizes.items() if not one.may_be_0}
        physical = {cause_of(name) for name, one in sized.items() if not one.too_large or name in FRAMES}
        untold = JOINTS if set(JOINTS) <= sure else MOVES
        sure |= {cause for cause in physical.difference(untold) if inclusion[cause] >= REJECTED}
    return tuple(name for name in named if cause_of(name) in sure)


def contradiction_deg(search: Search) -> float:
    """Return the SD by which angles and landmarks contradict each other along motions as no cause explains, in each
    shoulder or in all alike; 0 if it is small, or probably none.
    """
    beside = [(one, f"{left}_turn_deg") for left in ("own", "common") for one in search.left_by(left)[:1]]
    return max((getattr(one, name) for one, name in beside if _contradict(search, one, name)), default=0.0)


def _contradict(search: Search, discrepancy: Discrepancy, name: str) -> bool:
    """Check whether a contradiction is large and probable beside the best set."""
    if getattr(discrepancy, name) < _WRONG_ANGLES_DEG:
        return False
    log_odds = search.log_evidence(discrepancy) - search.log_evidence(discrepancy._replace(**{name: 0.0}))
    return log_odds >= np.log(REJECTED / (1.0 - REJECTED))


def nothing_named(search: Search) -> Named:
    """Return the set of known causes without naming any."""
    return Named((), search.nodes[search.known])


def _chosen(search: Search) -> tuple[Node, dict[str, dict[str, Node]]]:
    """Find the most probable set without the causes it does not need, and the alternatives in place of each cause."""
    while True:
        best = node = search.best
        while (better := _better(search, node, places := _places(search, node))) is not node:
            node = better
        if search.best is best:
            causes = search.joint.candidates.causes
            return node, places | {name: {causes[name]: node} for name in search.known}


def _better(search: Search, node: Node, places: Mapping[str, dict[str, Node]]) -> Node:
    """Return the set without a cause it does not need. Without such a cause, return the best of the set and its
    alternatives: where a cause was left out, another may now do better in the place of one that stays."""
    if weak := _weakest(search, node, places):
        return search.without(node, weak)
    return max([node, *chain(*(one.values() for one in places.values()))], key=lambda one: one.value)


def _places(search: Search, node: Node) -> dict[str, dict[str, Node]]:
    """Find the alternatives in place of each cause that is not known to be active."""
    return {name: search.in_place_of(node, name) for name in node.hypothesis if name not in search.known}


def _weakest(search: Search, node: Node, places: Mapping[str, dict[str, Node]]) -> str | None:
    """Find the cause that a set needs least, if its probability is below ``LEAST_PROBABILITY``."""
    needed: dict[str, float] = {}
    for name, place in places.items():
        sets = search.without(node, name), *place.values()
        needed[name] = 1.0 - probabilities([search.resampled(one) for one in sets])[0]
    weakest = min(needed, key=needed.__getitem__, default=None)
    return weakest if weakest and needed[weakest] < LEAST_PROBABILITY else None
