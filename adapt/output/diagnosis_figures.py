"""Figures of a diagnosis: what takes the gap away, what is active, where the gap is, how far it shrinks.

Lightness carries what colour does, so that all of them can be read in grey.
"""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from adapt.diagnosis.location.gap_location import Cell
from adapt.diagnosis.result import ADAPTED_STEP, ALL, BASE, NOISE, OWN_BONES, Diagnosis, GapKind, Gaps
from adapt.diagnosis.texts.wording import (
    gap_text,
    held_out_text,
    probability_text,
    step_text,
    subjects_text,
    unseen_text,
)
from adapt.output.svg import BLUE, NOTE, svg
from motions.table import ANGLE_NAMES, ANGLES, BONES

FIGURES = ("budget.svg", "inclusion.svg", "gap_heatmap.svg", "gaps.svg")

_OUTLINED = 5
"""Cells with the largest share of the gap that noise does not explain."""

_MOTIONS_A_ROW = 3

_DARK = 0.7
"""Share of the colour scale from which text on it is white."""

_LIGHT_BLUE = "#b9cfe0"

_PANELS = (ALL, *BONES)
_UNSEEN = {"color": BLUE, "marker": "o", "markersize": 5.0, "linestyle": "none"}
_IN_SAMPLE = {**_UNSEEN, "color": "0.45", "markerfacecolor": "white", "markersize": 4.5}
_APART = 0.16
"""Of a row: unseen values stand above its middle, in-sample ones below it."""


def figures(diagnosis: Diagnosis) -> dict[str, str]:
    """Draw the figures of one model's diagnosis: SVG text by file name."""
    drawings = (budget, inclusion, gap_heatmap, gaps)
    return {name: svg(partial(draw, diagnosis)) for name, draw in zip(FIGURES, drawings, strict=True)}


