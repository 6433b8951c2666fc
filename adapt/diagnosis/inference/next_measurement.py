"""Which candidates do the same to these data, what these data lack, and which measurement would tell the names of a
cause apart."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import lay_out
from adapt.diagnosis.fit.discrepancy import Whitening
from adapt.diagnosis.fit.joint_fit import Linearised
from adapt.diagnosis.fit.positions.position_evidence import position_evidence
from adapt.diagnosis.fit.positions.position_rows import PALPATED_MM, planned_rows
from adapt.diagnosis.fit.positions.shown_noise import shown_noise
from adapt.diagnosis.inference.alternatives import similarity
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.result import Proposal
from models.person.family import AnyModel
from motions.table import ANGLES

_SAME = 0.95
"""Canonical correlation squared from which two candidates do the same to the data."""

_TWICE = 2.0


def indistinguishable(at: Linearised) -> list[list[str]]:
    """Group the candidates that do the same to these data, after the adapted parameters."""
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
    """Say what the data lack, whatever is active."""
    return (
        *([_ANOTHER_MOTION] if kinds == 1 else []),
        *([_MORE_PERSONS] if persons == 1 else []),
    )


_LANDMARKS = (("SC",), ("SC", "AC"), ("SC", "AC", "TS", "AI"))
"""What may be palpated next; each beside those that carry it."""


def propose(search: Search, model: AnyModel, named: Node, causes: Sequence[tuple[str, ...]]) -> list[Proposal]:
    """Say what would tell the first two names of each cause apart: more persons, more of the motion that tells most, or
    positions of landmarks where none are data.

    If one name is right, each shoulder is expected to add half of the squared difference of the two fits there to the
    log evidence, in units of what neither explains.
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
        found.append(Proposal("twice as many persons", between, now, _TWICE * now, apart_deg))
        by_kind = np.bincount(shoulders.motion, evidence, len(shoulders.kinds))
        if len(shoulders.kinds) > 1:
            best = int(by_kind.argmax())
            what = f"{shoulders.kinds[best]} of twice as many persons"
            found.append(Proposal(what, between, now, now + float(by_kind[best]), apart_deg))
        if search.joint.positions is None:
            for landmarks in _LANDMARKS:
                what = f"positions of {' '.join(landmarks)}, to {PALPATED_MM:g} mm"
                then = _with_landmarks(search, model, named, other, landmarks)
                found.append(Proposal(what, between, now, then, apart_deg))
    return sorted(found, key=lambda one: -one.separation_then)


def _evidence(search: Search, one: Node, other: Node) -> Float[np.ndarray, " rows"]:
    """Half of the squared difference of two fits at each posture, whitened."""
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
    """Half of the squared difference of what two fits say of positions, the constants of each person left open, and of
    y with the noise that these show."""
    shoulders, every = search.joint.shoulders, search.joint.candidates
    names = every.ordered((*one.hypothesis, *other.hypothesis))
    candidates = lay_out([every.effect(name) for name in names], shoulders)
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
    """The best fitted set that has the other cause in the place of its own."""
    cause = search.joint.candidates.causes
    wanted = {cause[name] for name in named.hypothesis} - {own} | {other}
    nodes = [node for node in search.usable if {cause[name] for name in node.hypothesis} == wanted]
    return max(nodes, key=lambda node: node.value, default=None)
