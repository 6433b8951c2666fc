"""``positions.csv``: measured and simulated positions of landmarks, one row per posture and state."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from jaxtyping import Float

from models.person.positions.landmark_positions import POSITIONS
from motions.table import Motions

BASE, ADAPTED, WITH_CAUSES = "base", "adapted", "with_causes"
"""States: the model as it is, adapted, and adapted with the named causes."""

POSITIONS_FILE = "positions.csv"

_AXES = "xyz"

Places = Mapping[str, Float[np.ndarray, "3 rows"]]


def with_positions(motions: Motions) -> list[str]:
    """Return the subjects with a measured position of a landmark of the girdle."""
    there = np.zeros(len(motions.posture), bool)
    for name in filter(motions.landmarks_mm.__contains__, POSITIONS):
        there |= np.isfinite(motions.landmarks_mm[name]).all(axis=1)
    return list(dict.fromkeys(motions.subject[there].tolist()))


def _columns() -> list[str]:
    words = ("simulated", "measured")
    places = [f"{name}_{axis}_{word}_mm" for name in POSITIONS for word in words for axis in _AXES]
    return ["model", "subject", "motion", "posture", "state", *places]


NO_POSITIONS = pd.DataFrame(columns=_columns())
"""Empty table, for runs without a measured landmark."""


def positions_table(
    motions: Motions, model: str, state: str, simulated_mm: Places, measured_mm: Places
) -> pd.DataFrame:
    """Tabulate the positions of one model in one state, thorax frame, mm; empty cells where there is no position."""
    count, nowhere = len(motions.posture), np.full((3, len(motions.posture)), np.nan)
    keys = [np.full(count, model), motions.subject, motions.motion, motions.posture, np.full(count, state)]
    places = [row for name in POSITIONS for every in (simulated_mm, measured_mm) for row in every.get(name, nowhere)]
    return pd.DataFrame(dict(zip(_columns(), [*keys, *places], strict=True)))