def gap_heatmap(diagnosis: Diagnosis) -> Figure:
    """Draw the mean absolute gap of the adapted model by angle and elevation, one panel per motion."""
    cells = diagnosis.where.cells
    motions = sorted({cell.motion for cell in cells})
    lows = sorted({cell.elevation_low_deg for cell in cells})
    names = {cell.elevation_low_deg: f"{cell.elevation_low_deg:.0f}-{cell.elevation_high_deg:.0f}" for cell in cells}
    columns = min(len(motions), _MOTIONS_A_ROW)
    rows = math.ceil(len(motions) / columns)
    figure = Figure(figsize=(2.2 + 0.42 * len(lows) * columns, 0.9 + 2.2 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.flat)
    largest = max(cell.mean_absolute_deg for cell in cells)
    for axes in panels[len(motions) :]:
        axes.set_visible(False)
    for number, (axes, motion) in enumerate(zip(panels, motions, strict=False)):
        chosen = [cell for cell in cells if cell.motion == motion]
        outlined = [cell for cell in cells[:_OUTLINED] if cell.motion == motion and cell.share > 0.0]
        _draw_motion(axes, chosen, outlined, lows, largest)
        axes.set_title(motion, loc="left")
        axes.set_xticks(range(len(lows)), [names[low] for low in lows], rotation=45)
        axes.tick_params(labelbottom=number + columns >= len(motions))
    figure.colorbar(panels[0].images[0], ax=grid, label="mean |gap|, degrees", shrink=0.8, pad=0.02)
    figure.supxlabel("humerus elevation, degrees", fontsize=8.0)
    note = "outlined: largest shares beyond noise; hatched: not measured"
    _title(figure, diagnosis, "Where the gap is after adaptation", note)
    return figure


def _draw_motion(axes: Axes, cells: Sequence[Cell], outlined: Sequence[Cell], lows: Sequence[float], largest: float):
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


def budget(diagnosis: Diagnosis) -> Figure:
    """Draw the budget of the gap on held-out motions: as it is, adapted, with one cause after the other, from noise."""
    steps = diagnosis.budget
    rows, values = np.arange(len(steps)), np.array([step.gap_deg for step in steps], float).reshape(-1, 3)
    largest = float(np.nanmax(values, initial=0.0)) or 1.0
    figure = Figure(figsize=(6.0, 1.1 + 0.27 * len(steps)), layout="constrained")
    axes = figure.subplots()
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
    axes.set_xlabel(f"mean |gap| on {unseen_text(diagnosis.gaps)}, degrees")
    _title(figure, diagnosis, "What takes the gap away", "lines: 95 % intervals; +: a cause added to all above it")
    return figure


def inclusion(diagnosis: Diagnosis) -> Figure:
    """Draw the inclusion probability of every candidate, most probable first; those that are named are dark."""
    probability = diagnosis.verdict.inclusion
    named = {name for cause in diagnosis.verdict.causes for name in cause.names}
    names = sorted(probability, key=lambda name: -probability[name])
    rows = np.arange(len(names))
    figure = Figure(figsize=(6.0, 1.0 + 0.21 * len(names)), layout="constrained")
    axes = figure.subplots()
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
    _title(figure, diagnosis, "What is active", "dark: named" if named else "none is named")
    return figure


def gaps(diagnosis: Diagnosis) -> Figure:
    """Draw the noise floor and the gap of the model as it is, adapted, and with the causes, one panel per bone."""
    kinds: dict[GapKind, str] = {"base": "model as it is", "adapted": "adapted", "own_bones": "own bones"}
    if diagnosis.goes_further:
        kinds["with_effect"] = "with the causes"
    kinds["noise_floor"] = "noise alone"
    figure = Figure(figsize=(8.0, 1.1 + 0.34 * len(kinds)), layout="constrained")
    panels = figure.subplots(1, len(_PANELS), sharex=True, sharey=True)
    for axes, bone in zip(panels, _PANELS, strict=True):
        _draw_gaps(axes, diagnosis.gaps, list(kinds), bone)
        axes.set_title("clavicle and scapula" if bone == ALL else bone, loc="left")
        axes.set_yticks(range(len(kinds)), list(kinds.values()))
        axes.tick_params(axis="y", length=0.0)
    panels[0].invert_yaxis()
    panels[0].set_xlim(left=0.0)
    figure.supxlabel("mean |gap|, degrees", fontsize=8.0)
    handles, labels = panels[0].get_legend_handles_labels()
    below_title = (1.0, 1.0 - 0.15 / figure.get_figheight())
    figure.legend(handles, labels, loc="upper right", bbox_to_anchor=below_title, ncols=2, frameon=False)
    _title(figure, diagnosis, "How far the gap shrinks", f"held out: {held_out_text(diagnosis.gaps)}")
    return figure


def _draw_gaps(axes: Axes, gaps: Gaps, kinds: Sequence[GapKind], bone: str) -> None:
    floor = gaps.hardest["noise_floor"][bone].value
    if math.isfinite(floor):
        axes.axvline(floor, color="0.6", linewidth=0.8, linestyle=(0, (4, 2)), zorder=0)
    for levels, shift, style, label in (
        (gaps.hardest, -_APART, _UNSEEN, f"{unseen_text(gaps)}, 95 % interval"),
        (gaps.in_sample, _APART, _IN_SAMPLE, "in sample, 95 % interval"),
    ):
        values = np.array([levels[kind][bone] for kind in kinds]).T
        at = np.arange(len(kinds)) + shift
        axes.hlines(at, values[1], values[2], color=style["color"], linewidth=1.4)
        axes.plot(values[0], at, label=label, **style)
    axes.set_ylim(-0.6, len(kinds) - 0.4)


def _title(figure: Figure, diagnosis: Diagnosis, title: str, note: str) -> None:
    figure.suptitle(
        f"{title}: {subjects_text(diagnosis)}, parameter set {diagnosis.model}\n", x=0.01, ha="left", fontsize=9.5
    )
    figure.text(0.01, 1.0 - 0.26 / figure.get_figheight(), note, ha="left", va="top", **NOTE)
