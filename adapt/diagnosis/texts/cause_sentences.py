"""Sentences about a named cause: its action, size and evidence, and what to measure next."""

import math
from collections.abc import Mapping

import numpy as np

from adapt.diagnosis.result import ADAPTED_STEP, POSITIONS, Cause, CauseAmplitude, Diagnosis, Proposal
from adapt.diagnosis.texts.wording import (
    amplitude_text,
    cause_names,
    gap_text,
    held_out_kind_text,
    listed,
    number,
    percent_text,
    with_unit,
)
from models.effects import EFFECTS
from models.effects.amplitudes import PersonalSize
from models.effects.basis import FULL_ELEVATION_DEG, OverElevation
from models.effects.effect import cause_of

_MOST = 0.5
"""Smallest share of the sum of squares at which a cause acts mostly in one direction."""

_STEPS = 51
"""Number of elevations at which the largest strength is sought: every 3 degrees of 150."""

_ONE_WAY = {"along": "away from SC", "TS": "at TS", "AI": "at AI"}
_OTHER_WAY = {
    "along": "toward SC",
    "up": "down",
    "back": "forward",
    "lateral": "medial",
    "outward": "inward",
    "TS": "at TS, toward the thorax",
    "AI": "at AI, toward the thorax",
}
"""Words for a direction where its amplitude is above 0 (``_ONE_WAY``) and below 0 (``_OTHER_WAY``); below 0 a minus
stands before any other direction."""

_AS = {
    "clavicle_y": "the clavicle protracts",
    "clavicle_z": "the clavicle is elevated",
    "clavicle_x": "the clavicle turns backward about its axis",
    "scapula_y": "the scapula protracts",
    "scapula_z": "the scapula rotates laterally",
    "scapula_x": "the scapula tips backward",
}
"""Movement of the bone when the angle grows."""

_TESTED = {
    POSITIONS: "measured positions",
    "other_motion": "held-out motions",
    "other_person": "held-out persons",
    "evidence": "the evidence alone: a constant that all have in common",
    "angles": "the angles themselves, which were computed from each other",
}


def cause_sentence(diagnosis: Diagnosis, cause: Cause) -> str:
    """Describe a cause: its action, size, part of the gap, evidence, and the names that it cannot be told from."""
    one = diagnosis.amplitude[cause.names[0]]
    names, typical = cause_names(cause), with_unit(number(one.typical), one.unit)
    said = [
        f"{_does(one, diagnosis.highest_elevation_deg)} ({names[0]}).",
        f"Size {amplitude_text(one)}{', root mean square over the postures' * bool(one.basis)}; typical is {typical}.",
        _takes(diagnosis, names[0]),
        f"Tested on {listed([_TESTED[kind] for kind in cause.tested_on], 'and')}." if cause.tested_on else "",
        f"These data cannot tell it from {listed(names[1:], 'or')}." if names[1:] else "",
        "It is larger than such an effect is: something acts like it." if one.too_large else "",
    ]
    return " ".join(filter(None, said))


