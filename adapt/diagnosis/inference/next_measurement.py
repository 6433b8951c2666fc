"""Candidates with the same effect on these data, what the data lack, and measurements that would distinguish the names
of a cause."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import build_design
from adapt.diagnosis.fit.discrepancy import Whitening
from adapt.diagnosis.fit.joint_fit import Linearised
from adapt.diagnosis.fit.positions.position_evidence import position_evidence
from adapt.diagnosis.fit.positions.position_rows import PALPATED_MM, planned_rows
from adapt.diagnosis.fit.positions.shown_noise import shown_noise
from adapt.diagnosis.inference.alternatives import similarity
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.result import POSITIONS_OF, TWICE_AS_MANY, Proposal
from models.person.family import AnyModel
from motions.table import ANGLES

_SAME = 0.95
"""Squared canonical correlation from which two candidates count as having the same effect on the data."""

_TWICE = 2.0


def indistinguishable(at: Linearised) -> list[list[str]]:
    """Group the candidates with the same effect on these data, beyond the adapted parameters."""
    names = [effect.name for effect in at.joint.candidates.effects]
    groups: list[list[str]] = []
    for name in names:
        group = next((one for one in groups if all(similarity(at, name, other) >= _SAME for other in one)), None)
        if group is None:
            groups.append([name])
        else:
            group.append(name)
    return [group for group in groups if len(group) > 1]


_ANOTHER_MOTION = "another kind of motion: a cause is named if it predicts motions that it was not fitted to"
_MORE_PERSONS = "more persons: a cause is named if it predicts persons that it was not fitted to"


def lacking(kinds: int, persons: int) -> tuple[str, ...]:
    """List what the data lack, whatever is active."""
    return (
        *([_ANOTHER_MOTION] if kinds == 1 else []),
        *([_MORE_PERSONS] if persons == 1 else []),
    )


_LANDMARKS = (("SC",), ("SC", "AC"), ("SC", "AC", "TS", "AI"))
"""Landmarks to palpate next, each with the landmarks that carry it."""


def propose(search: Search, model: AnyModel, named: Node, causes: Sequence[tuple[str, ...]]) -> list[Proposal]:
    """Propose measurements that would distinguish the first two names of each cause: more persons, more of the most
    informative motion, or positions of landmarks where positions are no data.

    If one name is right, each shoulder is expected to add half of the whitened squared difference of the two fits to
    the log evidence.
    """
    shoulders, found = search.joint.shoulders, []
    for names in causes:
        if len(names) < 2:
            continue
        other = _with(search, named, names[0], names[1])
        if other is None:
            continue
        evidence = _evidence(search, named, other)
        now, between = float(evidence.sum()), (names[0], names[1])
        apart = named.posterior.y - other.posterior.y
        apart_deg = float(np.sqrt((apart**2).sum(axis=1).mean() / len(ANGLES)))
        found.append(Proposal(TWICE_AS_MANY, between, now, _TWICE * now, apart_deg))
        by_kind = np.bincount(shoulders.motion, evidence, len(shoulders.kinds))
        if len(shoulders.kinds) > 1:
            best = int(by_kind.argmax())
            what = f"{shoulders.kinds[best]} of {TWICE_AS_MANY}"
            found.append(Proposal(what, between, now, now + float(by_kind[best]), apart_deg))
        if search.joint.positions is None:
            for landmarks in _LANDMARKS:
                what = f"{POSITIONS_OF}{' '.join(landmarks)}, to {PALPATED_MM:g} mm"
                then = _with_landmarks(search, model, named, other, landmarks)
                found.append(Proposal(what, between, now, then, apart_deg))
    return sorted(found, key=lambda one: -one.separation_then)


def _evidence(search: Search, one: Node, other: Node) -> Float[np.ndarray, " rows"]:
    """Compute half of the whitened squared difference of two fits at each posture."""
    difference, white, shown = one.posterior.y - other.posterior.y, search.likelihood.whitening, search.likelihood.shown
    if shown:
        every = search.joint.candidates
        a, b = (every.among_all(node.hypothesis, node.posterior.amplitude) for node in (one, other))
        difference = difference + shown.added[..., :-1] @ (a - b)
    return _half_squares(difference, white)


def _half_squares(difference: Float[np.ndarray, "rows 3"], white: Whitening) -> Float[np.ndarray, " rows"]:
    found = np.zeros(len(difference))
    for rows, inverse_root in zip(white.rows, white.inverse_root, strict=True):
        own = difference[rows].T.reshape(-1, len(inverse_root)) @ inverse_root.T
        found[rows] = 0.5 * (own**2).reshape(-1, len(rows)).sum(axis=0)
    return found


def _with_landmarks(search: Search, model: AnyModel, one: Node, other: Node, landmarks: Sequence[str]) -> float:
    """Compute half of the whitened squared differences of two fits in positions, with the constants of each person
    free, and in y, with the noise that the positions show."""
    shoulders, every = search.joint.shoulders, search.joint.candidates
    names = every.ordered((*one.hypothesis, *other.hypothesis))
    candidates = build_design([every.effect(name) for name in names], shoulders)
    difference = np.zeros(len(candidates.scale))
    for node, sign in ((one, 1.0), (other, -1.0)):
        difference[candidates.where(node.hypothesis)] += sign * node.posterior.amplitude
    rows = planned_rows(model, search.joint.model.sets.girdle, candidates, shoulders, landmarks)
    evidence = position_evidence(rows, shoulders, search.discrepancy)
    known = evidence.of_amplitudes(candidates.mean, candidates.scale)[:-1, :-1]
    shown = shown_noise(replace(rows, noise_in_y=search.noise_in_y), shoulders, search.discrepancy)
    assert shown is not None
    y = one.posterior.y - other.posterior.y + shown.added[..., :-1] @ difference
    of_y = _half_squares(y, search.likelihood.whitening.without(shown.known)).sum()
    return float(of_y + 0.5 * difference @ known @ difference)


def _with(search: Search, named: Node, own: str, other: str) -> Node | None:
    """Find the best fitted set that has the cause ``other`` in place of ``own``."""
    cause = search.joint.candidates.causes
    wanted = {cause[name] for name in named.hypothesis} - {own} | {other}
    nodes = [node for node in search.usable if {cause[name] for name in node.hypothesis} == wanted]
    return max(nodes, key=lambda node: node.value, default=None)
