"""A diagnosis in words: the verdict in one sentence of plain English, and how its numbers are written."""

import math
from collections.abc import Callable, Collection, Iterator, Sequence

from adapt.diagnosis.result import (
    ADAPTED_STEP,
    ALL,
    BASE,
    EFFECT,
    NOISE,
    NONE,
    OWN_BONES,
    Cause,
    CauseAmplitude,
    Diagnosis,
    GapKind,
    Gaps,
    Interval,
    Verdict,
)
from models.effects.effect import cause_of

MOST_WORDS = 30
"""Of the sentence."""

_FINE = 1.0
"""Numbers below it are written with two digits after the point, others with one."""

_LEAST_PROBABILITY = 0.005
"""Less than it would be written as 0.00, which says that there is none."""

OWN = "own bones"
"""What every person has, before any cause."""

_MOST_NAMES = 3
"""Causes that are named where not all of them have room."""


def sentence(diagnosis: Diagnosis) -> str:
    """Say the verdict as a biomechanist reads it first, in at most MOST_WORDS words."""
    if diagnosis.verdict.answer != EFFECT:
        return _without_cause(diagnosis)
    before, with_effect, floor = _levels(diagnosis, "own_bones", "with_effect")
    levels = diagnosis.gaps.hardest
    verb = "shrinks" if levels["with_effect"][ALL].value < levels["own_bones"][ALL].value else "goes"
    gap = f"the gap of {subjects_text(diagnosis)} on {held_out_kind_text(diagnosis.gaps)}"
    start, end = f"Beyond {OWN} {gap} {verb} from {before} to {with_effect} deg with", f"noise alone leaves {floor}."
    too_large = {name for name, one in diagnosis.amplitude.items() if one.too_large}
    *_, shortest = said = [f"{start} {names}; {end}" for names in _ever_shorter(diagnosis.verdict, too_large)]
    return next((one for one in said if len(one.split()) <= MOST_WORDS), shortest)


def _without_cause(diagnosis: Diagnosis) -> str:
    """Say that none is named, and what own bones take away."""
    adapted, own, floor = _levels(diagnosis, "adapted", "own_bones")
    held_out, subjects = held_out_kind_text(diagnosis.gaps), subjects_text(diagnosis)
    end = f"on {held_out} goes from {adapted} to {own} deg with {OWN}; noise alone leaves {floor}."
    if not diagnosis.can_test:
        return f"One motion of one person cannot show a cause: the gap {end}"
    if diagnosis.verdict.answer == NONE:
        return f"People differ, nothing else shows: the gap of {subjects} {end}"
    return f"No listed cause explains the rest: the gap of {subjects} {end}"


def number(value: float | None, coarse: float | None = None) -> str:
    """Write a number with as many digits as ``coarse`` (else itself) deserves; '-' where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if abs(value if coarse is None else coarse) < _FINE else f"{value:.1f}"


def probability_text(value: float) -> str:
    """Write a probability with two digits; one that would round to 0 and is not 0 as '<0.01'; '-' where unknown."""
    if not math.isfinite(value):
        return "-"
    return "<0.01" if 0.0 < value < _LEAST_PROBABILITY else f"{value:.2f}"


def percent_text(value: float) -> str:
    """Write a fraction as '27 %'; '-' where it is unknown."""
    return f"{value:.0%}".replace("%", " %") if math.isfinite(value) else "-"


def gap_text(value: float, digits: int = 2) -> str:
    """Write a gap in degrees; '-' where it is unknown."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def interval_text(gap: Interval) -> str:
    """Write a gap in degrees with its interval: '1.34 [1.24, 1.44]'."""
    return f"{gap_text(gap.value)} [{gap_text(gap.low)}, {gap_text(gap.high)}]"


def with_unit(text: str, unit: str) -> str:
    """Add the unit to a number; 1 is the unit of a bare number."""
    return text if unit == "1" else f"{text} {unit}"


