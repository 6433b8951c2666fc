# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Orientation of the thorax in the global frame (Appendix A) as a table, where motion files have it."""

import numpy as np
import pandas as pd

from motions.landmarks.sampled_postures import THORAX_COLUMNS
from motions.table import Motions

THORAX_WORDS = dict(zip(THORAX_COLUMNS, ("backward tilt", "torsion to the left", "flexion to the left"), strict=True))
"""Name of the movement in the positive direction of each angle."""

COLUMNS = ("subject", "motion", "angle", "postures", "median_deg", "least_deg", "most_deg")


def thorax_table(motions: Motions) -> pd.DataFrame:
    """Tabulate median and range of the three angles over the postures of each motion of each subject: ``COLUMNS``.

    The table is empty where the motions lack the columns ``THORAX_COLUMNS``.
    """
    rows = []
    if not set(THORAX_COLUMNS) <= set(motions.extra.columns):
        return pd.DataFrame(rows, columns=list(COLUMNS))
    values = motions.extra[list(THORAX_COLUMNS)].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    keys = pd.DataFrame({"subject": motions.subject, "motion": motions.motion})
    for (subject, motion), own in keys.groupby(["subject", "motion"], sort=False).groups.items():
        for name, column in zip(THORAX_COLUMNS, values[np.asarray(own)].T, strict=True):
            known = column[np.isfinite(column)]
            if len(known):
                numbers = float(np.median(known)), float(known.min()), float(known.max())
                rows.append((subject, motion, name, len(known), *numbers))
    return pd.DataFrame(rows, columns=list(COLUMNS))
