"""A diagnosis in words: the verdict in one or two sentences of plain English, and how its numbers are written."""

import math
from collections.abc import Sequence

from adapt.diagnosis.result import (
    ALL,
    EFFECT,
    NONE,
    UNKNOWN,
    Diagnosis,
    EffectAmplitude,
    MeanGap,
    Verdict,
)

_TYPICAL = 3
"""So many effects say what would not have shown: the most probable ones, which came nearest to showing."""

_LIKELY = 0.5
"""Probability of none from which it is more likely than all else together."""

_TOO_LARGE = 1.0
"""Standard deviations that an effect is larger than such effects are, from which it is said."""

_FINE = 1.0
"""Numbers below it are written with two digits after the point, others with one."""

_LEAST_PROBABILITY = 0.005
"""Less than it would be written as 0.00, which says that there is none."""


def sentence(diagnosis: Diagnosis) -> str:
    """Say the verdict as a biomechanist reads it first."""
    answer = diagnosis.verdict.answer
    if answer == NONE:
        return _nothing(diagnosis)
    if answer == UNKNOWN:
        return _unexplained(diagnosis)
    return _explained(diagnosis)


def number(value: float | None, coarse: float | None = None) -> str:
    """Write a number with as many digits as ``coarse`` (else itself) deserves; '-' where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if abs(value if coarse is None else coarse) < _FINE else f"{value:.1f}"


def probability_text(value: float) -> str:
    """Write a probability with two digits; one that would round to 0 and is not 0 as '<0.01'."""
    return "<0.01" if 0.0 < value < _LEAST_PROBABILITY else f"{value:.2f}"


def gap_text(value: float) -> str:
    """Write a gap in degrees with two digits; '-' where it is unknown."""
    return f"{value:.2f}" if math.isfinite(value) else "-"


def interval_text(gap: MeanGap) -> str:
    """Write a gap in degrees with its interval: '1.34 [1.24, 1.44]'."""
    return f"{gap_text(gap.value)} [{gap_text(gap.low)}, {gap_text(gap.high)}]"


def with_unit(text: str, unit: str) -> str:
    """Add the unit to a number; 1 is the unit of a bare number."""
    return text if unit == "1" else f"{text} {unit}"


def amplitude_text(amplitude: EffectAmplitude) -> str:
    """Write an amplitude with its interval and unit: '9.3 [7.8, 10.8] deg'."""
    value, low, high = (number(one, amplitude.value) for one in (amplitude.value, amplitude.low, amplitude.high))
    return with_unit(f"{value} [{low}, {high}]", amplitude.unit)


def listed(names: Sequence[str], last: str) -> str:
    """Join names as 'a', 'a and b', 'a, b and c', with ``last`` for 'and'."""
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def together(names: Sequence[str]) -> str:
    """Join the effects where two act together, 'a and b together': those two, then what may be in place of one."""
    others = f", or {listed(names[2:], 'or')} in place of one of them" if names[2:] else ""
    return f"{listed(names[:2], 'and')} together{others}"


def answer_text(verdict: Verdict) -> str:
    """Write the answer of a verdict: 'a or b', 'a and b together', 'none', 'unknown (in part a)'."""
    if not verdict.effects:
        return verdict.answer
    names = together(verdict.effects) if verdict.together else listed(verdict.effects, "or")
    return names if verdict.answer == EFFECT else f"{verdict.answer} (in part {names})"


def subjects_text(diagnosis: Diagnosis) -> str:
    """Write the number of subjects: '1 subject', '10 subjects'."""
    count = len(diagnosis.subjects)
    return f"{count} subject{'s' if count != 1 else ''}"


def _explained(diagnosis: Diagnosis) -> str:
    names, best = diagnosis.verdict.effects, diagnosis.best
    gap, start = _gap(diagnosis), f"The gap of {subjects_text(diagnosis)} is explained by "
    if diagnosis.verdict.together:
        each = "; ".join(f"{name}: {_described(diagnosis, name)}" for name in names)
        unknown = diagnosis.verdict.probability[UNKNOWN]
        doubt = f"can also mimic a cause that is not in the list (probability {unknown:.2f})"
        return f"{start}{together(names)} ({each}): held out, it {gap}. Two effects {doubt}."
    if len(names) == 1:
        return f"{start}{names[0]} ({_described(diagnosis, names[0])}): held out, it {gap}."
    return (
        f"{start}one of {', '.join(names)}: these data cannot tell them apart; {_next(diagnosis)}. "
        f"With {listed(best, 'and')} ({_described(diagnosis, best[0])}), held out, it {gap}."
    )


def _described(diagnosis: Diagnosis, name: str) -> str:
    amplitude = diagnosis.amplitude[name]
    return f"{amplitude.what}; {amplitude_text(amplitude)}"


def _gap(diagnosis: Diagnosis) -> str:
    before, after, floor = _levels(diagnosis)
    verb = "shrinks" if diagnosis.gaps.shrinkage > 0.0 else "does not shrink, it goes"
    return f"{verb} from {before} to {after} deg, noise alone leaves {floor}"


def _levels(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Held out, degrees: adapted, with the effect, from noise alone."""
    unseen = diagnosis.gaps.unseen
    adapted, with_effect, floor = unseen["adapted"], unseen["with_effect"], unseen["noise_floor"]
    return gap_text(adapted[ALL].value), gap_text(with_effect[ALL].value), gap_text(floor[ALL].value)


