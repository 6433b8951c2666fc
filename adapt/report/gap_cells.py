"""Heat maps of a report: the gap by angle and elevation over all subjects, before and after adaptation."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from adapt.diagnosis.location.gap_location import BIN_DEG, AngleGaps, Cell, cells
from adapt.diagnosis.location.observations import observe
from adapt.report.fit_states import STATES, simulated_deg, state_rows
from adapt.solvers import status
from adapt.solvers.rows import posture_rows
from motions.rotations import DEG
from motions.table import ANGLES, Motions

ALL = "all motions"

MOST_MOTIONS = 12
"""Largest number of motions with a map for each; with more, a single map of all motions, as the list is too long."""


def heat_maps(motions: Motions, fits: pd.DataFrame, model: str) -> dict[str, Any]:
    """Compute the heat maps of one model's gaps by angle and bin of humerus elevation.

    ``low_deg``: lower ends of the bins. ``maps``: one entry per motion, with an array (angles, bins) for each state.
    Values are mean absolute differences in degrees over postures whose fit is ok; NaN where there is none.
    """
    by_state = {state: _cells(motions, state_rows(fits, model, state)) for state in STATES}
    every = [cell for state_cells in by_state.values() for cell in state_cells]
    low_deg = sorted({cell.elevation_low_deg for cell in every})
    names = dict.fromkeys(cell.motion for cell in every)
    maps = [
        {"motion": name}
        | {state: _array([c for c in by_state[state] if c.motion == name], low_deg) for state in STATES}
        for name in names
    ]
    return {"low_deg": low_deg, "bin_deg": BIN_DEG, "maps": maps}


def _cells(motions: Motions, fits: pd.DataFrame) -> list[Cell]:
    rows = posture_rows(motions)
    data, simulated = observe(motions, rows), rows.packed(simulated_deg(fits) / DEG)
    fitted: Bool[np.ndarray, "postures subjects"] = rows.packed((fits["status"] == status.OK).to_numpy())
    data = replace(data, measured=data.measured & fitted & np.isfinite(simulated).all(axis=0))
    together = replace(data, motion=np.zeros_like(data.motion), motions=(ALL,))
    one_by_one = [data] if 1 < len(data.motions) <= MOST_MOTIONS else []
    noise_free = np.zeros_like(simulated)
    return [
        cell
        for part in (together, *one_by_one)
        if part.measured.any()
        for cell in cells(AngleGaps(part, simulated, noise_free))
    ]


def _array(cells: list[Cell], low_deg: list[float]) -> Float[np.ndarray, "6 bins"]:
    values = np.full((len(ANGLES), len(low_deg)), np.nan)
    for cell in cells:
        values[ANGLES.index(cell.angle), low_deg.index(cell.elevation_low_deg)] = cell.mean_absolute_deg
    return values
