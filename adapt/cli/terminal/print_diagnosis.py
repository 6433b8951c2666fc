"""Terminal output of ``girdle diagnose``: verdict, causes, next measurement and command; tables on demand."""

import math

from rich.console import Console
from rich.table import Table

from adapt.cli.terminal.console import folding_table
from adapt.cli.terminal.print_verdict import print_folded
from adapt.diagnosis.result import ALL, Diagnoses, Diagnosis, GapKind, GapLevels
from adapt.diagnosis.texts.cause_sentences import cause_sentence
from adapt.diagnosis.texts.measure_next import measure_next
from adapt.diagnosis.texts.notes import notes
from adapt.diagnosis.texts.wording import (
    amplitude_text,
    answer_text,
    gap_text,
    held_out_kind_text,
    interval_text,
    number,
    percent_text,
    probability_text,
    sentence,
    step_text,
    violations_text,
    with_unit,
)
from models.girdle import CONSTRAINT_NAMES
from motions.table import BONES

_CELLS, _PROPOSALS = 5, 3
"""Largest numbers of rows in the tables of where the gap is and of what to measure next; diagnosis.json has all."""

_BAR = 30
"""Length of the longest bar in characters."""

_COLUMNS = (*BONES, ALL)
"""Columns of the table of gaps."""


def print_diagnosis(console: Console, diagnoses: Diagnoses, tables: bool, next_command: str) -> None:
    """Print the diagnosis of the closest model.

    The order is: verdict, with ``tables`` its evidence, each cause, what to measure next, and the command that adapts
    with the causes.
    """
    closest = diagnoses.closest
    console.print()
    print_folded(console, sentence(closest), further="")
    console.print()
    if tables:
        _print_what_it_rests_on(console, diagnoses)
    for number_of, cause in enumerate(closest.verdict.causes, 1):
        print_folded(console, cause_sentence(closest, cause), f"{number_of}. ", "   ")
    if closest.verdict.causes and math.isfinite(closest.left_over_share):
        left = f"Unexplained beyond noise: {percent_text(closest.left_over_share)} of the adapted gap."
        print_folded(console, f"{left} {violations_text(closest)}".rstrip())
    if len({one.verdict.names for one in diagnoses.by_model.values()}) > 1:
        print_folded(console, "The parameter sets name different causes: one that all name is surer.")
    for word, one in zip(("Measure next: ", "Second choice: "), measure_next(closest), strict=False):
        print_folded(console, f"{word}{one.sentences}")
    for outlier in closest.outliers:
        print_folded(console, f"Left out: {outlier}.")
    console.print(f"Next: {next_command}", soft_wrap=True)


def _print_what_it_rests_on(console: Console, diagnoses: Diagnoses) -> None:
    for title, table in _tables(diagnoses).items():
        console.print(title, soft_wrap=True)
        console.print(table)
    for note in notes(diagnoses.closest):
        print_folded(console, note, "- ")
    console.print()


def _tables(diagnoses: Diagnoses) -> dict[str, Table]:
    """Make the tables, by title."""
    closest = diagnoses.closest
    held_out = held_out_kind_text(closest.gaps)
    left = f"; unexplained beyond noise: {percent_text(closest.left_over_share)}"
    tables = {
        f"The gap on {held_out}, degrees{left if math.isfinite(closest.left_over_share) else ''}": _budget(closest)
    }
    if closest.verdict.causes:
        tables[f"Causes: inclusion probability, share of the gap on {held_out}, size"] = _causes(closest)
    tables |= {
        "Mean absolute gap, degrees, with 95 % intervals": _gaps(closest),
        "Where: the largest shares of the gap that noise does not explain": _where(closest),
    }
    if closest.where.constraint_spread:
        tables["Constraints at the measured postures: how far from holding, mm"] = _constraints(closest)
    if closest.next_measurement:
        tables["What to measure next: log odds of the right name, now and then"] = _next_measurement(closest)
    if len(diagnoses.by_model) > 1:
        tables[f"Every parameter set: gap on {held_out} after adaptation, degrees"] = _models(diagnoses)
    return tables


