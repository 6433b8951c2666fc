# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Plots on the caller's matplotlib axes: angles, positions, and the budget, inclusion and heat map of a diagnosis.

    figure, axes = plt.subplots()
    draw_angles(axes, result, "R2", "P01", "abduction", "scapula_z")

Each function draws data and labels; the caller sets title, size and style.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from adapt.diagnosis.location.gap_location import Cell
from adapt.diagnosis.result import ADAPTED_STEP, BASE, NOISE, OWN_BONES, Diagnosis
from adapt.diagnosis.texts.wording import gap_text, held_out_kind_text, probability_text, step_text
from adapt.output.svg import BLUE, NOTE, ORANGE
from adapt.tables.positions_table import ADAPTED, WITH_CAUSES
from adapt.tables.results import Tables
from motions.errors import InputError
from motions.table import ANGLE_NAMES, ANGLES

OUTLINED = 5
"""Number of outlined cells: those with the largest share of the gap beyond noise."""

_DARK = 0.7
"""Share of the colour scale above which text on it is white."""

_LIGHT_BLUE = "#b9cfe0"


def draw_angles(axes: Axes, result: Tables, model: str, subject: str, motion: str, angle: str) -> None:
    """Draw one of ``motions.ANGLES`` of one motion over humerus elevation, degrees: measured, and simulated before and
    after adaptation. InputError if there is no such row."""
    fits = result.fits
    rows = fits[(fits["model"] == model) & (fits["subject"] == subject) & (fits["motion"] == motion)]
    _check(rows, "draw_angles", f"{model}, {subject}, {motion}")
    for adapted, style, label in (
        (0, {"color": ORANGE, "linestyle": "--"}, "model as it is"),
        (1, {"color": BLUE}, "adapted"),
    ):
        mine = rows[rows["adapted"] == adapted]
        axes.plot(mine["humerus_elevation_deg"], mine[f"{angle}_simulated_deg"], label=label, **style)
    mine = rows[rows["adapted"] == rows["adapted"].min()]
    axes.plot(mine["humerus_elevation_deg"], mine[f"{angle}_measured_deg"], "ko", markersize=4.0, label="measured")
    axes.set_xlabel("humerus elevation, degrees")
    axes.set_ylabel(f"{ANGLE_NAMES[angle]}, degrees")


def draw_positions(
    axes: Axes, table: pd.DataFrame, model: str, subject: str, landmark: str, axis: Literal["x", "y", "z"]
) -> None:
    """Draw one coordinate of a landmark over the postures, mm: measured and simulated. ``table``: rows of
    ``positions.csv`` (``adapt.api.simulated_positions``). InputError if there is no such row."""
    rows = table[(table["model"] == model) & (table["subject"] == subject)]
    _check(rows, "draw_positions", f"{model}, {subject}")
    styles = {ADAPTED: {"color": BLUE}, WITH_CAUSES: {"color": ORANGE}}
    for state, mine in rows.groupby("state", sort=False):
        simulated = mine[f"{landmark}_{axis}_simulated_mm"].to_numpy()
        axes.plot(simulated, label=str(state).replace("_", " "), **styles.get(str(state), {"color": "0.6"}))
    first = rows[rows["state"] == rows["state"].iloc[0]]
    axes.plot(first[f"{landmark}_{axis}_measured_mm"].to_numpy(), "ko", markersize=4.0, label="measured")
    axes.set_xlabel("posture")
    axes.set_ylabel(f"{landmark} {axis}, mm")


def _check(rows: pd.DataFrame, where: str, what: str) -> None:
    if rows.empty:
        raise InputError(where, None, f"there is no row of {what}", "Look at the names in the table")


