"""Figures of a diagnosis: where the gap is, which answer is how probable, how far it shrinks.

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

from adapt.diagnosis.gap_location import Cell
from adapt.diagnosis.result import ALL, HELD_OUT, NONE, UNKNOWN, Diagnosis, GapKind, HeldOutGaps
from adapt.diagnosis.wording import probability_text, subjects_text
from adapt.output.svg import BLUE, NOTE, svg
from motions.table import ANGLE_NAMES, ANGLES, BONES

FIGURES = ("gap_heatmap.svg", "probabilities.svg", "gaps.svg")

_OUTLINED = 5
"""Cells with the largest share of the gap that noise does not explain."""

_MOTIONS_A_ROW = 3

_DARK = 0.7
"""Share of the colour scale from which text on it is white."""

_PANELS = (ALL, *BONES)
_HELD_OUT = {"color": BLUE, "marker": "o", "markersize": 5.0, "linestyle": "none"}
_IN_SAMPLE = {**_HELD_OUT, "color": "0.45", "markerfacecolor": "white", "markersize": 4.5}
_APART = 0.16
"""Of a row: held-out values stand above its middle, in-sample ones below it."""


def figures(diagnosis: Diagnosis) -> dict[str, str]:
    """Draw the figures of one model's diagnosis: SVG text by file name."""
    drawings = (gap_heatmap, probabilities, gaps)
    return {name: svg(partial(draw, diagnosis)) for name, draw in zip(FIGURES, drawings, strict=True)}


def gap_heatmap(diagnosis: Diagnosis) -> Figure:
    """Draw the mean absolute gap of the adapted model by angle and elevation, one panel per motion."""
    cells = diagnosis.cells
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


def probabilities(diagnosis: Diagnosis) -> Figure:
    """Draw the probability of every effect, most probable first, then none and unknown; the answer is dark."""
    verdict, probability = diagnosis.verdict, diagnosis.verdict.probability
    names = verdict.ranked
    rows = np.arange(len(names))
    at = rows + 0.6 * (rows >= len(names) - len((NONE, UNKNOWN)))
    figure = Figure(figsize=(6.0, 0.8 + 0.21 * len(names)), layout="constrained")
    axes = figure.subplots()
    colours = [BLUE if name in verdict.named else "#b9cfe0" for name in names]
    axes.barh(at, [probability[name] for name in names], color=colours, height=0.72)
    for y, name in zip(at, names, strict=True):
        axes.text(probability[name] + 0.01, y, probability_text(probability[name]), va="center", **NOTE)
    axes.set_yticks(at, names)
    axes.tick_params(axis="y", length=0.0)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.08)
    axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_xlabel("probability")
    note = "dark: the answer; each of a pair has half of the pair's" if verdict.pairs else "dark: the answer"
    _title(figure, diagnosis, "Which effect explains the gap", note)
    return figure


def gaps(diagnosis: Diagnosis) -> Figure:
    """Draw the noise floor and the gap of the base, the adapted and the extended model, one panel per bone."""
    kinds: dict[GapKind, str] = {"base": "model as it is", "adapted": "adapted"}
    if diagnosis.best:
        kinds["with_effect"] = "with " + "\n+ ".join(diagnosis.best)
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
    _title(figure, diagnosis, "How far the gap shrinks", f"held out: {HELD_OUT}")
    return figure


def _draw_gaps(axes: Axes, gaps: HeldOutGaps, kinds: Sequence[GapKind], bone: str) -> None:
    floor = gaps.unseen["noise_floor"][bone].value
    if math.isfinite(floor):
        axes.axvline(floor, color="0.6", linewidth=0.8, linestyle=(0, (4, 2)), zorder=0)
    for levels, shift, style, label in (
        (gaps.unseen, -_APART, _HELD_OUT, "held out, 95 % interval"),
        (gaps.in_sample, _APART, _IN_SAMPLE, "in sample, 95 % interval"),
    ):
        each = [levels[kind][bone] for kind in kinds]
        values = np.array([[gap.value, gap.low, gap.high] for gap in each]).T
        at = np.arange(len(kinds)) + shift
        axes.hlines(at, values[1], values[2], color=style["color"], linewidth=1.4)
        axes.plot(values[0], at, label=label, **style)
    axes.set_ylim(-0.6, len(kinds) - 0.4)


def _title(figure: Figure, diagnosis: Diagnosis, title: str, note: str) -> None:
    figure.suptitle(
        f"{title}: {subjects_text(diagnosis)}, parameter set {diagnosis.model}\n", x=0.01, ha="left", fontsize=9.5
    )
    figure.text(0.01, 1.0 - 0.26 / figure.get_figheight(), note, ha="left", va="top", **NOTE)
