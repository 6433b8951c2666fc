"""Headline of a report: one sentence on how close adaptation brings the best parameter set to the measured bones."""

from collections.abc import Collection

import numpy as np
import pandas as pd

from adapt.diagnosis.texts.wording import MOST_WORDS
from adapt.report.fit_states import STATES, state_rows
from adapt.tables.folds import MOTION
from adapt.tables.results import ALL_MOTIONS, HELD_OUT
from motions.table import ANGLES, BONES

_IN_ORDER = tuple(reversed(BONES))
"""Bones in the order in which the page names them."""


def statistic(summary: pd.DataFrame, model: str, state: str, name: str = "mean") -> dict[str, float]:
    """Look up the statistic ``name`` over all subjects and motions: mean absolute differences in degrees, by column."""
    rows = state_rows(summary, model, state)
    row = rows[(rows["motion"] == ALL_MOTIONS) & (rows["subject"] == name)].iloc[0]
    return {column: float(row[column]) for column in summary.columns if column.endswith("_deg")}


def closest(summary: pd.DataFrame) -> str:
    """Find the model with the smallest mean difference over the angles after adaptation."""

    def gap_deg(model: str) -> float:
        row = statistic(summary, model, "after")
        values = [row[f"{angle}_deg"] for angle in ANGLES]
        return float(np.nanmean(values)) if np.isfinite(values).any() else np.inf

    return min(dict.fromkeys(summary["model"]), key=gap_deg)


def headline(summary: pd.DataFrame, people: str, kinds: Collection[str]) -> str:
    """Write in at most MOST_WORDS words how adaptation of the closest model reduces the mean gaps of the bones.

    ``people`` describes the subjects, as '10 simulated subjects'; ``kinds`` are the kinds of their held-out folds.
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
