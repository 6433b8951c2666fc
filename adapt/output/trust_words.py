# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""What may be used of the adaptations by one parameter set, in three sentences: angles, parameters, ellipsoid."""

import pandas as pd

from adapt.trust.thorax_plausibility import WARNING
from models.adapted_parameters import ADAPTED

_UNSEEN = {"gap_unseen_motion_deg": "motions", "gap_unseen_postures_deg": "postures"}
"""Columns of ``trust.csv``, the one that asks most first."""


def trust_sentences(rows: pd.DataFrame) -> list[str]:
    """Say it of the rows of ``trust.csv`` of one parameter set."""
    return [_angles(rows), _parameters(rows), _ellipsoid(rows)]


def _angles(rows: pd.DataFrame) -> str:
    unseen = next((column for column in _UNSEEN if int(rows[column].count())), None)
    if unseen is None:
        return "Angles: nothing was held out, so nothing says whether the adaptation predicts."
    known = rows[rows[unseen].notna()]
    before, after = known["gap_before_deg"], known[unseen]
    better = int((after < before).sum())
    use = "use the adapted model" if 2 * better > len(known) else "use the model as it is"
    gap = f"the gap on unseen {_UNSEEN[unseen]} goes from {before.mean():.1f} to {after.mean():.1f} deg"
    return f"Angles: {use}; {gap}, smaller in {better} of {len(known)} subjects."


def _parameters(rows: pd.DataFrame) -> str:
    said = rows["at_bound"] + " " + rows["flat"]
    counts = {name: int(said.str.contains(rf"\b{name}\b").sum()) for name in ADAPTED}
    open_ones = [f"{name} ({count} of {len(rows)})" for name, count in counts.items() if count]
    if not open_ones:
        return "Parameters: all are determined."
    return f"Parameters: do not read {', '.join(open_ones)}: at a bound, or only together with another."


def _ellipsoid(rows: pd.DataFrame) -> str:
    warned = rows[rows["plausibility"] == WARNING]
    if warned.empty:
        return "Ellipsoid: within all limits."
    return f"Ellipsoid: look before you use it; outside the limits in {len(warned)} of {len(rows)} subjects."
