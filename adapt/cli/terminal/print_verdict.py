# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Last lines of ``girdle adapt``: a verdict for each parameter set, folded at the terminal's width."""

import textwrap
from collections.abc import Iterator

import pandas as pd
from rich.console import Console

from adapt.solvers import status
from adapt.tables.folds import MOTION, POSTURES
from adapt.tables.held_out import by_model
from adapt.tables.results import ALL_MOTIONS, parameter_statistics
from motions.table import BONES

_LEAST_WIDTH = 40
"""Smallest width of a line; a narrower terminal folds the line itself."""


_WHAT_WAS_HELD_OUT = {frozenset({MOTION}): "motions", frozenset({POSTURES}): "postures"}
"""Words for held-out motions and postures, by kinds of folds (``adapt.tables.folds``)."""


def print_folded(console: Console, text: str, first: str = "", further: str = "  ") -> None:
    """Print a sentence folded between words, so that a path or an option stays in one piece."""
    width = max(console.width, _LEAST_WIDTH)
    folder = textwrap.TextWrapper(
        width, initial_indent=first, subsequent_indent=further, break_long_words=False, break_on_hyphens=False
    )
    for line in folder.wrap(text):
        console.print(line, soft_wrap=True)


def print_verdicts(console: Console, parameters: pd.DataFrame, heldout: pd.DataFrame, summary: pd.DataFrame) -> None:
    """Print for each parameter set the number of adapted subjects, the held-out gap, and the parameters at a bound."""
    for line in verdicts(parameters, heldout, summary):
        print_folded(console, line)


def verdicts(parameters: pd.DataFrame, heldout: pd.DataFrame, summary: pd.DataFrame) -> Iterator[str]:
    """Write one line for each parameter set about the quality of its adaptation."""
    bounds = parameter_statistics(parameters)
    gaps = by_model(heldout) if len(heldout) else pd.DataFrame()
    for model, rows in parameters.groupby("model", sort=False):
        good = int((rows["status"] == status.OK).sum())
        mine = bounds[(bounds["model"] == model) & (bounds["at_bound"] > 0)]
        at_bound = ", ".join(f"{one.parameter} ({one.at_bound} of {one.subjects})" for one in mine.itertuples())
        kinds = set(heldout["kind"][heldout["model"] == model])
        what = f"on held-out {_WHAT_WAS_HELD_OUT.get(frozenset(kinds), 'motions or postures')}"
        gap = _held_out_gap(gaps.loc[model]) if model in gaps.index else ""
        if not good:
            yield f"{model}: none of {len(rows)} subjects adapted."
            continue
        said = f"gap {what}: {gap}" if gap else _in_sample_gap(summary, model)
        end = f"at a bound, not to be read: {at_bound}" if at_bound else "no parameter at a bound"
        yield f"{model}: {good} of {len(rows)} subjects adapted; {said}; {end}."


def _held_out_gap(row: pd.Series) -> str:
    pairs = {bone: (row[f"{bone}_gap_before_deg"], row[f"{bone}_gap_unseen_deg"]) for bone in BONES}
    return _falls(pairs)


def _in_sample_gap(summary: pd.DataFrame, model: object) -> str:
    rows = summary[(summary["model"] == model) & (summary["motion"] == ALL_MOTIONS) & (summary["subject"] == "mean")]
    before, after = (rows[rows["adapted"] == state] for state in (0, 1))
    pairs = {bone: (before[f"{bone}_deg"].mean(), after[f"{bone}_deg"].mean()) for bone in BONES}
    gap = _falls(pairs)
    return f"gap on the postures adapted to: {gap}" if gap else "no gap, as no posture could be fitted"


def _falls(pairs: dict[str, tuple[float, float]]) -> str:
    """Write 'clavicle 3.0 -> 2.6 deg, scapula 8.2 -> 4.5 deg', without bones that were not measured; where no posture
    could be fitted before, 'clavicle not fitted -> 2.6 deg'."""
    known = {bone: pair for bone, pair in pairs.items() if not pd.isna(pair[1])}
    before = {bone: "not fitted" if pd.isna(pair[0]) else f"{pair[0]:.1f}" for bone, pair in known.items()}
    return ", ".join(f"{bone} {before[bone]} -> {after:.1f} deg" for bone, (_, after) in known.items())
