"""The verdict in one or two sentences of plain English, from the numbers of the diagnosis as JSON."""

from collections.abc import Sequence
from typing import Any

from adapt.diagnosis.design.separability import TOLD_APART
from adapt.diagnosis.inference.verdict import NONE, UNKNOWN

Object = dict[str, Any]
"""What one model says, as in diagnosis.json."""

_TYPICAL = 3
"""So many effects say what would not have shown: the most probable ones, which came nearest to showing."""

_LIKELY = 0.5
"""Probability of none from which it is more likely than all else together."""

_TOO_LARGE = 1.0
"""Standard deviations that an effect is larger than such effects are, from which it is said."""

_FINE = 1.0
"""Numbers below it are written with two digits after the point, others with one."""


def sentence(of: Object) -> str:
    """What a biomechanist reads first; ``of`` needs no ``verdict.sentence`` yet."""
    answer = of["verdict"]["answer"]
    if answer == NONE:
        return _nothing(of)
    if answer == UNKNOWN:
        return _unexplained(of)
    return _explained(of)


def number(value: float | None, coarse: float | None = None) -> str:
    """With as many digits as ``coarse`` (else itself) deserves; '-' where there is none."""
    if value is None:
        return "-"
    return f"{value:.2f}" if abs(value if coarse is None else coarse) < _FINE else f"{value:.1f}"


def with_unit(text: str, unit: str) -> str:
    """A number and its unit; 1 is the unit of a bare number."""
    return text if unit == "1" else f"{text} {unit}"


def amplitude_text(amplitude: Object) -> str:
    """'9.3 [7.8, 10.8] deg'."""
    value, low, high = (number(amplitude[key], amplitude["value"]) for key in ("value", "low", "high"))
    return with_unit(f"{value} [{low}, {high}]", amplitude["unit"])


def listed(names: Sequence[str], last: str) -> str:
    """'a', 'a and b', 'a, b and c', with ``last`` for 'and'."""
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def together(names: Sequence[str]) -> str:
    """'a and b together': of effects where two act together, those two, then what may be there in place of one."""
    others = f", or {listed(names[2:], 'or')} in place of one of them" if names[2:] else ""
    return f"{listed(names[:2], 'and')} together{others}"


def subjects_text(of: Object) -> str:
    """'1 subject', '10 subjects'."""
    count = len(of["subjects"])
    return f"{count} subject{'s' if count != 1 else ''}"


def _explained(of: Object) -> str:
    names, best = of["verdict"]["effects"], of["best"]
    gap, start = _gap(of), f"The gap of {subjects_text(of)} is explained by "
    if of["verdict"]["together"]:
        each = "; ".join(f"{name}: {_described(of, name)}" for name in names)
        doubt = f"can also mimic a cause that is not in the list (probability {of['probability'][UNKNOWN]:.2f})"
        return f"{start}{together(names)} ({each}): held out, it {gap}. Two effects {doubt}."
    if len(names) == 1:
        return f"{start}{names[0]} ({_described(of, names[0])}): held out, it {gap}."
    return (
        f"{start}one of {', '.join(names)}: these data cannot tell them apart; {_next(of)}. "
        f"With {listed(best, 'and')} ({_described(of, best[0])}), held out, it {gap}."
    )


def _described(of: Object, name: str) -> str:
    amplitude = of["amplitude"][name]
    return f"{amplitude['what']}; {amplitude_text(amplitude)}"


def _gap(of: Object) -> str:
    before, after, floor = _levels(of)
    verb = "shrinks" if _shrinks(of) else "does not shrink, it goes"
    return f"{verb} from {before} to {after} deg, noise alone leaves {floor}"


def _shrinks(of: Object) -> bool:
    return (of["gap_deg"]["shrinkage"] or 0.0) > 0.0


def _levels(of: Object) -> list[str]:
    """Held out, degrees: adapted, with the effect, from noise alone."""
    values = [of["gap_deg"][kind]["all"]["value"] for kind in ("adapted", "with_effect", "noise_floor")]
    return ["-" if value is None else f"{value:.2f}" for value in values]


def _next(of: Object) -> str:
    if not of["next_measurement"]:
        return "nothing that was tried would"
    best = of["next_measurement"][0]
    if best["separation_then"] >= TOLD_APART:
        return f"{best['what']} would"
    return f"nothing that was tried surely would, {best['what']} comes closest"


def _nothing(of: Object) -> str:
    before, _, floor = _levels(of)
    return (
        f"Nothing {_how_surely(of)}: held out, the gap of {subjects_text(of)} is {before} deg, "
        f"noise alone leaves {floor}. {_would_not_show(of)}"
    )


def _how_surely(of: Object) -> str:
    """An effect is blamed only where none is improbable, so that none is the answer also where nothing is sure."""
    if of["probability"][NONE] >= _LIKELY:
        return "beyond noise"
    likeliest = max((p, name) for name, p in of["probability"].items() if name not in (NONE, UNKNOWN))
    return f"surely beyond noise (none {of['probability'][NONE]:.2f}, {likeliest[1]} {likeliest[0]:.2f})"


def _would_not_show(of: Object) -> str:
    smallest = {name: found for name, found in of["smallest_detectable"].items() if found}
    typical = sorted(smallest, key=lambda name: -of["probability"][name])[:_TYPICAL]
    if not typical:
        return "These data would not show any effect of the list."
    sizes = [f"{with_unit(number(smallest[n]['value']), smallest[n]['unit'])} ({n})" for n in typical]
    return f"An effect below {listed(sizes, 'or')} would not show."


def _unexplained(of: Object) -> str:
    before, after, floor = _levels(of)
    start = f"No effect of the list, alone or in pairs, explains the gap of {subjects_text(of)}"
    takes = f"from {before} to {after} deg held out"
    part = of["verdict"]["effects"]
    if not part:
        return f"{start} (closest: {listed(of['best'], 'and')}, which takes it {takes}, noise alone leaves {floor})."
    each = "; ".join(f"{name}: {_described(of, name)}" for name in part)
    one = len(part) == 1
    why = f"leave{'s' * one} something systematic"
    if of["tests"]["oversize"] >= _TOO_LARGE:
        why = f"{'' if one else 'one of them '}is larger than such an effect is"
    return (
        f"{start}: {listed(part, 'and')} explain{'s' * one} a part of it, {takes}, and {why}; "
        f"noise alone leaves {floor} ({each})."
    )
