# pyright: reportReturnType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""The two states of a model, before and after adaptation, in the table of fits."""

import numpy as np
import pandas as pd
from jaxtyping import Float

from motions.table import ANGLES

STATES = {"before": 0, "after": 1}
"""And the word for it in the column ``adapted``."""


def state_rows(table: pd.DataFrame, model: str, state: str) -> pd.DataFrame:
    """Select the rows of this model and state; of the fits, in the order of the motions' rows."""
    return table[(table["model"] == model) & (table["adapted"] == STATES[state])]


def simulated_deg(fits: pd.DataFrame) -> Float[np.ndarray, "6 rows"]:
    """Extract the simulated angles from the fits, degrees, (6, rows)."""
    return fits[[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy().T
