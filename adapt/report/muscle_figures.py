# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Muscle lines and moment arms drawn in a report of ``girdle muscles``, and its opening sentences."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from adapt.report.drawn_postures import evenly
from adapt.report.fit_states import fitted_deg, girdles_by_state, state_rows
from adapt.tables.muscle_tables import JOINTS, MuscleTables, muscle_means
from adapt.tables.results import Tables
from models.muscles.muscle_lines import SERRATUS, MuscleLines, muscle_lines_of
from models.muscles.pulls import line_points_mm
from models.person.family import AnyModel
from motions.landmarks.humerus_pose import humerus_pose
from motions.rotations import DEG
from motions.table import Motions

ROOM_KB, DRAWN_KB, LINES_KB = 4600.0, 0.65, 10.0
"""Sizes in kB: room in a page of 10 MB beside the plotting library; one drawn posture of one parameter set; the muscle
lines of that posture."""

CURVED = 5
"""Number of points of a path between its ends; chords then deviate from the ellipsoid by less than a pixel."""

DRAWN = {"": (0, -1), "thorax": tuple(range(CURVED + 2))}
"""Indices of the drawn points of a line, by the contour around which the line wraps."""

ROUND_HUMERUS = (0, 1, 3, 5, 6)
"""Indices of the drawn points around the small humerus, where chords deviate by less than 1 mm."""

_ARM_DIGITS = 1

_MOST_EXACT = 2000
"""Number of drawn postures of all sets above which moment arms are whole mm, which take a third less of the page."""


def muscle_data(
    motions: Motions, models: Sequence[AnyModel], result: Tables, found: MuscleTables, rows: Int[np.ndarray, " rows"]
) -> list[dict[str, Any]]:
    """Collect for each model its ``lines`` (name, muscle, whether it wraps) and, by state, ``paths`` and ``arms_mm``.

    ``paths``: x, y, z of the points of each line in sequence, in whole mm, by index of a drawn row. The rows are evenly
    chosen, without rows that were not fitted. ``arms_mm``: moment arms as joints by muscles by rows, null where not
    fitted.
    """
    places = evenly(len(rows), most_with_lines(len(rows), len(models)))
    exact = len(rows) * len(models) <= _MOST_EXACT
    return [_of_model(motions, model, result, found.muscles, rows, places, exact) for model in models]


def most_with_lines(postures: int, models: int) -> int:
    """Compute for how many postures of each set the page has room for muscle lines, where ``postures`` are drawn."""
    left_kb = ROOM_KB - DRAWN_KB * postures * models
    return max(1, int(left_kb / LINES_KB / models))


def muscle_sentence(found: MuscleTables, model: str, people: str) -> str:
    """Write how the adaptation of one model changes the moment arms of the serratus anterior."""
    row = muscle_means(found).loc[(model, SERRATUS)]
    arms = [f"{row[f'about_{joint}_before_mm']:.0f} to {row[f'about_{joint}_after_mm']:.0f} mm" for joint in JOINTS]
    start = f"Adapting {model} to {people} takes the arm of the serratus anterior"
    return f"{start} about SC from {arms[0]} and about AC from {arms[1]}."


def force_sentence(found: MuscleTables, model: str) -> str:
    """Write how much muscle force the adaptation of one model moves; empty where no posture has forces."""
    moved = found.balance.loc[found.balance["model"] == model, "moved_share"].mean()
    return f"{100 * moved:.0f} % of the force that holds the arm moves between muscles." if moved == moved else ""


def _of_model(
    motions: Motions, model: AnyModel, result: Tables, muscles: pd.DataFrame, rows, places, exact: bool
) -> dict[str, Any]:
    drawn = rows[places]
    names = motions.subject[drawn].tolist()
    lines, humerus = muscle_lines_of(model, names), humerus_pose(motions.take(drawn)).angles
    mine = muscles[muscles["model"] == model.name]
    states = {}
    for state, girdles in girdles_by_state(model, names, result).items():
        angles = fitted_deg(state_rows(result.fits, model.name, state).iloc[drawn]) / DEG
        points = line_points_mm(lines, girdles, angles, CURVED, humerus)
        states[state] = {
            "paths": {int(place): path for place, path in zip(places, _paths(lines, points), strict=True) if path},
            "arms_mm": [
                _arms(motions, mine, f"about_{joint}_{state}_mm", lines.muscles, rows, exact) for joint in JOINTS
            ],
        }
    parts = zip(lines.name, lines.muscle, lines.wraps.tolist(), strict=True)
    return {
        "lines": [{"name": name, "muscle": muscle, "wraps": wraps} for name, muscle, wraps in parts],
        "muscles": lines.muscles,
        "states": states,
    }


def _paths(lines: MuscleLines, points_mm: Float[np.ndarray, " points 3 lines postures"]) -> list[list[list[int]]]:
    """Round the paths of each posture and line to whole mm: only the ends of straight lines; empty where unknown."""
    found = []
    for posture in np.moveaxis(points_mm, -1, 0):
        drawn = [list(DRAWN.get(contour, ROUND_HUMERUS)) for contour in lines.contour]
        each = [posture[which, :, k].ravel() for k, which in enumerate(drawn)]
        known = all(np.isfinite(path).all() for path in each)
        found.append([np.round(path).astype(int).tolist() for path in each] if known else [])
    return found


def _arms(motions: Motions, table: pd.DataFrame, column: str, muscles: Sequence[str], rows, exact: bool) -> list:
    """Return one column of ``muscles.csv`` as muscles by rows; None where the table has no value."""
    keys = ["subject", "motion", "posture"]
    at = pd.MultiIndex.from_arrays([motions.subject[rows], motions.motion[rows], motions.posture[rows]], names=keys)
    parts = [table[table["muscle"] == muscle].set_index(keys)[column].reindex(at).tolist() for muscle in muscles]
    digits = _ARM_DIGITS if exact else None
    return [[None if value != value else round(value, digits) for value in part] for part in parts]
