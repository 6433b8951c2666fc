"""Verdict of a diagnosis in one sentence of plain English, and the format of its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from adapt.diagnosis.keys import ADAPTED_STEP, ALL, BASE, EFFECT, NOISE, NONE, OWN_BONES
from adapt.tables.positions_table import ADAPTED, WITH_CAUSES
from models.effects.effect import cause_of
from models.girdle import CONSTRAINT_NAMES

if TYPE_CHECKING:  # the result imports this module, to show itself
    from adapt.diagnosis.result import Cause, CauseAmplitude, Diagnosis, GapKind, Gaps, Interval, Verdict

MOST_WORDS = 30
"""Largest number of words of the sentence."""

_FINE = 1.0
"""Numbers below this limit have two digits after the point, others one."""

_LEAST_PROBABILITY = 0.005
"""Smallest probability that is not written as 0.00, which would mean that there is none."""

OWN = "own bones"
"""Term for the bones and frames of each person, which come before any cause."""

_MOST_NAMES = 3
"""Number of causes that are named where there is no room for all."""


def sentence(diagnosis: Diagnosis) -> str:
    """Write the verdict in one sentence for a biomechanist, in at most ``MOST_WORDS`` words."""
    if diagnosis.verdict.answer != EFFECT:
        return _without_cause(diagnosis)
    before, with_effect, floor = _levels(diagnosis, "own_bones", "with_effect")
    levels = diagnosis.gaps.hardest
    shrinks = levels["with_effect"][ALL].value < levels["own_bones"][ALL].value and before != with_effect
    too_large = {name for name, one in diagnosis.amplitude.items() if one.too_large}
    names = list(_ever_shorter(diagnosis.verdict, too_large))
    subjects, change = subjects_text(diagnosis), change_text(before, with_effect, "shrinks" if shrinks else "goes")
    end = f"noise alone leaves {floor}."
    said = []
    if not shrinks and diagnosis.verdict.rests_on_positions and (apart := diagnosis.positions.other_motion):
        off = (
            f"landmarks of held-out motions are {number(apart[WITH_CAUSES])} mm off (adapted {number(apart[ADAPTED])})"
        )
        said = [f"Positions show {one}: {off}; the gap of {subjects} {change}, {end}" for one in names]
    start = f"Beyond {OWN} the gap of {subjects} on {held_out_kind_text(diagnosis.gaps)}"
    said += [f"{start} {change} with {one}; {end}" for one in names]
    return next((one for one in said if len(one.split()) <= MOST_WORDS), said[-1])


def _without_cause(diagnosis: Diagnosis) -> str:
    """Write the sentence of a verdict that names no cause: the change of the gap by own bones."""
    adapted, own, floor = _levels(diagnosis, "adapted", "own_bones")
    held_out, subjects = held_out_kind_text(diagnosis.gaps), subjects_text(diagnosis)
    end = f"on {held_out} {change_text(adapted, own)} with {OWN}; noise alone leaves {floor}."
    if not diagnosis.can_test:
        return f"One motion of one person cannot show a cause: the gap {end}"
    if diagnosis.verdict.answer == NONE:
        return f"People differ, nothing else shows: the gap of {subjects} {end}"
    return f"No listed cause explains the rest: the gap of {subjects} {end}"


def number(value: float | None, coarse: float | None = None) -> str:
    """Write a number with the digits that suit ``coarse`` (default: the number itself); '-' where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if abs(value if coarse is None else coarse) < _FINE else f"{value:.1f}"


def probability_text(value: float) -> str:
    """Write a probability with two digits; '<0.01' where it is above 0 and would round to 0; '-' where unknown."""
    if not math.isfinite(value):
        return "-"
    return "<0.01" if 0.0 < value < _LEAST_PROBABILITY else f"{value:.2f}"


def percent_text(value: float) -> str:
    """Write a fraction as '27 %'; '-' where it is unknown."""
    return f"{value:.0%}".replace("%", " %") if math.isfinite(value) else "-"


def gap_text(value: float, digits: int = 2) -> str:
    """Write a gap in degrees; '-' where it is unknown."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def change_text(before: str, after: str, verb: str = "goes") -> str:
    """Write the change of a written gap: 'goes from 2.0 to 1.4 deg'; 'stays at 0.7 deg' where no digit differs."""
    if "-" in (before, after):
        return "is not known"
    return f"stays at {after} deg" if before == after else f"{verb} from {before} to {after} deg"


def interval_text(gap: Interval) -> str:
    """Write a gap in degrees with its interval: '1.34 [1.24, 1.44]'."""
    return f"{gap_text(gap.value)} [{gap_text(gap.low)}, {gap_text(gap.high)}]"


def with_unit(text: str, unit: str) -> str:
    """Add the unit to a number; the unit 1 stands for a bare number and is not added."""
    return text if unit == "1" else f"{text} {unit}"


def amplitude_text(amplitude: CauseAmplitude) -> str:
    """Write the size of a cause with its interval and unit: '9.3 [7.8, 10.8] deg'."""
    value, low, high = (number(one, amplitude.size.value) for one in amplitude.size)
    known = math.isfinite(amplitude.size.low)
    return with_unit(f"{value} [{low}, {high}]" if known else value, amplitude.unit)


def listed(names: Sequence[str], last: str) -> str:
    """Join names as 'a', 'a and b', 'a, b and c', with ``last`` in the place of 'and'."""
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def cause_names(cause: Cause) -> tuple[str, ...]:
    """List the distinct names of a cause, without the basis after the colon."""
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
    """Write the kind of the held-out gaps: 'held-out motions' if there are several kinds, else persons or postures."""
    return f"held-out {'motions' if gaps.other_motion else 'persons' if gaps.other_person else 'postures'}"


def held_out_text(gaps: Gaps) -> str:
    """Describe the data held out for the hardest gaps (``Gaps.hardest``)."""
    part = "each motion in turn" if gaps.other_motion else "every third posture in turn"
    return f"{part}, with causes found in other persons" if gaps.other_person else part


def violations_text(diagnosis: Diagnosis) -> str:
    """Write how far each constraint is from holding at the measured angles, with own bones and the named causes; empty
    where no posture has all angles."""
    each = diagnosis.where.constraint_spread
    if not each:
        return ""
    names = [CONSTRAINT_NAMES[one.constraint].partition(": ")[2] for one in each]
    left = listed([f"{one.with_causes_mm:.1f}" for one in each], "and")
    noise = listed([f"{one.noise_mm:.1f}" for one in each], "and")
    return f"At the measured angles {listed(names, 'and')} are {left} mm off. Noise alone: {noise} mm."


def _ever_shorter(verdict: Verdict, too_large: Collection[str] = ()) -> Iterator[str]:
    """Yield the causes in ever fewer words: with all names that each may have, with two, with one, the first few
    causes.

    Causes that are ``too_large`` for their effect are written as 'what acts like' it, except in the last form.
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
    """Write the hardest gap, degrees: before, after, from noise; with two digits where one hides a difference."""
    levels = diagnosis.gaps.hardest
    found = [levels[kind][ALL].value for kind in (before, after, "noise_floor")]
    coarse, fine = (tuple(gap_text(value, digits) for value in found) for digits in (1, 2))
    return coarse if len(set(coarse)) == len(set(fine)) else fine  # pyright: ignore[reportReturnType]
