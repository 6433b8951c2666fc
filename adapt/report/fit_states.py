# pyright: reportReturnType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""States of a model, before and after adaptation, in the table of fits."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt.solvers import status
from adapt.tables.results import Tables, girdles_after
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle
from models.person.family import AnyModel, girdles_of
from motions.table import ANGLES, Motions

STATES = {"before": 0, "after": 1}
"""Value of the column ``adapted`` by state."""


def state_rows(table: pd.DataFrame, model: str, state: str) -> pd.DataFrame:
    """Select the rows of one model and state; rows of the fits keep the order of the motions' rows."""
    return table[(table["model"] == model) & (table["adapted"] == STATES[state])]


def simulated_deg(fits: pd.DataFrame) -> Float[np.ndarray, "6 rows"]:
    """Extract the simulated angles from the fits, degrees, (6, rows)."""
    return fits[[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy().T


def fitted_deg(fits: pd.DataFrame) -> Float[np.ndarray, "6 rows"]:
    """Extract the simulated angles from the fits, degrees; NaN where the status is not ok."""
    return np.where((fits["status"] == status.OK).to_numpy(), simulated_deg(fits), np.nan)


def adapted_mm(motions: Motions, model: AnyModel, result: Tables) -> dict[str, Float[np.ndarray, "6 subjects"]]:
    """Return the parameters of each subject before and after adaptation; NaN where an adaptation failed."""
    table = result.parameters[result.parameters["model"] == model.name].set_index("subject")
    after = table.loc[list(motions.subjects), [f"{name}_mm" for name in ADAPTED]].to_numpy(float).T
    return {
        "before": np.asarray(girdles_of(model, motions.subjects).adapted_mm),
        "after": np.where(np.isfinite(after).all(axis=0), after, np.nan),
    }


def girdles_by_state(model: AnyModel, subjects: Sequence[str], result: Tables) -> dict[str, Girdle]:
    """Return the girdles of the listed subjects by state; a subject may be listed several times."""
    return {
        "before": girdles_of(model, subjects),
        "after": girdles_after(model, subjects, result.parameters),
    }
