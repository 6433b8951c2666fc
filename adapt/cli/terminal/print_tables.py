# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Tables that a run prints on the terminal."""

import math
from collections import Counter

import pandas as pd
from rich.console import Console

from adapt.cli.terminal.console import folding_table
from adapt.own_bones.own_adaptation import DO_NOT_PREDICT, NOT_CONVERGED, WORDS
from adapt.solvers import status
from adapt.tables.folds import MOTION
from adapt.tables.held_out import by_model, by_subject
from adapt.tables.results import (
    ALL_MOTIONS,
    OWN_SCALES,
    OWN_WORD,
    STATISTICS,
    parameter_statistics,
    without_landmarks,
)
from motions.table import ANGLES

HEADERS = ("clav\npr", "clav\nel", "clav\nax", "scap\npr", "scap\nro", "scap\nti")
"""Abbreviations of the thesis: pro/retraction, elevation, axial rotation, latero rotation, tipping. Two lines leave
subjects the room of ``simulated_trial`` at 80 columns."""

_MOST_PRINTED = 100
"""Largest number of subjects with a line of their own."""


def print_summary(console: Console, summary: pd.DataFrame, subjects: int) -> None:
    """Print Tables 6.1-6.4: mean absolute differences, degrees, of all motions of a subject, by model and state.

    ``subjects``: number of subjects; for more than ``_MOST_PRINTED``, only the statistics are printed.
    """
    everything = summary[summary["motion"] == ALL_MOTIONS]
    for (model, adapted), rows in everything.groupby(["model", "adapted"], sort=False):
        state = "after adaptation" if adapted else "before adaptation"
        title = f"{model}, {state}: mean |simulated - measured|, degrees"
        table = folding_table(title, ("subject",), (*HEADERS, "clav", "scap"))
        if subjects > _MOST_PRINTED:
            console.print(f"{subjects} subjects: of each alone in summary.csv")
            rows = rows.tail(len(STATISTICS))
        elif subjects == 1:  # mean, least and most equal its own values
            rows = rows.head(1)
        for number, row in enumerate(rows.to_dict("records"), 1):
            values = [row[f"{name}_deg"] for name in (*ANGLES, "clavicle", "scapula")]
            table.add_row(row["subject"], *map(_cell, values), end_section=number == len(rows) - len(STATISTICS))
        console.print(table)
        _print_missing(console, rows[~rows["subject"].isin(STATISTICS)])


def _print_missing(console: Console, rows: pd.DataFrame) -> None:
    for row in rows[rows["postures"] > rows["postures_ok"]].to_dict("records"):
        missing = row["postures"] - row["postures_ok"]
        console.print(f"  {row['subject']}: {missing} of {row['postures']} postures not fitted, not counted above")


def print_parameters(console: Console, parameters: pd.DataFrame) -> None:
    """Print Tables 6.5 and 6.6: adapted parameters, mean and SD over subjects, mm, beside the model's own values."""
    statistics = parameter_statistics(parameters)
    numbers = ("model's own", "adapted mean", "SD", "at bound")
    table = folding_table("Adapted parameters over subjects, mm", ("model", "parameter"), numbers)
    for model, rows in statistics.groupby("model", sort=False):
        for number, row in enumerate(rows.to_dict("records")):
            values = (_cell(row[key]) for key in ("model_mm", "mean_mm", "sd_mm"))
            bound = f"{row['at_bound']} of {row['subjects']}" if row["at_bound"] else ""
            name = "" if number else str(model)
            table.add_row(name, row["parameter"], *values, bound, end_section=number == len(rows) - 1)
    console.print(table)


_KEPT = {
    WORDS[DO_NOT_PREDICT]: "Own bones do not predict their held-out motions",
    WORDS[NOT_CONVERGED]: "Own bones were not found",
}


def print_own_bones(console: Console, parameters: pd.DataFrame) -> None:
    """Print the scales of own bones, subjects with the plain adaptation, and sizes undetermined or far from the set."""
    good = parameters[parameters["status"] == status.OK]
    for model, rows in good.groupby("model", sort=False):
        six, bones, frames, _ = (rows[name].iloc[0] for name in OWN_SCALES)
        noise = " to ".join(dict.fromkeys(f"{x:.2f}" for x in (rows["noise_deg"].min(), rows["noise_deg"].max())))
        console.print(
            f"{model}, own bones: SDs of people times {six:.2f} (the six), {bones:.2f} (bones), "
            f"{frames:.2f} (frames); noise {noise} degrees",
            soft_wrap=True,
        )
        for word, cause in _KEPT.items():
            if len(kept := rows["subject"][rows[OWN_WORD] == word]):
                named = ", ".join(kept.head(_MOST_PRINTED)) + ", ..." * (len(kept) > _MOST_PRINTED)
                console.print(f"  {cause}, the plain adaptation is kept: {named}", soft_wrap=True)
        untold = Counter(" ".join(rows["not_told"]).split())
        if nobody := [name for name, count in untold.items() if count == len(rows)]:
            console.print(f"  The motions say next to nothing of: {', '.join(nobody)}", soft_wrap=True)
        far = Counter(" ".join(rows["far_from_people"]).split())
        if counted := [f"{name} ({count} of {len(rows)})" for name, count in far.most_common()]:
            said = f"Farther from the set than people are (column far_from_people): {', '.join(counted)}"
            console.print(f"  {said}", soft_wrap=True)


def print_without_landmarks(console: Console, parameters: pd.DataFrame) -> None:
    """Name the subjects that were adapted without any position of TS and AI."""
    if without := without_landmarks(parameters):
        named = ", ".join(without[:_MOST_PRINTED]) + (", ..." if len(without) > _MOST_PRINTED else "")
        console.print(f"No positions of TS and AI, adapted without them: {named}", soft_wrap=True)


def print_heldout(console: Console, heldout: pd.DataFrame, subjects: int) -> None:
    """Print the held-out gap beside the gaps of the same postures before adaptation and in sample."""
    known = heldout["subject"].nunique()
    if known < subjects:
        others = "the others were not sampled, not adapted or have a single posture"
        why = others if known else "every subject has a single posture"
        console.print(f"Held-out gaps of {known} of {subjects} subjects: {why}")
    if not known:
        return
    means = by_model(heldout).to_dict("index")
    folds = heldout.groupby(["model", "subject"]).size()
    for model, rows in by_subject(heldout).groupby("model", sort=False):
        title = (
            f"{model}: mean |simulated - measured|, degrees,\nbefore adaptation, after it (in sample),\n"
            "with the motion, or a third of a single one, held out"
        )
        table = folding_table(title, ("subject",), ("clav", "after", "held", "scap", "after", "held"))
        table.add_column("held out", no_wrap=True)
        for row in rows.to_dict("records") if known <= _MOST_PRINTED else ():
            said = f"{folds[model, row['subject']]} motions" if row["kind"] == MOTION else "thirds"
            table.add_row(row["subject"], *_heldout_cells(row), said)
        table.add_section()
        table.add_row("mean", *_heldout_cells(means[model]), "")
        console.print(table)


def _heldout_cells(row: dict) -> list[str]:
    words = ("before", "in_sample", "unseen")
    values = [row[f"{bone}_gap_{word}_deg"] for bone in ("clavicle", "scapula") for word in words]
    return [_cell(value) for value in values]


def _cell(value: float) -> str:
    """Format a number; a dash for an angle that was not measured, or the SD of one subject."""
    return "-" if math.isnan(value) else f"{value:.1f}"