def amplitude_text(amplitude: CauseAmplitude) -> str:
    """Write an amplitude with its interval and unit: '9.3 [7.8, 10.8] deg'."""
    value, low, high = (number(one, amplitude.size.value) for one in amplitude.size)
    known = math.isfinite(amplitude.size.low)
    return with_unit(f"{value} [{low}, {high}]" if known else value, amplitude.unit)


def listed(names: Sequence[str], last: str) -> str:
    """Join names as 'a', 'a and b', 'a, b and c', with ``last`` for 'and'."""
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def cause_names(cause: Cause) -> tuple[str, ...]:
    """Name a cause without what its course goes with, once each."""
    return tuple(dict.fromkeys(cause_of(name) for name in cause.names))


def answer_text(verdict: Verdict) -> str:
    """Write the answer of a verdict: 'a (or b) and c', 'none', 'unknown'."""
    return next(_ever_shorter(verdict)) if verdict.answer == EFFECT else verdict.answer


def step_text(step: str) -> str:
    """Write a step of the gap budget: 'model as it is', '+ ac_translation', 'noise alone'."""
    words = {BASE: "model as it is", ADAPTED_STEP: "adapted", OWN_BONES: "+ own bones", NOISE: "noise alone"}
    return words.get(step, f"+ {step}")


def subjects_text(diagnosis: Diagnosis) -> str:
    """Write the number of shoulders: '1 shoulder', '10 shoulders'."""
    count = len(diagnosis.subjects)
    return f"{count} shoulder{'s' if count != 1 else ''}"


def held_out_kind_text(gaps: Gaps) -> str:
    """Write what the held-out gaps are of: 'held-out motions' if there are several kinds, else persons or postures."""
    return f"held-out {'motions' if gaps.other_motion else 'persons' if gaps.other_person else 'postures'}"


def held_out_text(gaps: Gaps) -> str:
    """Write what was held out for the gaps of which most was."""
    part = "each motion in turn" if gaps.other_motion else "every third posture in turn"
    return f"{part}, with causes found in other persons" if gaps.other_person else part


def _ever_shorter(verdict: Verdict, too_large: Collection[str] = ()) -> Iterator[str]:
    """The causes in ever fewer words: with all names that each may have, with two, with one, the first few of them.

    One that is larger than such an effect is, is only what acts like it.
    """
    each = [cause_names(cause) for cause in verdict.causes]
    as_is = [_ACTS_LIKE if cause.names[0] in too_large else "" for cause in verdict.causes]

    def all_of(way: Callable[[tuple[str, ...]], str]) -> list[str]:
        return [said + way(names) for said, names in zip(as_is, each, strict=True)]

    ways: Sequence[Callable[[tuple[str, ...]], str]] = (_all_names, _two_names, lambda names: names[0])
    yield from (listed(all_of(way), "and") for way in ways)
    yield _first_few(all_of(lambda names: names[0]))
    yield _first_few([names[0] for names in each])


def _first_few(names: list[str]) -> str:
    more = len(names) - _MOST_NAMES
    return listed([*names[:_MOST_NAMES], f"{more} more"] if more > 0 else names, "and")


_ACTS_LIKE = "what acts like "


def _all_names(names: tuple[str, ...]) -> str:
    return f"{names[0]} (or {listed(names[1:], 'or')})" if names[1:] else names[0]


def _two_names(names: tuple[str, ...]) -> str:
    return f"{names[0]} (or {names[1]}{', ...' if names[2:] else ''})" if names[1:] else names[0]


def _levels(diagnosis: Diagnosis, before: GapKind, after: GapKind) -> tuple[str, str, str]:
    """The gap of which most was held out, degrees: before, after, from noise; two digits where one shows no change."""
    levels = diagnosis.gaps.hardest
    found = [levels[kind][ALL].value for kind in (before, after, "noise_floor")]
    coarse, fine = (tuple(gap_text(value, digits) for value in found) for digits in (1, 2))
    return coarse if len(set(coarse)) == len(set(fine)) else fine  # pyright: ignore[reportReturnType]
