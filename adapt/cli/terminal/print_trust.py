# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Terminal output of ``girdle trust``."""

import math

import pandas as pd
from rich.console import Console

from adapt.cli.terminal.console import folding_table
from adapt.trust.assessment import Trust
from adapt.trust.thorax_plausibility import PASS, WARNING
from adapt.trust.usable_results import trust_sentences
from models.adapted_parameters import ADAPTED


def print_trust(console: Console, found: Trust) -> None:
    """Print parameter intervals, gaps in sample and held out, the checks, and last which results may be used."""
    for model, mine in found.uncertainty.groupby("model", sort=False):
        _print_parameters(console, str(model), mine)
    _print_gaps(console, found.subjects)
    for row in found.subjects.to_dict("records"):
        cautions = [f"at a bound: {row['at_bound']}" if row["at_bound"] else "", row["flat"].partition(";")[0]]
        cautions.append(f"outside the limits: {row['warnings']}" if row["plausibility"] == WARNING else "")
        said = "; ".join(caution for caution in cautions if caution)
        if said:
            console.print(f"{row['model']}, {row['subject']}: {said}", soft_wrap=True)
    _print_checks(console, found.plausibility)
    if found.weights is not None:
        print_weights(console, found.weights)
    for model, mine in found.subjects.groupby("model", sort=False):
        console.print(f"\n{model}", soft_wrap=True)
        for line in trust_sentences(mine):
            console.print(f"- {line}", soft_wrap=True)


def _print_checks(console: Console, checks: pd.DataFrame) -> None:
    """Print which checks all subjects of a model pass, and the failed checks with limits and reason."""
    for model, mine in checks.groupby("model", sort=False):
        passed = []
        for name, rows in mine.groupby("check", sort=False):
            outside = int((rows["verdict"] == WARNING).sum())
            if not outside:
                passed.append(str(name))
                continue
            first = rows.iloc[0]
            limits = f"{first['low']:.3g} to {first['high']:.3g} {first['unit']}".strip()
            said = f"{outside} of {len(rows)} subjects not within {limits} ({first['reason']})"
            console.print(f"{model}, {name}: {WARNING}: {said}", soft_wrap=True)
        if passed:
            console.print(f"{model}: {PASS}: {'; '.join(passed)}", soft_wrap=True)


def _print_parameters(console: Console, model: str, spread: pd.DataFrame) -> None:
    title = f"{model}: 95 % intervals of the adapted parameters, mm\n(* the value itself: at a bound, no estimate)"
    table = folding_table(title, ("subject",), [name.removesuffix("_length") for name in ADAPTED])
    for subject, rows in spread.groupby("subject", sort=False):
        table.add_row(str(subject), *(_interval(row) for row in rows.to_dict("records")))
    console.print(table)


def _interval(row: dict) -> str:
    if row["at_bound"]:
        return f"{row['adapted_mm']:.0f}*"
    return f"{row['low_mm']:.0f}..{row['high_mm']:.0f}"


def _print_gaps(console: Console, subjects: pd.DataFrame) -> None:
    title = (
        "Mean |simulated - measured|, degrees: before and after adaptation (in sample), and on each held-out motion\n"
        "and third of the postures; steps between postures without a jump to another solution; how much of the\n"
        "possible fall of mean J the points on the thorax prevent"
    )
    numbers = ("before", "after", "motion", "postures", "no jump", "prevented")
    table = folding_table(title, ("model", "subject"), numbers)
    gaps = [f"gap_{word}_deg" for word in ("before", "in_sample", "unseen_motion", "unseen_postures")]
    for row in subjects.to_dict("records"):
        shares = (_number(100.0 * row[key], ".0f", " %") for key in ("jump_free", "points_forbid"))
        table.add_row(row["model"], row["subject"], *(_number(row[gap], ".2f") for gap in gaps), *shares)
    console.print(table)


def _number(value: float, form: str, unit: str = "") -> str:
    return "" if math.isnan(value) else f"{value:{form}}{unit}"


def print_weights(console: Console, weights: pd.DataFrame) -> None:
    """Print the trade-off curve of w, and a note where the smallest gap is at an end of the curve."""
    title = "w of E = D + w mean(J), by motions held out (* smallest held-out gap)"
    numbers = ("w", "points rms, mm", "J rms, deg", "gap in sample", "held out", "at bound")
    table = folding_table(title, ("model",), numbers)
    for row in weights.to_dict("records"):
        keys = ("thorax_points_rms_mm", "j_rms_deg", "gap_in_sample_deg", "gap_unseen_deg")
        name = f"{row['weight']:g}{'*' if row['best'] else ''}"
        bound = f"{row['at_bound']} of {row['subjects_ok']}"
        table.add_row(row["model"], name, *(_number(row[key], ".2f") for key in keys), bound)
    console.print(table)
    for model, rows in weights.groupby("model", sort=False):
        best = rows.loc[rows["best"] == 1, "weight"]
        if len(best) and best.iloc[0] in (rows["weight"].min(), rows["weight"].max()):
            said = (
                f"{model}: the smallest held-out gap is at the end of the weights tried, so these motions choose none"
            )
            console.print(said, soft_wrap=True)
