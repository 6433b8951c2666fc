"""The diagnosis on the terminal: the verdict in a sentence, then small tables."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from adapt.diagnosis.inference.verdict import EFFECT, NONE, UNKNOWN
from adapt.diagnosis.wording import Object, listed, together
from models.effects.known import OPTION

_EFFECTS, _CELLS, _PROPOSALS = 5, 5, 3
"""Rows of the tables; diagnosis.json has them all."""

_SELDOM = 3
"""So many effects that such data would least often name are told."""

_SURELY = 0.8
"""Shares above it need no word."""

_BAR = 20
"""Characters of probability 1."""

_BONES = ("clavicle", "scapula", "all")


def print_diagnosis(console: Console, of: Object) -> None:
    """The diagnosis as JSON (``adapt.diagnosis.json_form``): its best model in full, the others in one line each."""
    console.print(f"\n{of['verdict']['sentence']}\n", soft_wrap=True)
    for title, table in _tables(of).items():
        console.print(title, soft_wrap=True)
        console.print(table)
    for note in notes(of):
        console.print(f"- {note}", soft_wrap=True)


def _tables(of: Object) -> dict[str, Table]:
    """By title."""
    of_gap = f"held out: {of['gap_deg']['held_out']}"
    if of["best"]:
        of_gap += f"; the effect: {' + '.join(of['best'])}"
    tables = {
        "Probability of each answer": _probabilities(of),
        f"Mean absolute gap, degrees, with 95 % intervals; {of_gap}": _gap(of),
        "Where: the largest shares of the gap that noise does not explain": _where(of),
        "What to measure next: log odds of the right candidate, now and then": _next_measurement(of),
    }
    if len(of["by_model"]) > 1:
        tables["Every parameter set: gap after adaptation, held out, degrees"] = _models(of)
    return tables


def notes(of: Object) -> list[str]:
    """What the numbers rest on."""
    other = [_otherwise(one) for one in of["at_other_noise"] if _answer(one) != _answer(of["verdict"])]
    alike = [_alike(one, of["smallest_detectable"]) for one in of["indistinguishable"]]
    left_out = [f"Left out: {subject}: {why}." for subject, why in of["left_out"].items()]
    marked = [f"The motions are marked with {name}: likelier beforehand." for name in of["expected"]]
    parts = [_made_of(of["shares"]["all"])] if of["shares"]["all"] else []
    known = [_known(of)] if of["verdict"]["answer"] == EFFECT else []
    rest = [*other, *marked, *parts, _foreseen(of["foreseen"]), *alike, *left_out, *known]
    return [f"Parameter set {of['model']}.", _noise(of["noise"]), *rest]


def _table(words: Sequence[str], numbers: Sequence[str]) -> Table:
    table = Table(box=SIMPLE_HEAD)
    for column in words:
        table.add_column(column)
    for column in numbers:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _probabilities(of: Object) -> Table:
    table = _table(["answer"], ["probability"])
    table.add_column("", no_wrap=True)
    effects = sorted((-p, name) for name, p in of["probability"].items() if name not in (NONE, UNKNOWN))
    shown = [name for _, name in effects[:_EFFECTS]]
    for name in (*shown, NONE, UNKNOWN):
        probability = of["probability"][name]
        bar = "#" * round(_BAR * probability)
        table.add_row(name, _probability(probability), bar, end_section=name in shown[-1:])
    return table


def _probability(value: float) -> str:
    return "<0.01" if 0.0 < value < 0.005 else f"{value:.2f}"


def _gap(of: Object) -> Table:
    gap, table = of["gap_deg"], _table([""], _BONES)
    kinds = {"noise_floor": "noise alone", "base": "model as it is", "adapted": "adapted"}
    if of["best"]:
        kinds["with_effect"] = "with effect"
    for where, levels in (
        ("held out", gap),
        ("motion held out", gap["other_motion"]),
        ("in sample", gap["in_sample"]),
    ):
        if levels is None:
            continue
        table.add_row(where)
        for kind, name in kinds.items():
            values = (_interval(levels[kind][bone]) for bone in _BONES)
            table.add_row(f"  {name}", *values, end_section=kind == list(kinds)[-1])
    return table


def _interval(gap: Mapping[str, float | None]) -> str:
    value, low, high = ("-" if gap[key] is None else f"{gap[key]:.2f}" for key in ("value", "low", "high"))
    return f"{value} [{low}, {high}]"


def _where(of: Object) -> Table:
    table = _table(["motion", "angle", "elevation"], ["gap, deg", "noise, deg", "share"])
    for cell in of["where"][:_CELLS]:
        elevation = f"{cell['elevation_low_deg']:.0f}-{cell['elevation_high_deg']:.0f} deg"
        gap, noise = f"{cell['mean_absolute_deg']:.1f}", f"{cell['noise_deg']:.1f}"
        table.add_row(cell["motion"], cell["angle"], elevation, gap, noise, f"{cell['share']:.0%}")
    return table


def _next_measurement(of: Object) -> Table:
    table = _table(["measurement"], ["now", "then", "probability then"])
    for one in of["next_measurement"][:_PROPOSALS]:
        now, then = f"{one['separation_now']:.1f}", f"{one['separation_then']:.1f}"
        table.add_row(one["what"], now, then, _probability(one["probability_then"]))
    return table


def _models(of: Object) -> Table:
    table = _table(["model"], ["adapted"])
    table.add_column("answer")
    for name, one in of["by_model"].items():
        table.add_row(name, _interval(one["gap_deg"]["adapted"]["all"]), _named(one["verdict"]))
    return table


def _known(of: Object) -> str:
    """How the next adaptation takes the most probable effect, or the two together, into account."""
    options = " ".join(f"{OPTION} {of['amplitude'][name]['option']}" for name in of["best"])
    return f"To adapt with {listed(of['best'], 'and')} as found here: girdle adapt ... {options}"


def _made_of(shares: Mapping[str, Any]) -> str:
    parts = {"noise": "is noise", "constant": "constant in each subject", "systematic": "a course over elevation"}
    each = [f"{shares[key]:.0%} {name}" for key, name in {**parts, "left_over": "none of these"}.items()]
    return f"Of the squared gap after adaptation, {listed(each, 'and')}."


def _noise(noise: Mapping[str, Any]) -> str:
    angle = f"{noise['angle_deg']:.2f} deg an angle"
    source = {
        "given": f"Noise: {angle}, as given",
        "estimated": f"Noise: {angle}, estimated from {noise['freedom'] or 0:.0f} degrees of freedom",
        "assumed": f"Noise: {angle}, assumed, for these data are too few to estimate it; give --noise-deg",
    }
    return f"{source[noise['source']]} (landmarks, where given: {noise['landmark_mm']:.1f} mm)."


def _alike(effects: Sequence[str], all_effects: Collection[str]) -> str:
    which = f"any of the {len(effects)} effects" if len(effects) == len(all_effects) else listed(effects, "and")
    return f"These postures and this noise cannot tell apart {which}."


def _foreseen(of: Mapping[str, Any]) -> str:
    """How often such data would name an effect rightly, and which ones they would least often."""
    often = {name: one["named"] for name, one in of.items()}
    least = sorted(often, key=often.__getitem__)[:_SELDOM]
    each = [f"{name} in {often[name]:.0%}" for name in least if often[name] < _SURELY]
    seldom = f", least {listed(each, 'and')}" if each else ""
    return f"Such data would name an effect of typical size in {sum(often.values()) / len(often):.0%} of cases{seldom}."


def _answer(verdict: Mapping[str, Any]) -> tuple[str, bool, frozenset[str]]:
    return verdict["answer"], verdict["together"], frozenset(verdict["effects"])


def _otherwise(verdict: Mapping[str, Any]) -> str:
    return f"Were the noise {verdict['noise_deg']:.2f} deg, the answer would be {_named(verdict)}."


def _named(verdict: Mapping[str, Any]) -> str:
    answer, effects = verdict["answer"], verdict["effects"]
    if not effects:
        return answer
    names = together(effects) if verdict["together"] else listed(effects, "or")
    return names if answer == EFFECT else f"{answer} (in part {names})"