def _does(one: CauseAmplitude, highest_deg: float) -> str:
    effect = EFFECTS.get(one.effect)
    plain = EFFECTS[cause_of(one.effect)].plain_name if cause_of(one.effect) in EFFECTS else ""
    plain = plain or (effect.what if effect else one.what)
    values = {name: size.value for name, size in one.directions.items()}
    peak = _largest(one, highest_deg)
    if peak is not None:
        size, values = peak
        raised = f"while the arm rises to {highest_deg:.0f} degrees"
        return f"{_capital(plain)}: up to {with_unit(number(size), one.unit)}{_mostly(values)}, {raised}"
    how = f", with the {one.basis}" if one.basis and not _mostly(values) else "" if one.basis else ", a constant"
    return f"{_capital(plain)}: {with_unit(number(one.size.value), one.unit)}{how}{_mostly(values)}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _largest(one: CauseAmplitude, highest_deg: float) -> tuple[float, dict[str, float]] | None:
    """Compute the largest strength up to the highest elevation, and its components; None for another basis or unit."""
    effect = EFFECTS.get(one.effect)
    if effect is None or not isinstance(effect.basis, OverElevation) or effect.strength_unit:
        return None
    if not math.isfinite(highest_deg) or one.amplitude is None or isinstance(one.amplitude, str):
        return None
    given = one.amplitude.mean if isinstance(one.amplitude, PersonalSize) else one.amplitude
    by_direction = np.asarray(given, float).reshape(len(effect.directions), -1)
    terms = effect.basis.terms(np.linspace(0.0, min(highest_deg, FULL_ELEVATION_DEG), _STEPS))
    strength = by_direction @ terms[: by_direction.shape[1]]
    best = int(np.linalg.norm(strength, axis=0).argmax())
    components = dict(zip(effect.directions, strength[:, best].tolist(), strict=True))
    return float(np.linalg.norm(strength[:, best])), components


def _mostly(values: Mapping[str, float]) -> str:
    """Name the main direction: ', mostly back as the scapula protracts'; empty if there is none."""
    if len(values) < 2:
        return ""
    name = max(values, key=lambda one: abs(values[one]))
    if values[name] ** 2 < _MOST * sum(value**2 for value in values.values()):
        return ""
    direction, _, angle = name.partition(" by ")
    below = values[name] < 0.0
    direction = _OTHER_WAY.get(direction, f"-({direction})") if below else _ONE_WAY.get(direction, direction)
    return f", mostly {direction}" + (f" as {_AS[angle]}" if angle in _AS else "")


def _takes(diagnosis: Diagnosis, name: str) -> str:
    """Write the change of the gap, degrees, in this cause's step of the gap budget; empty without such a step."""
    for before, step in zip(diagnosis.budget, diagnosis.budget[1:], strict=False):
        if cause_of(step.step) == name and step.step != ADAPTED_STEP and math.isfinite(step.gap_deg.value):
            fall = f"{gap_text(before.gap_deg.value)} to {gap_text(step.gap_deg.value)} deg"
            return f"With it the gap on {held_out_kind_text(diagnosis.gaps)} goes from {fall}."
    return ""


_POSITIONS = "positions of SC and AC in every posture (girdle convert writes them): joints that move show there"


_TOLD_APART = 0.95
"""Probability of telling the right one of two names, from which on more of the same data gain little."""


def measure_next(diagnosis: Diagnosis) -> list[str]:
    """List at most two measurements to make next, the best one first; empty where nothing beyond noise is left."""
    proposals = _distinct(diagnosis)
    found = [*diagnosis.lacking, *(_proposal(one, diagnosis.persons) for one in proposals)]
    asked = not diagnosis.positions.measured_mm and diagnosis.verdict.answer != "none"
    if asked and not any(one.what.startswith("positions") for one in proposals):
        found.append(_POSITIONS)
    return found[:2]


def _distinct(diagnosis: Diagnosis) -> list[Proposal]:
    """Keep the best proposal of each kind: people, motion, landmarks; none for names that are already told apart."""
    kept: dict[str, Proposal] = {}
    for one in diagnosis.next_measurement:
        if one.probabilities[0] < _TOLD_APART:
            kept.setdefault(one.what.split()[0], one)
    return list(kept.values())


def _proposal(one: Proposal, persons: int) -> str:
    what = one.what.replace("twice as many persons", f"{2 * persons} persons in place of {persons}")
    if what.startswith("positions of "):
        what = what.replace("positions of ", "positions of landmarks in every posture, ", 1) + " (girdle convert)"
    now, then = (percent_text(p) for p in one.probabilities)
    apart = f"They are {gap_text(one.apart_deg)} deg apart, and told right in {now} of cases, then in {then}"
    return f"{what}: tells {one.between[0]} from {one.between[1]}. {apart}"
