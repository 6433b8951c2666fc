"""Measurements to make next: what, how many, how, and the gain in degrees, computed from the diagnosis."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from adapt.diagnosis.result import ALL, EFFECT, POSITIONS_OF, TWICE_AS_MANY, UNKNOWN, Diagnosis, Interval, Proposal
from adapt.diagnosis.texts.wording import gap_text, held_out_kind_text, listed, number, percent_text, with_unit
from motions.table import ANGLE_NAMES

_TOLD_APART = 0.95
"""Probability of telling the right one of two names, from which on more of the same data gain little."""

_TWICE = 2
"""Factor on persons or postures in a proposal, and in ``inference.next_measurement``, so that gains can be compared."""

_PERSONS = 10
"""Number of persons proposed in place of one: up to it, more persons gain more than more postures of each
(docs/diagnose.md)."""


@dataclass(frozen=True)
class Measurement:
    """Measurement to make next."""

    what: str
    how_many: str
    how: str
    gain: str
    """Gain in words, with its number and the way in which it is computed."""
    gain_deg: float
    """Gain in degrees; NaN where nothing can be computed."""

    @property
    def sentences(self) -> str:
        """Write the measurement as two sentences of at most thirty words each; the first begins with a small letter."""
        return f"{self.what}: {self.how_many}, {self.how}. Gain: {self.gain}."


def measure_next(diagnosis: Diagnosis) -> list[Measurement]:
    """Propose two measurements, the best one first: what the data lack, then what tells rivals apart, then what answers
    this verdict."""
    kept: dict[str, Measurement] = {}
    for kind, one in _candidates(diagnosis):
        kept.setdefault(kind, one)
    return list(kept.values())[:2]


def _candidates(diagnosis: Diagnosis) -> Iterator[tuple[str, Measurement]]:
    """Yield measurements by kind, the best one first."""
    yield from _lacking(diagnosis)
    for one in diagnosis.next_measurement:
        if one.probabilities[0] < _TOLD_APART:
            yield one.kind, _between_rivals(one, diagnosis)
    answer, positions = diagnosis.verdict.answer, bool(diagnosis.positions.measured_mm)
    if answer == UNKNOWN and not positions:
        yield _positions(diagnosis)
    if answer != UNKNOWN and diagnosis.persons > 1:
        yield _more_persons(diagnosis)
    if not positions:
        yield _positions(diagnosis)
    yield _again(diagnosis)
    if diagnosis.persons > 1:
        yield _more_persons(diagnosis)


def _unexplained_deg(diagnosis: Diagnosis) -> float:
    """Compute the held-out gap that noise and named causes leave: the most that any further cause can take away."""
    levels = diagnosis.gaps.hardest
    beyond_deg = levels["with_effect"][ALL].value - levels["noise_floor"][ALL].value
    return beyond_deg if math.isnan(beyond_deg) else max(0.0, beyond_deg)


def _at_most(diagnosis: Diagnosis, why: str) -> tuple[str, float]:
    """Write and return the gain of a measurement that may show a cause: at most the unexplained gap."""
    gain_deg = _unexplained_deg(diagnosis)
    if not math.isfinite(gain_deg):
        return f"{why}; not computed, for no gap was held out", math.nan
    beside = "causes" if diagnosis.verdict.answer == EFFECT else "own bones"
    return f"{why}; at most {gap_text(gain_deg)} deg, the held-out gap that {beside} and noise leave", gain_deg


def _lacking(diagnosis: Diagnosis) -> Iterator[tuple[str, Measurement]]:
    postures, persons = diagnosis.postures, diagnosis.persons
    if len(diagnosis.kinds) == 1:
        how_many = f"{postures} postures more, of {_of_persons(persons)}"
        gain = _at_most(diagnosis, "a cause can then be tested on held-out motions")
        yield "motion", Measurement("another kind of motion", how_many, "in another plane, measured as before", *gain)
    if persons == 1:
        gain = _at_most(diagnosis, "a cause can then be tested on held-out persons")
        yield "persons", Measurement("more persons", f"{_PERSONS} in place of 1", "by the same motions", *gain)


def _between_rivals(one: Proposal, diagnosis: Diagnosis) -> Measurement:
    """Describe a proposal that distinguishes two names; its gain is the distance of their fits, an angle's root mean
    square (``Proposal.apart_deg``)."""
    now, then = (percent_text(p) for p in one.probabilities)
    gain = f"{one.between[0]} and {one.between[1]} are {gap_text(one.apart_deg)} deg apart, told right in {then}"
    persons = f"{_TWICE * diagnosis.persons} in place of {diagnosis.persons}"
    what, how_many, how = "more persons", persons, "by the same motions"
    if one.kind == "motion":
        what, how_many = f"more of {one.what.removesuffix(f' of {TWICE_AS_MANY}')}", f"{persons} persons"
        how = "measured as before"
    elif one.kind == "positions":
        names, _, noise = one.what.removeprefix(POSITIONS_OF).partition(", ")
        what, how_many = POSITIONS_OF + listed(names.split(), "and"), _in_every_posture(diagnosis)
        how = f"{noise}, with girdle convert"
    return Measurement(what, how_many, how, f"{gain} of cases in place of {now}", one.apart_deg)


def _more_persons(diagnosis: Diagnosis) -> tuple[str, Measurement]:
    """Propose twice as many persons. Their errors are independent, so that an interval over n persons has
    sqrt(n / (n + m)) of its half width with m more; the gain is what the interval of the held-out gap loses."""
    n = diagnosis.persons
    shrinks = math.sqrt(1.0 / _TWICE)
    half_deg = _half(diagnosis.gaps.hardest["with_effect"][ALL])
    gain = "not computed, for no gap was held out"
    if math.isfinite(half_deg):
        within = f"within {gap_text(shrinks * half_deg)} deg in place of {gap_text(half_deg)}"
        gain = f"the gap on {held_out_kind_text(diagnosis.gaps)} is known to {within}"
    for name, one in diagnosis.amplitude.items():
        if math.isfinite(half := _half(one.size)):
            gain += f", the size of {name} to {with_unit(number(shrinks * half), one.unit)} in place of {number(half)}"
            break
    how = "by the same motions: an interval shrinks with the root of their number"
    return "persons", Measurement(
        "more persons", f"{_TWICE * n} in place of {n}", how, gain, (1.0 - shrinks) * half_deg
    )


def _positions(diagnosis: Diagnosis) -> tuple[str, Measurement]:
    gain = _at_most(diagnosis, "joints that move show there")
    what = f"{POSITIONS_OF}SC and AC"
    return "positions", Measurement(what, _in_every_posture(diagnosis), "with girdle convert", *gain)


def _again(diagnosis: Diagnosis) -> tuple[str, Measurement]:
    """Propose to measure twice where most of the unexplained gap is. Two measurements have 1 / sqrt(2) of the noise of
    one; the gain is that noise less."""
    now_deg = diagnosis.noise.angle_deg
    then_deg = now_deg / math.sqrt(_TWICE)
    gain = f"the noise of an angle falls from {gap_text(now_deg)} to {gap_text(then_deg)} deg"
    cell = next((one for one in diagnosis.where.cells if one.share > 0.0), None)
    what, how_many = "every posture twice", f"{diagnosis.postures} postures more"
    if cell is not None:
        what = f"again {cell.motion} at {cell.elevation_low_deg:.0f} to {cell.elevation_high_deg:.0f} deg"
        how_many = f"{cell.postures} postures more of {_of_persons(diagnosis.persons)}"
        gain += f" where {ANGLE_NAMES[cell.angle]} has {percent_text(cell.share)} of the gap beyond noise"
    how = "measured anew, to tell errors of measurement from a cause"
    return "again", Measurement(what, how_many, how, gain, now_deg - then_deg)


def _half(interval: Interval) -> float:
    return 0.5 * (interval.high - interval.low)


def _in_every_posture(diagnosis: Diagnosis) -> str:
    return f"in the {diagnosis.postures} postures of {_of_persons(diagnosis.persons)}"


def _of_persons(persons: int) -> str:
    return "the same person" if persons == 1 else f"the {persons} persons"
