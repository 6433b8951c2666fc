# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""``heldout.csv`` as a table: its columns, and its averages by subject and by model."""

from collections.abc import Collection

import pandas as pd

from adapt.tables.folds import MOTION
from motions.table import ANGLES, BONES

SEEN = {"before": 0, "in_sample": 1}
"""Words for the gaps of the reported fits, and the value of column ``adapted`` for each."""

BONE_PREFIXES = {"": slice(0, len(ANGLES)), **{f"{bone}_": angles for bone, angles in BONES.items()}}
"""Slice of ANGLES over which a gap is averaged, by the prefix of its column."""

COLUMNS = (
    *("model", "subject", "kind", "held_out", "postures", "adapted_to"),
    *(f"{bone}gap_{word}_deg" for word in (*SEEN, "unseen") for bone in BONE_PREFIXES),
    "status",
)
"""Columns of ``heldout.csv``, also where nothing could be held out."""

NOTHING = pd.DataFrame(columns=list(COLUMNS))
"""Empty table, for runs without folds."""


def by_subject(table: pd.DataFrame) -> pd.DataFrame:
    """Average the gaps of each model, subject and kind over its folds.

    The weight of a fold is its number of postures.
    """
    columns = [c for c in table.columns if c.endswith("_deg")]
    weighed = table[columns].mul(table["postures"], axis=0).where(table[columns].notna())
    counts = table[columns].notna().mul(table["postures"], axis=0)
    keys = [table[k] for k in ("model", "subject", "kind")]
    sums = (one.groupby(keys, sort=False).sum() for one in (weighed, counts))
    total, count = sums
    return (total / count.where(count > 0)).reset_index()


def by_model(table: pd.DataFrame) -> pd.DataFrame:
    """Average the gaps of each model over the subjects, whatever the kinds of their folds."""
    return pd.DataFrame(by_subject(table).drop(columns=["subject", "kind"]).groupby("model", sort=False).mean())


def fewest_folds(table: pd.DataFrame, subjects: Collection[str]) -> pd.DataFrame:
    """Keep the folds that ``adapt.tables.folds.motions_or_thirds`` holds out of these subjects: motions, else
    thirds."""
    motions = table["kind"] == MOTION
    several = table["subject"].isin(table["subject"][motions])
    return pd.DataFrame(table[table["subject"].isin(subjects) & (motions | ~several)]).reset_index(drop=True)
