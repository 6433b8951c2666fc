"""The diagnosis on the terminal: the verdict in a sentence, then small tables."""

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from adapt.diagnosis.notes import notes
from adapt.diagnosis.result import ALL, HELD_OUT, NONE, UNKNOWN, Diagnoses, Diagnosis, GapKind, GapLevels
from adapt.diagnosis.wording import answer_text, interval_text, probability_text, sentence
from motions.table import BONES

_EFFECTS, _CELLS, _PROPOSALS = 5, 5, 3
"""Rows of the tables; diagnosis.json has them all."""

_BAR = 20
"""Characters of probability 1."""

_COLUMNS = (*BONES, ALL)
"""Of the table of gaps."""


def print_diagnosis(console: Console, diagnoses: Diagnoses) -> None:
    """Print the diagnosis of the closest model in full, the others in one line each."""
    closest = diagnoses.closest
    console.print(f"\n{sentence(closest)}\n", soft_wrap=True)
    for title, table in _tables(diagnoses).items():
        console.print(title, soft_wrap=True)
        console.print(table)
    for note in notes(closest):
        console.print(f"- {note}", soft_wrap=True)


def _tables(diagnoses: Diagnoses) -> dict[str, Table]:
    """By title."""
    closest = diagnoses.closest
    what = f"held out: {HELD_OUT}"
    if closest.best:
        what += f"; the effect: {' + '.join(closest.best)}"
    tables = {
        "Probability of each answer": _probabilities(closest),
        f"Mean absolute gap, degrees, with 95 % intervals; {what}": _gaps(closest),
        "Where: the largest shares of the gap that noise does not explain": _where(closest),
        "What to measure next: log odds of the right candidate, now and then": _next_measurement(closest),
    }
    if len(diagnoses.by_model) > 1:
        tables["Every parameter set: gap after adaptation, held out, degrees"] = _models(diagnoses)
    return tables


def _table(words: Sequence[str], numbers: Sequence[str]) -> Table:
    table = Table(box=SIMPLE_HEAD)
    for column in words:
        table.add_column(column)
    for column in numbers:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _probabilities(diagnosis: Diagnosis) -> Table:
    table = _table(["answer"], ["probability"])
    table.add_column("", no_wrap=True)
    by_answer = diagnosis.verdict.probability
    effects = sorted((-p, name) for name, p in by_answer.items() if name not in (NONE, UNKNOWN))
    largest = [name for _, name in effects[:_EFFECTS]]
    for name in (*largest, NONE, UNKNOWN):
        bar = "#" * round(_BAR * by_answer[name])
        table.add_row(name, probability_text(by_answer[name]), bar, end_section=name in largest[-1:])
    return table


def _gaps(diagnosis: Diagnosis) -> Table:
    gaps, table = diagnosis.gaps, _table([""], _COLUMNS)
    kinds: dict[GapKind, str] = {"noise_floor": "noise alone", "base": "model as it is", "adapted": "adapted"}
    if diagnosis.best:
        kinds["with_effect"] = "with effect"
    parts: dict[str, GapLevels | None] = {
        "held out": gaps.unseen,
        "motion held out": gaps.other_motion,
        "in sample": gaps.in_sample,
    }
    for part, levels in parts.items():
        if levels is None:
            continue
        table.add_row(part)
        for kind, name in kinds.items():
            values = (interval_text(levels[kind][bone]) for bone in _COLUMNS)
            table.add_row(f"  {name}", *values, end_section=kind == list(kinds)[-1])
    return table


def _where(diagnosis: Diagnosis) -> Table:
    table = _table(["motion", "angle", "elevation"], ["gap, deg", "noise, deg", "share"])
    for cell in diagnosis.cells[:_CELLS]:
        elevation = f"{cell.elevation_low_deg:.0f}-{cell.elevation_high_deg:.0f} deg"
        gap, noise = f"{cell.mean_absolute_deg:.1f}", f"{cell.noise_deg:.1f}"
        table.add_row(cell.motion, cell.angle, elevation, gap, noise, f"{cell.share:.0%}")
    return table


def _next_measurement(diagnosis: Diagnosis) -> Table:
    table = _table(["measurement"], ["now", "then", "probability then"])
    for one in diagnosis.next_measurement[:_PROPOSALS]:
        now, then = f"{one.separation_now:.1f}", f"{one.separation_then:.1f}"
        table.add_row(one.what, now, then, probability_text(one.probability_then))
    return table


def _models(diagnoses: Diagnoses) -> Table:
    table = _table(["model"], ["adapted"])
    table.add_column("answer")
    for name, one in diagnoses.by_model.items():
        table.add_row(name, interval_text(one.gaps.unseen["adapted"][ALL]), answer_text(one.verdict))
    return table
