"""Sentences about a named cause: its action, size and evidence."""

import math
from collections.abc import Mapping

from adapt.diagnosis.result import ADAPTED_STEP, ELEVATION, POSITIONS, Cause, CauseAmplitude, Diagnosis
from adapt.diagnosis.texts.wording import (
    amplitude_text,
    cause_names,
    change_text,
    gap_text,
    held_out_kind_text,
    listed,
    number,
    with_unit,
)
from models.effects import EFFECTS
from models.effects.by_posture import SUFFIX
from models.effects.effect import cause_of

_WORDS = {
    "along": ("away from SC", "toward SC"),
    "up": ("up", "down"),
    "back": ("backward", "forward"),
    "lateral": ("lateral", "medial"),
    "outward": ("outward", "inward"),
    "length": ("longer", "shorter"),
    "TS": ("outward at TS", "inward at TS"),
    "AI": ("outward at AI", "inward at AI"),
}
"""Words for a direction where its amplitude is above 0, and below 0; any other direction has a minus below 0."""

_AS = {
    ELEVATION: "the arm rises",
    "clavicle_y": "the clavicle protracts",
    "clavicle_z": "the clavicle is elevated",
    "clavicle_x": "the clavicle turns backward about its axis",
    "scapula_y": "the scapula protracts",
    "scapula_z": "the scapula rotates laterally",
    "scapula_x": "the scapula tips backward",
}
"""Movement of the arm or bone when the quantity grows."""

_TESTED = {
    POSITIONS: "measured positions",
    "other_motion": "held-out motions",
    "other_person": "held-out persons",
    "evidence": "the evidence alone: all persons have it in common",
    "angles": "the angles themselves, which were computed from each other",
}


def cause_sentence(diagnosis: Diagnosis, cause: Cause) -> str:
    """Describe a cause: its action, size, part of the gap, evidence, and the names that it cannot be told from."""
    one, names = diagnosis.amplitude[cause.names[0]], cause_names(cause)
    said = [
        f"{_does(one, names[0])}; typical {with_unit(number(one.typical), one.unit)}.",
        _takes(diagnosis, names[0]),
        f"Tested on {tested_text(cause)}." if cause.tested_on else "",
        f"These data cannot tell it from {listed(names[1:], 'or')}." if names[1:] else "",
        "It is larger than such an effect is: something acts like it." if one.too_large else "",
    ]
    return " ".join(filter(None, said))


def tested_text(cause: Cause) -> str:
    """Name the data that confirm a cause: 'held-out motions and held-out persons'."""
    return listed([_TESTED[kind] for kind in cause.tested_on], "and")


def coefficient_unit(one: CauseAmplitude) -> str:
    """Return the unit of the amplitudes of a cause: 'mm per 30 deg' over the posture of the bones."""
    return EFFECTS[one.effect].unit if one.effect in EFFECTS else one.unit


def described(diagnosis: Diagnosis, name: str) -> str:
    """Describe a candidate in one line: with the basis that was found if it is named, else with every basis that it may
    have; empty for one from outside the library."""
    if name in diagnosis.amplitude:
        return diagnosis.amplitude[name].what
    what = EFFECTS[name].what if name in EFFECTS else ""
    other = EFFECTS.get(name + SUFFIX)
    return what if other is None else what.replace("with elevation", "with elevation or posture")


def _does(one: CauseAmplitude, name: str) -> str:
    """Write name, size and extent: 'AC joint moves (ac_translation): 2.1 [1.6, 2.5] mm over the postures, up to 3.0
    mm, mostly backward as the scapula protracts'."""
    effect = EFFECTS.get(cause_of(one.effect))
    plain = (effect.plain_name or effect.what) if effect else one.what
    start = f"{plain[:1].upper()}{plain[1:]} ({name})"
    if not math.isfinite(one.size.value):
        return f"{start}: no gap shows its size"
    size = f"{start}: {amplitude_text(one)} {'over the postures' if one.basis else 'in every posture'}"
    if one.extent is None:
        return f"{size}, with {one.basis.split()[0]}" if one.basis else size
    largest = f", up to {with_unit(number(one.extent.largest), one.unit)}" if one.basis else ""
    mostly = _mostly(one.extent.directions, several=len(one.directions) > 1)
    if not one.basis:
        return size + (f", {mostly}" if mostly else "")
    follows = f"as {_AS[one.extent.follows]}" if one.extent.follows in _AS else f"with {one.basis.split()[0]}"
    return f"{size}{largest}, {mostly} {follows}" if mostly else f"{size}{largest}, {follows}"


def _mostly(directions: Mapping[str, float], *, several: bool) -> str:
    """Name the main directions: 'mostly down and backward'; empty if there is none."""
    words = []
    for name, share in directions.items():
        above, below = _WORDS.get(name, (name, f"-({name})"))
        if name.startswith("about "):
            above, below = (word if not words else word.removeprefix("about ") for word in (name, f"about -{name[6:]}"))
        words.append(below if share < 0.0 else above)
    if not several:  # one direction has all; said only in words of its own
        return words[0] if words and set(directions) <= set(_WORDS) else ""
    return f"mostly {listed(words, 'and')}" if words else ""


def _takes(diagnosis: Diagnosis, name: str) -> str:
    """Write the change of the gap, degrees, in this cause's step of the gap budget; empty without such a step."""
    for before, step in zip(diagnosis.budget, diagnosis.budget[1:], strict=False):
        if cause_of(step.step) == name and step.step != ADAPTED_STEP and math.isfinite(step.gap_deg.value):
            change = change_text(gap_text(before.gap_deg.value), gap_text(step.gap_deg.value))
            return f"With it the gap on {held_out_kind_text(diagnosis.gaps)} {change}."
    return ""
