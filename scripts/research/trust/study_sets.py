# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false
# pyright: reportGeneralTypeIssues=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""What depends on the cadaver? The same subjects with R2, R4 and R6, before and after adaptation (thesis, chapter 3).

    python scripts/research/trust/study_sets.py ../shared/motions/*.csv

Prints Markdown: how the variance of the adapted parameters, of their change and of the gaps divides over sets and
subjects,

    value(set, subject) = mean + set + subject + rest      (two-way analysis of variance, one value per cell)

where 'set' is the part that depends on the cadaver and 'subject' the part that the sets agree on; and how far apart the
simulated angles of two sets are in the same posture.
"""

import itertools
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from jaxtyping import Float

from adapt import adapt_subjects
from adapt.cli import app as cli
from adapt.solvers import status
from adapt.tables.results import ALL_MOTIONS, HELD_OUT
from adapt.trust.thesis.printed import SETS
from models import load_model
from models.adapted_parameters import ADAPTED
from motions import ANGLES, read_motions
from scripts.reporting import markdown

_NOTHING = 1e-20
"""Relative sum of squares that is rounding error."""

app = typer.Typer(add_completion=False)


def variance_shares(values: Float[np.ndarray, "sets subjects"]) -> tuple[float, float, float]:
    """Compute shares of the sum of squares about the mean: sets, subjects, rest; NaN where all values are equal."""
    off = values - values.mean()
    by_set, by_subject = off.mean(axis=1, keepdims=True), off.mean(axis=0, keepdims=True)
    parts = [by_set + 0.0 * off, by_subject + 0.0 * off, off - by_set - by_subject]
    squares = np.array([np.sum(part**2) for part in parts])
    if squares.sum() <= _NOTHING * max(1.0, values.mean() ** 2):
        return (np.nan, np.nan, np.nan)
    return tuple(squares / squares.sum())


def grid(table: pd.DataFrame, column: str) -> Float[np.ndarray, "sets subjects"]:
    """Arrange a column by set and subject, for subjects with a value for every set."""
    values = table.pivot(index="model", columns="subject", values=column).loc[list(SETS)]
    return values.dropna(axis=1).to_numpy()


def agreement_table(parameters: pd.DataFrame, summary: pd.DataFrame) -> str:
    """Tabulate shares of variance and, in the quantity's unit, SD over sets of a subject and over subjects of a set.

    The held-out gap of each bone is the gap on each motion in turn, adapted without it.
    """
    header = ["quantity", "SD over sets", "SD over subjects", "of the set", "of the subject", "rest"]
    lines = []
    good = parameters[parameters["status"] == status.OK]
    for name in ADAPTED:
        changed = good.assign(change=good[f"{name}_mm"] - good[f"{name}_mm_model"])
        for label, table, column in ((f"{name}, mm", good, f"{name}_mm"), (f"{name}, change, mm", changed, "change")):
            lines.append([label, *shared(grid(table, column))])
    all_motions = summary[(summary["motion"] == ALL_MOTIONS) & summary["subject"].isin(parameters["subject"])]
    before, after = (all_motions[all_motions["adapted"] == state] for state in (0, 1))
    every = {name: f"{name}_deg" for name in (*ANGLES, *HELD_OUT)}
    for rows, state, columns in ((before, "before", every), (after, "after", every), (after, "held out", HELD_OUT)):
        for name, column in columns.items():
            lines.append([f"{name}, gap {state}, deg", *shared(grid(rows, column))])
    return markdown(header, lines)


def shared(values: Float[np.ndarray, "sets subjects"]) -> list[str]:
    """Format the cells of a line of :func:`agreement_table`."""
    over_sets = np.sqrt(np.mean(np.var(values, axis=0, ddof=1)))
    over_subjects = np.sqrt(np.mean(np.var(values, axis=1, ddof=1)))
    return [f"{over_sets:.1f}", f"{over_subjects:.1f}", *map(share_cell, variance_shares(values))]


def share_cell(share: float) -> str:
    """Format a share as '12 %'; empty where there is no variance."""
    return "" if np.isnan(share) else f"{100 * share:.0f} %"


def apart_table(fits: pd.DataFrame) -> str:
    """Tabulate mean |simulated with one set - with another| of the same posture, before and after adaptation, deg."""
    header, lines = ["sets", "state", *ANGLES, "all"], []
    good = fits[fits["status"] == status.OK].set_index(["subject", "motion", "posture"])
    for one, other in itertools.combinations(SETS, 2):
        for adapted, state in ((0, "before"), (1, "after")):
            pair = [good[(good["model"] == name) & (good["adapted"] == adapted)] for name in (one, other)]
            simulated = [part[[f"{angle}_simulated_deg" for angle in ANGLES]] for part in pair]
            off = (simulated[0] - simulated[1]).abs().mean()
            lines.append([f"{one}, {other}", state, *(f"{x:.1f}" for x in off), f"{off.mean():.1f}"])
    return markdown(header, lines)


@app.command()
def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files.")],
) -> None:
    """Print, as Markdown, what the three sets agree on after adaptation."""
    motions = read_motions(*files)
    result = adapt_subjects(motions, [load_model(name) for name in SETS])
    print(agreement_table(result.parameters, result.summary), end="\n\n")
    print(apart_table(result.fits))


if __name__ == "__main__":
    cli.main(app)
