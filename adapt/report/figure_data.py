"""Data of the figures in a report as plain JSON types, every number stored once."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.texts.json_form import plain
from adapt.report.bone_positions import POINTS, bones_mm
from adapt.report.drawn_postures import chosen_rows, chosen_subjects
from adapt.report.fit_states import STATES, adapted_mm, fitted_deg, girdles_by_state, state_rows
from adapt.report.gap_cells import heat_maps
from adapt.report.headline import closest
from adapt.report.muscle_figures import muscle_data
from adapt.solvers import status
from adapt.tables.muscle_tables import JOINTS, MuscleTables
from adapt.tables.results import ALL_MOTIONS, HELD_OUT, STATISTICS, Tables
from models.girdle import CONSTRAINT_NAMES, Girdle
from models.parameter_sets import ParameterSet
from models.person.family import AnyModel
from motions.table import ANGLE_NAMES, ANGLES, Motions

Rows = Int[np.ndarray, " rows"]

COLUMNS = (*ANGLES, "clavicle", "scapula")
"""Columns of the table of subjects: mean absolute differences."""

_ANGLE_DIGITS, _LENGTH_DIGITS, _RESIDUAL_DIGITS = 2, 1, 2
"""Decimals of angles in degrees, lengths in mm (0.1 mm is less than a pixel) and constraint residuals in mm."""


def figure_data(
    motions: Motions,
    models: Sequence[AnyModel],
    result: Tables,
    noise_deg: Mapping[str, float],
    muscles: MuscleTables | None = None,
) -> dict[str, Any]:
    """Collect the data of the report's figures by name (see the keys).

    Arrays of rows hold the chosen postures, one subject and motion after the other. ``noise_deg`` is the SD of the
    noise of one measured angle by model, where known. Null means 'not measured' or 'not fitted'; null in ``muscles``
    means 'not computed'.
    """
    first = models[[model.name for model in models].index(closest(result.summary))]
    left = _gaps(result.summary, first.name, "after", motions.subjects)
    subjects = chosen_subjects(motions, len(models), dict(zip(motions.subjects, known_mean(left[:, :6]), strict=True)))
    rows = chosen_rows(motions, len(models), subjects)
    return plain(
        {
            "angles": [{"key": angle, "name": ANGLE_NAMES[angle]} for angle in ANGLES],
            "constraints": list(CONSTRAINT_NAMES.values()),
            "points": POINTS,
            "columns": COLUMNS,
            "held_out": list(HELD_OUT),
            "subjects": _subjects(motions, rows),
            "posture": motions.posture[rows],
            "elevation_deg": _rounded(motions.humerus_elevation_deg[rows], 1),
            "measured_deg": _rounded(motions.angles_deg[rows].T, _ANGLE_DIGITS),
            "joints": [joint.upper() for joint in JOINTS],
            "muscles": muscle_data(motions, models, result, muscles, rows) if muscles else None,
            "models": [_model(motions, one, result, rows, subjects, noise_deg.get(one.name)) for one in models],
        }
    )


def _subjects(motions: Motions, rows: Rows) -> list[dict[str, Any]]:
    """List the subjects with their motions, and each motion with its first row and the row after its last."""
    names = motions.subject[rows], motions.motion[rows]
    new = np.flatnonzero((names[0][1:] != names[0][:-1]) | (names[1][1:] != names[1][:-1])) + 1
    bounds = [0, *new.tolist(), len(rows)]
    found: dict[str, list[dict[str, Any]]] = {}
    for start, end in itertools.pairwise(bounds):
        found.setdefault(names[0][start], []).append({"name": names[1][start], "rows": [start, end]})
    return [{"name": name, "motions": parts} for name, parts in found.items()]


def _model(
    motions: Motions,
    model: AnyModel,
    result: Tables,
    rows: Rows,
    subjects: tuple[str, ...],
    noise_deg: float | None,
) -> dict[str, Any]:
    number = np.array([motions.subjects.index(name) for name in subjects])
    adapted = (
        result.parameters[result.parameters["model"] == model.name].set_index("subject").loc[list(motions.subjects)]
    )
    theta_mm = adapted_mm(motions, model, result)
    girdles = girdles_by_state(model, motions.subject[rows].tolist(), result)
    at_measured = {s: bones_mm(girdles[s], motions.angles_deg[rows].T) for s in STATES}
    return {
        "name": model.name,
        "noise_deg": noise_deg,
        "sets": [_set(one) for one in ([model] if isinstance(model, ParameterSet) else map(model.of, subjects))],
        "adaptation": adapted["status"].to_numpy()[number],
        "measured_points_mm": _flat(at_measured["before"][0]),
        "heat": _heat(motions, result.fits, model.name),
        "held_out_deg": _rounded(_held_out(result.summary, model.name, subjects), _ANGLE_DIGITS),
        "states": {
            state: {
                "theta_mm": _rounded(theta_mm[state][:, number].T, _LENGTH_DIGITS),
                "gap_deg": _rounded(_gaps(result.summary, model.name, state, subjects), _ANGLE_DIGITS),
                "residual_mm": _rounded(at_measured[state][1], _RESIDUAL_DIGITS),
            }
            | _fits(state_rows(result.fits, model.name, state).iloc[rows], girdles[state])
            for state in STATES
        },
    }


def _set(one: ParameterSet) -> dict[str, Any]:
    """Return the numbers of a set that neither adaptation nor motion changes: SC, M_x and the thorax points."""
    return {
        "sc_mm": np.asarray(one.girdle.sc_mm),
        "M_x_mm": float(one.girdle.centre_mm[0]),
        "thorax_points_mm": _rounded(one.points_mm, _LENGTH_DIGITS),
    }


def _fits(fits: pd.DataFrame, girdles: Girdle) -> dict[str, Any]:
    """Collect angles, bone positions and square root of J of the fits that are ok, and the status of all fits."""
    ok = (fits["status"] == status.OK).to_numpy()
    simulated = fitted_deg(fits)
    return {
        "simulated_deg": _rounded(simulated, _ANGLE_DIGITS),
        "simulated_points_mm": _flat(bones_mm(girdles, simulated)[0]),
        "rms_deg": _rounded(np.sqrt(np.where(ok, fits["j_deg2"], np.nan)), _ANGLE_DIGITS),
        "status": fits["status"].to_numpy(),
    }


def _gaps(summary: pd.DataFrame, model: str, state: str, subjects: Sequence[str]) -> Float[np.ndarray, "subjects 8"]:
    """Look up the ``COLUMNS`` of each subject over all its motions."""
    return _of_subjects(summary, model, state, subjects)[[f"{column}_deg" for column in COLUMNS]].to_numpy(float)


def _held_out(summary: pd.DataFrame, model: str, subjects: Sequence[str]) -> Float[np.ndarray, "subjects 2"]:
    """Look up the held-out gap of each bone; NaN for subjects without folds."""
    return _of_subjects(summary, model, "after", subjects)[list(HELD_OUT.values())].to_numpy(float)


def _of_subjects(summary: pd.DataFrame, model: str, state: str, subjects: Sequence[str]) -> pd.DataFrame:
    rows = state_rows(summary, model, state)
    rows = rows[(rows["motion"] == ALL_MOTIONS) & ~rows["subject"].isin(STATISTICS)].set_index("subject")
    return rows.loc[list(subjects)]


def _heat(motions: Motions, fits: pd.DataFrame, model: str) -> dict[str, Any]:
    found = heat_maps(motions, fits, model)
    maps = [one | {state: _rounded(one[state], _ANGLE_DIGITS) for state in STATES} for one in found["maps"]]
    return found | {"maps": maps}


def _flat(points_mm: Float[np.ndarray, "5 3 rows"]) -> Float[np.ndarray, "15 rows"]:
    return _rounded(points_mm.reshape(-1, points_mm.shape[-1]), _LENGTH_DIGITS)


def _rounded(values: np.ndarray, digits: int) -> np.ndarray:
    return np.round(np.asarray(values, dtype=float), digits)
