"""One sentence: how far the adaptation brings the best parameter set to the measured bones."""

from collections.abc import Collection

import numpy as np
import pandas as pd

from adapt.diagnosis.texts.wording import MOST_WORDS
from adapt.report.fit_states import STATES, state_rows
from adapt.tables.folds import MOTION
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
    """Say in at most MOST_WORDS words how the mean gaps of the bones fall with adaptation of the closest model.

    ``people`` says who they are: '10 simulated subjects'; ``kinds``, what was held out of them.
    """
    models = list(dict.fromkeys(summary["model"]))
    best = closest(summary)
    before, after = (statistic(summary, best, state) for state in STATES)
    bones = [bone for bone in _IN_ORDER if np.isfinite(after[f"{bone}_deg"])]
    if not bones:
        return f"No posture of {people} could be fitted."
    held_out = [bone for bone in bones if np.isfinite(after[HELD_OUT[bone]])]
    what = f" on held-out {'motions' if set(kinds) == {MOTION} else 'postures'}"

    def fall(bone: str) -> str:
        said = f"{bone}’s{' gap' if bone == bones[0] else ''}"
        said += f" from {before[f'{bone}_deg']:.1f} to {after[f'{bone}_deg']:.1f}°"
        if bone not in held_out:
            return said
        return f"{said} ({after[HELD_OUT[bone]]:.1f}{what if bone == held_out[0] else ''})"

    takes = f"to {people} takes the {' and the '.join(map(fall, bones))}."
    said = f"Adapting {best}, closest of {len(models)} sets, {takes}", f"Adapting {best} {takes}"
    return said[0] if models[1:] and len(said[0].split()) <= MOST_WORDS else said[1]
