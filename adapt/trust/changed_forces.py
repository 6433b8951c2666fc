# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Whether an adaptation keeps the forces as they were: contact, conoid and the arms of the serratus (thesis 6.4).

The limits are ours. They are the largest difference between two of the five published sets with landmarks in the
published rhythm (``scripts/research/trust/spread_of_sets.py``): an adaptation that changes a force by more has made
another cadaver of the model than any that was measured. A pass says that the difference is within that spread: not that
it is small, nor that the forces are a person's. Of a set without landmarks (das3) the serratus is not checked.
"""

import pandas as pd

from adapt.tables.before_after import subject_means
from adapt.trust.thorax_plausibility import Check

TURNED_DEG = {"TS": 22.2, "AI": 29.8, "conoid": 51.6}
"""Mean angle between the directions of the force before and after; the median of the pairs is 12, 17 and 8. The
largest of the conoid is with breteler_mri, whose conoid is slack where it was measured."""

SERRATUS_RATIO = {"sc": 1.24, "ac": 1.12}
"""Arm of the serratus (thesis 3.3.1) about SC and AC, after over before, or before over after."""

_NAMES = {"TS": "direction at TS", "AI": "direction at AI", "conoid": "direction of the conoid"}

_OURS = "the largest between published sets (ours)"


def force_checks(contact: pd.DataFrame, serratus: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the checks as rows of ``plausibility.csv``, one a model, subject and force; of none without postures."""
    turned = subject_means(contact, [f"{force}_turned_deg" for force in TURNED_DEG])
    rows = []
    for row in turned.to_dict("records"):
        for force, limit in TURNED_DEG.items():
            reason = f"mean angle between the force's directions before and after; {_OURS}"
            check = Check(_NAMES[force], row[f"{force}_turned_deg"], 0.0, limit, "deg", reason)
            rows.append(check.row(row["model"], row["subject"], 0.0))
    for row in serratus.to_dict("records"):
        for joint, limit in SERRATUS_RATIO.items():
            reason = f"length of its mean arm about {joint.upper()}, after over before (thesis 3.3.1); {_OURS}"
            name, value = f"serratus arm about {joint.upper()}", row[f"about_{joint}_ratio"]
            check = Check(name, value, 1.0 / limit, limit, "", reason)
            rows.append(check.row(row["model"], row["subject"], 1.0))
    return pd.DataFrame(rows)
