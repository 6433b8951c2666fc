# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""``heldout.csv`` as a table: its columns, and what it says of a model, a subject and a motion."""

from collections.abc import Collection

import pandas as pd

from adapt.tables.folds import MOTION
from motions.table import ANGLES, BONES

SEEN = {"before": 0, "in_sample": 1}
"""Gaps of the fits that are reported, by their word; and the column ``adapted`` of their table."""

BONE_PREFIXES = {"": slice(0, len(ANGLES)), **{f"{bone}_": angles for bone, angles in BONES.items()}}
"""Which of ANGLES a gap of a table is of, by the beginning of its column."""

COLUMNS = (
    *("model", "subject", "kind", "held_out", "postures", "adapted_to"),
    *(f"{bone}gap_{word}_deg" for word in (*SEEN, "unseen") for bone in BONE_PREFIXES),
    "status",
)
"""Of ``heldout.csv``, whether anything could be held out or not."""

NOTHING = pd.DataFrame(columns=list(COLUMNS))
"""The table of what was not held out."""


def by_subject(table: pd.DataFrame) -> pd.DataFrame:
    """Average the gaps of each model, subject and kind over its parts.

    Each part counts as many times as it has postures.
    """
    columns = [c for c in table.columns if c.endswith("_deg")]
    weighed = table[columns].mul(table["postures"], axis=0).where(table[columns].notna())
    counts = table[columns].notna().mul(table["postures"], axis=0)
    keys = [table[k] for k in ("model", "subject", "kind")]
    sums = (part.groupby(keys, sort=False).sum() for part in (weighed, counts))
    total, count = sums
    return (total / count.where(count > 0)).reset_index()


def by_model(table: pd.DataFrame) -> pd.DataFrame:
    """Average the gaps of each model over the subjects, whatever was held out of each."""
    return pd.DataFrame(by_subject(table).drop(columns=["subject", "kind"]).groupby("model", sort=False).mean())


def fewest_parts(table: pd.DataFrame, subjects: Collection[str]) -> pd.DataFrame:
    """Keep of these subjects what ``adapt.tables.folds.motions_or_thirds`` holds out: motions, else thirds."""
    motions = table["kind"] == MOTION
    several = table["subject"].isin(table["subject"][motions])
    return pd.DataFrame(table[table["subject"].isin(subjects) & (motions | ~several)]).reset_index(drop=True)
