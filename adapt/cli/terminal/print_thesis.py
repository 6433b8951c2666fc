# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Terminal output of ``girdle compare`` and ``girdle questions``: tables beside those printed, answers by question."""

from collections.abc import Mapping
from math import isnan

import pandas as pd
from rich.console import Console

from adapt.cli.terminal.console import folding_table
from adapt.cli.terminal.print_tables import HEADERS
from adapt.trust.questions.answer import DISTANCE, ELLIPSOID, PERSONS, RHYTHM, Answer
from adapt.trust.questions.answers import Answers
from adapt.trust.questions.distance import BY_NOISE, SPREAD
from adapt.trust.questions.ellipsoids import WITH_LINE, WITH_MEAN, WITHOUT
from adapt.trust.questions.rhythm_question import CLAVICLE, SCAPULA
from adapt.trust.thesis.comparison import THESIS, conclusions
from models.adapted_parameters import ADAPTED

_GAP_TABLES = {"as they are": ("Table 6.1", "Table 6.2"), "adapted": ("Table 6.3", "Table 6.4")}

_TITLES = {
    DISTANCE: (
        "Is the distance of TS and AI to the thorax constant? SD over postures, mm",
        {SPREAD: "measured", BY_NOISE: "by noise alone"},
    ),
    RHYTHM: (
        "A rhythm, or scapula and clavicle measured? Mean difference, degrees",
        {SCAPULA: "scapula", CLAVICLE: "clavicle"},
    ),
    ELLIPSOID: (
        "An ellipsoid for each posture? Gap on held-out motions, degrees",
        {WITHOUT: "one ellipsoid", WITH_MEAN: "+ mean change", WITH_LINE: "+ line"},
    ),
}
"""Title and printed quantities with their headers, by question; questions.csv has all quantities."""


def print_comparison(console: Console, table: pd.DataFrame) -> None:
    """Print each table as 'mean (SD)', with the thesis's numbers above the computed ones."""
    table = table.sort_values("model", key=lambda names: pd.factorize(names)[0], kind="stable")
    for name in ("Table 3.4", "Table 3.5"):
        mine = table[table["table"] == name]
        for subject in mine[mine["source"] != THESIS]["row"].unique():
            title = f"{name}, {subject}: mean |simulated - measured| (SD), degrees"
            _print_gap_rows(console, title, mine[(mine["source"] == THESIS) | (mine["row"] == subject)])
    if not len(table[table["table"] == "Table 6.5"]):
        return
    for state, names in _GAP_TABLES.items():
        _print_gaps(console, f"{' and '.join(names)}: {state}", table[table["table"].isin(names)])
    _print_parameters(console, table)
    shown = folding_table("Mean and largest gap, degrees, before -> after", ("set",), ("clavicle", "scapula"))
    for (model, source), rows in conclusions(table).groupby(["model", "source"], sort=False):
        shown.add_row(f"{model} {source}", *(_both(rows[rows["bone"] == bone]) for bone in ("clavicle", "scapula")))
    console.print(shown)


def _print_gap_rows(console: Console, title: str, mine: pd.DataFrame) -> None:
    shown = folding_table(title, ("set",), HEADERS)
    for (model, source), rows in mine.groupby(["model", "source"], sort=False):
        shown.add_row(f"{model} {source}", *_with_sd(rows, 1))
    console.print(shown)


def _with_sd(rows: pd.DataFrame, digits: int) -> list[str]:
    """Write each number with its SD, '2.9 (1.6)'; a single number has no SD."""
    words = zip(rows["value"], rows["sd"], strict=True)
    return [f"{_or_dash(x, digits)} ({_or_dash(sd, digits)})" for x, sd in words]


def _or_dash(value: float, digits: int) -> str:
    return "-" if isnan(value) else f"{value:.{digits}f}"


def _both(rows: pd.DataFrame) -> str:
    words = (f"{row['before_deg']:.1f} -> {row['after_deg']:.1f}" for row in rows.to_dict("records"))
    return ", max ".join(words)


def _print_gaps(console: Console, title: str, mine: pd.DataFrame) -> None:
    """Print mean and standard deviation over subjects of each angle."""
    means, sds = (mine[mine["row"] == word].reset_index(drop=True) for word in ("mean", "std"))
    title = f"{title}, abduction: mean (std over subjects), degrees"
    _print_gap_rows(console, title, means.assign(sd=sds["value"]))


def _print_parameters(console: Console, table: pd.DataFrame) -> None:
    title = "Tables 6.6 (sets) and 6.5 (adapted: mean (SD)), mm"
    shown = folding_table(title, ("set", "table"), [name.removesuffix("_length") for name in ADAPTED])
    for name in ("Table 6.6", "Table 6.5"):
        for (model, source), rows in table[table["table"] == name].groupby(["model", "source"], sort=False):
            cells = [f"{x:.0f}" for x in rows["value"]] if name == "Table 6.6" else _with_sd(rows, 0)
            shown.add_row(f"{model} {source}", name.removeprefix("Table "), *cells)
    console.print(shown)


def print_answers(console: Console, found: Answers) -> None:
    """Print the main numbers of each answer, with the 95 % interval over persons."""
    console.print(
        f"{found.postures} postures. Noise of an angle, {found.noise_source}: {found.noise_deg:.2f} degrees. "
        "In brackets 95 % over persons; by noise alone in 95 % of repetitions",
        soft_wrap=True,
    )
    for question, (title, quantities) in _TITLES.items():
        _print_answer(console, title, quantities, [one for one in found.answers if one.question == question])


def _print_answer(console: Console, title: str, quantities: Mapping[str, str], answers: list[Answer]) -> None:
    cells = {(one.model, one.case, one.quantity): one for one in answers if one.who == PERSONS}
    rows = dict.fromkeys((model, case) for model, case, quantity in cells if quantity in quantities)
    if not rows:
        console.print(f"{title}: these motions do not tell", soft_wrap=True)
        return
    shown = folding_table(title, ("set", "case"), list(quantities.values()))
    for model, case in rows:
        numbers = [cells.get((model, case, quantity)) for quantity in quantities]
        shown.add_row(model, case, *("" if one is None else _with_interval(one) for one in numbers))
    console.print(shown)


def _with_interval(one: Answer) -> str:
    if isnan(one.value):
        return "-"
    return f"{one.value:.1f}" if isnan(one.low) else f"{one.value:.1f} ({one.low:.1f} to {one.high:.1f})"