def draw_budget(axes: Axes, diagnosis: Diagnosis) -> None:
    """Draw the gap budget on held-out motions, one bar per step: the model as it is, adapted, with one cause after
    another, and noise alone."""
    steps = diagnosis.budget
    rows, values = np.arange(len(steps)), np.array([step.gap_deg for step in steps], float).reshape(-1, 3)
    largest = float(np.nanmax(values, initial=0.0)) or 1.0
    shades = {BASE: "0.8", ADAPTED_STEP: _LIGHT_BLUE, OWN_BONES: _LIGHT_BLUE, NOISE: "0.6"}
    axes.barh(rows, values[:, 0], color=[shades.get(step.step, BLUE) for step in steps], height=0.68)
    axes.hlines(rows, values[:, 1], values[:, 2], color="black", linewidth=1.0)
    for y, (value, _, high) in enumerate(values.tolist()):
        at = max((one for one in (value, high) if math.isfinite(one)), default=0.0)
        axes.text(at + 0.015 * largest, y, gap_text(value), va="center", **NOTE)
    axes.set_yticks(rows, [step_text(step.step) for step in steps])
    axes.tick_params(axis="y", length=0.0)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.1 * largest)
    axes.set_xlabel(f"mean |gap| on {held_out_kind_text(diagnosis.gaps)}, degrees")


def draw_inclusion(axes: Axes, diagnosis: Diagnosis) -> None:
    """Draw the inclusion probability of every candidate, most probable first; named candidates are dark."""
    probability = diagnosis.verdict.inclusion
    named = {name for cause in diagnosis.verdict.causes for name in cause.names}
    names = sorted(probability, key=lambda name: -probability[name])
    rows = np.arange(len(names))
    colours = [BLUE if name in named else _LIGHT_BLUE for name in names]
    axes.barh(rows, [probability[name] for name in names], color=colours, height=0.72)
    for y, name in enumerate(names):
        axes.text(probability[name] + 0.01, y, probability_text(probability[name]), va="center", **NOTE)
    axes.set_yticks(rows, names)
    axes.tick_params(axis="y", length=0.0)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.08)
    axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_xlabel("inclusion probability, alone or with others")


def elevation_bins(diagnosis: Diagnosis) -> dict[float, str]:
    """Return the names of the bins of humerus elevation in the heat maps, by the lower end in degrees."""
    cells = diagnosis.where.cells
    names = {cell.elevation_low_deg: f"{cell.elevation_low_deg:.0f}-{cell.elevation_high_deg:.0f}" for cell in cells}
    return dict(sorted(names.items()))


def draw_heat_map(axes: Axes, diagnosis: Diagnosis, motion: str) -> None:
    """Draw the mean absolute gap of the adapted model in one motion, by angle and humerus elevation, degrees. Cells
    with the largest shares beyond noise are outlined. InputError if there is no such motion."""
    cells, lows = diagnosis.where.cells, list(elevation_bins(diagnosis))
    chosen = [cell for cell in cells if cell.motion == motion]
    if not chosen:
        known = ", ".join(sorted({cell.motion for cell in cells}))
        raise InputError("draw_heat_map", None, f"there is no motion '{motion}'", f"Give one of {known}")
    outlined = [cell for cell in cells[:OUTLINED] if cell.motion == motion and cell.share > 0.0]
    _draw_cells(axes, chosen, outlined, lows, max(cell.mean_absolute_deg for cell in cells))
    axes.set_xticks(range(len(lows)), list(elevation_bins(diagnosis).values()), rotation=45)


def _draw_cells(axes: Axes, cells: Sequence[Cell], outlined: Sequence[Cell], lows: Sequence[float], largest: float):
    values = _values(cells, lows)
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=largest, aspect="auto")
    axes.patch.set(facecolor="0.96", edgecolor="0.75", hatch="////", linewidth=0.0)
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "white" if value > _DARK * largest else "black"
            axes.text(column, row, f"{value:.1f}", ha="center", va="center", color=colour, fontsize=7.0)
    for cell in outlined:
        corner = lows.index(cell.elevation_low_deg) - 0.5, ANGLES.index(cell.angle) - 0.5
        axes.add_patch(Rectangle(corner, 1.0, 1.0, fill=False, clip_on=False, edgecolor="black", linewidth=1.6))
    axes.axhline(2.5, color="white", linewidth=2.5)
    axes.set_yticks(range(len(ANGLES)), [ANGLE_NAMES[angle] for angle in ANGLES])
    axes.tick_params(length=0.0)
    axes.spines[:].set_visible(False)


def _values(cells: Sequence[Cell], lows: Sequence[float]) -> Float[np.ndarray, "angles bins"]:
    values = np.full((len(ANGLES), len(lows)), np.nan)
    for cell in cells:
        values[ANGLES.index(cell.angle), lows.index(cell.elevation_low_deg)] = cell.mean_absolute_deg
    return values