def _budget(diagnosis: Diagnosis) -> Table:
    table = folding_table(None, [""], ["gap", "95 %"])
    table.add_column("", no_wrap=True)
    largest = max((step.gap_deg.value for step in diagnosis.budget if math.isfinite(step.gap_deg.value)), default=0.0)
    for step in diagnosis.budget:
        value, low, high = step.gap_deg
        bar = "#" * round(_BAR * value / largest) if largest and math.isfinite(value) else ""
        table.add_row(step_text(step.step), gap_text(value), f"{gap_text(low)}-{gap_text(high)}", bar)
    return table


def _causes(diagnosis: Diagnosis) -> Table:
    """Tabulate the causes, with the alternative names of each cause one below the other.

    The option of a cause is too long for a column, and stands in the last note.
    """
    table = folding_table(None, ["cause"], ["active", "takes", "size", "typical"])
    verdict = diagnosis.verdict
    for cause in verdict.causes:
        one = diagnosis.amplitude[cause.names[0]]
        table.add_row(
            "\nor ".join(cause.names),
            "\n".join(probability_text(verdict.inclusion_of(name)) for name in cause.names),
            percent_text(cause.gain),
            amplitude_text(one) + (" (!)" if one.too_large else ""),
            with_unit(number(one.typical), one.unit),
        )
    return table


def _gaps(diagnosis: Diagnosis) -> Table:
    gaps, table = diagnosis.gaps, folding_table(None, [""], _COLUMNS)
    kinds: dict[GapKind, str] = {
        "noise_floor": "noise alone",
        "base": "model as it is",
        "adapted": "adapted",
        "own_bones": "own bones",
    }
    if diagnosis.goes_further:
        kinds["with_effect"] = "with the causes"
    parts: dict[str, GapLevels | None] = {
        "held-out person": gaps.other_person,
        "held-out motion": gaps.other_motion,
        "held-out postures": gaps.other_postures,
        "in sample": gaps.in_sample,
    }
    for part, levels in parts.items():
        if levels is None:
            continue
        table.add_row(part)
        rows = {name: levels[kind] for kind, name in kinds.items()}
        for name, of_bones in rows.items():
            values = (interval_text(of_bones[bone]) for bone in _COLUMNS)
            table.add_row(f"  {name}", *values, end_section=name == list(rows)[-1])
    return table


def _where(diagnosis: Diagnosis) -> Table:
    table = folding_table(None, ["motion", "angle", "elevation"], ["gap, deg", "noise, deg", "share"])
    for cell in diagnosis.where.cells[:_CELLS]:
        elevation = f"{cell.elevation_low_deg:.0f}-{cell.elevation_high_deg:.0f} deg"
        gap, noise = f"{cell.mean_absolute_deg:.1f}", f"{cell.noise_deg:.1f}"
        table.add_row(cell.motion, cell.angle, elevation, gap, noise, percent_text(cell.share))
    return table


def _constraints(diagnosis: Diagnosis) -> Table:
    known = diagnosis.goes_further
    table = folding_table(None, ["constraint"], ["adapted", *(["with the causes"] if known else []), "noise alone"])
    for one in diagnosis.where.constraint_spread:
        sizes = (one.adapted_mm, *([one.with_causes_mm] if known else []), one.noise_mm)
        table.add_row(CONSTRAINT_NAMES[one.constraint], *(f"{size:.1f}" for size in sizes))
    return table


def _next_measurement(diagnosis: Diagnosis) -> Table:
    table = folding_table(None, ["measurement", "between"], ["now", "then"])
    for one in diagnosis.next_measurement[:_PROPOSALS]:
        between = " and ".join(one.between)
        table.add_row(one.what, between, f"{one.separation_now:.1f}", f"{one.separation_then:.1f}")
    return table


def _models(diagnoses: Diagnoses) -> Table:
    table = folding_table(None, ["model"], ["adapted"])
    table.add_column("answer")
    for name, one in diagnoses.by_model.items():
        table.add_row(name, interval_text(one.gaps.hardest["adapted"][ALL]), answer_text(one.verdict))
    return table
