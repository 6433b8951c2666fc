# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Checks whether forces act as before the adaptation: contact, conoid and the serratus's moment arms (thesis 6.4).

The limits are this project's own. Each is the largest difference between two of the five published sets with landmarks
in the published rhythm (``scripts/research/trust/spread_of_sets.py``): an adaptation that changes a force by more makes
the model differ from its cadaver more than the measured cadavers differ from each other. A pass says only that the
difference is within that spread. The difference need not be small, and the forces need not be a person's. For a set
without landmarks (das3) the serratus is not checked.
"""

import pandas as pd

from adapt.tables.before_after import subject_means
from adapt.trust.thorax_plausibility import Check

TURNED_DEG = {"TS": 22.2, "AI": 29.8, "conoid": 51.6}
"""Limit of the mean angle between the directions of a force before and after. The medians of the pairs of sets are 12,
17 and 8. The conoid's largest angle is with breteler_mri, whose conoid is slack where it was measured."""

SERRATUS_RATIO = {"sc": 1.24, "ac": 1.12}
"""Limit of the ratio of the serratus's arms (thesis 3.3.1) about SC and AC: after over before, or before over after."""

_NAMES = {"TS": "direction at TS", "AI": "direction at AI", "conoid": "direction of the conoid"}

_OURS = "the largest between published sets (ours)"


def force_checks(contact: pd.DataFrame, serratus: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the checks as rows of ``plausibility.csv``, one per model, subject and force; a subject without postures
    has none."""
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