def _next(diagnosis: Diagnosis) -> str:
    if not diagnosis.next_measurement:
        return "nothing that was tried would"
    best = diagnosis.next_measurement[0]
    if best.separates:
        return f"{best.what} would"
    return f"nothing that was tried surely would, {best.what} comes closest"


def _nothing(diagnosis: Diagnosis) -> str:
    before, _, floor = _levels(diagnosis)
    return (
        f"Nothing {_how_surely(diagnosis.verdict)}: held out, the gap of {subjects_text(diagnosis)} is {before} deg, "
        f"noise alone leaves {floor}. {_would_not_show(diagnosis)}"
    )


def _how_surely(verdict: Verdict) -> str:
    """An effect is blamed only where none is improbable, so that none is the answer also where nothing is sure."""
    none = verdict.probability[NONE]
    if none >= _LIKELY:
        return "beyond noise"
    likeliest = max((p, name) for name, p in verdict.probability.items() if name not in (NONE, UNKNOWN))
    return f"surely beyond noise (none {none:.2f}, {likeliest[1]} {likeliest[0]:.2f})"


def _would_not_show(diagnosis: Diagnosis) -> str:
    smallest = {name: found for name, found in diagnosis.smallest_detectable.items() if found}
    typical = sorted(smallest, key=lambda name: -diagnosis.verdict.probability[name])[:_TYPICAL]
    if not typical:
        return "These data would not show any effect of the list."
    sizes = [f"{with_unit(number(smallest[name].value), smallest[name].unit)} ({name})" for name in typical]
    return f"An effect below {listed(sizes, 'or')} would not show."


def _unexplained(diagnosis: Diagnosis) -> str:
    before, after, floor = _levels(diagnosis)
    start = f"No effect of the list, alone or in pairs, explains the gap of {subjects_text(diagnosis)}"
    takes = f"from {before} to {after} deg held out"
    part = diagnosis.verdict.effects
    if not part:
        closest = listed(diagnosis.best, "and")
        return f"{start} (closest: {closest}, which takes it {takes}, noise alone leaves {floor})."
    each = "; ".join(f"{name}: {_described(diagnosis, name)}" for name in part)
    one = len(part) == 1
    why = f"leave{'s' * one} something systematic"
    if diagnosis.tests.amplitude_excess >= _TOO_LARGE:
        why = f"{'' if one else 'one of them '}is larger than such an effect is"
    return (
        f"{start}: {listed(part, 'and')} explain{'s' * one} a part of it, {takes}, and {why}; "
        f"noise alone leaves {floor} ({each})."
    )
