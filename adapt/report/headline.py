"""One sentence: how far the adaptation brings the best parameter set to the measured bones."""

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from adapt.report.fit_states import STATES, state_rows
from adapt.tables.held_out import MOTION
from adapt.tables.results import ALL_MOTIONS, HELD_OUT
from motions.table import ANGLES, BONES

_IN_ORDER = tuple(reversed(BONES))
"""The bones in the order in which the page names them."""


def statistic(summary: pd.DataFrame, model: str, state: str, name: str = "mean") -> dict[str, float]:
    """Look up the row ``name`` over all subjects and motions: mean absolute differences in degrees, by column."""
    rows = state_rows(summary, model, state)
    row = rows[(rows["motion"] == ALL_MOTIONS) & (rows["subject"] == name)].iloc[0]
    return {column: float(row[column]) for column in summary.columns if column.endswith("_deg")}


def closest(summary: pd.DataFrame) -> str:
    """Find the model that leaves the smallest mean difference over the angles after adaptation."""

    def gap_deg(model: str) -> float:
        row = statistic(summary, model, "after")
        values = [row[f"{angle}_deg"] for angle in ANGLES]
        return float(np.nanmean(values)) if np.isfinite(values).any() else np.inf

    return min(dict.fromkeys(summary["model"]), key=gap_deg)


def headline(summary: pd.DataFrame, people: str, kinds: Collection[str]) -> str:
    """Say in one sentence how the mean gaps of the bones, degrees, fall with adaptation of the closest model.

    ``people`` says who they are: '10 simulated subjects'; ``kinds``, what was held out of them.
    """
    models = list(dict.fromkeys(summary["model"]))
    best = closest(summary)
    before, after = (statistic(summary, best, state) for state in STATES)
    parts = [
        f"{bone} from {before[f'{bone}_deg']:.1f} to {after[f'{bone}_deg']:.1f}"
        for bone in _IN_ORDER
        if np.isfinite(after[f"{bone}_deg"])
    ]
    if not parts:
        return f"No posture of {people} could be fitted."
    start = f"Of {len(models)} parameter sets {best} comes closest: adapting it" if models[1:] else f"Adapting {best}"
    return (
        f"{start} to {people} takes the mean gap of the {' and that of the '.join(parts)} degrees"
        f"{_unseen(after, kinds)}."
    )


def _unseen(after: Mapping[str, float], kinds: Collection[str]) -> str:
    """', and to 4.1 and 3.9 on motions that it has not seen', of the bones that have such a gap."""
    gaps = [after[HELD_OUT[bone]] for bone in _IN_ORDER]
    known = [f"{gap:.1f}" for gap in gaps if np.isfinite(gap)]
    what = "motions" if set(kinds) == {MOTION} else "postures"
    return f", and to {' and '.join(known)} on {what} that it has not seen" if known else ""
