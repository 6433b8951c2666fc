"""Figures of a diagnosis: gap budget, inclusion probabilities, location of the gap, size of the gap at each stage.

Lightness carries the same information as colour, so that all figures can be read in grey.
"""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adapt.diagnosis.result import ALL, Diagnosis, GapKind, Gaps
from adapt.diagnosis.texts.wording import held_out_kind_text, held_out_text, subjects_text
from adapt.output.plots import draw_budget, draw_heat_map, draw_inclusion, elevation_bins
from adapt.output.svg import BLUE, NOTE, svg
from motions.table import BONES

FIGURES = ("budget.svg", "inclusion.svg", "gap_heatmap.svg", "gaps.svg")

_MOTIONS_A_ROW = 3

_PANELS = (ALL, *BONES)
_HELD_OUT = {"color": BLUE, "marker": "o", "markersize": 5.0, "linestyle": "none"}
_IN_SAMPLE = {**_HELD_OUT, "color": "0.45", "markerfacecolor": "white", "markersize": 4.5}
_APART = 0.16
"""Offset in rows: held-out values are drawn above the middle of their row, in-sample values below."""


def figures(diagnosis: Diagnosis) -> dict[str, str]:
    """Draw the figures of one model's diagnosis; return SVG text by file name."""
    drawings = (budget, inclusion, gap_heatmap, gaps)
    return {name: svg(partial(draw, diagnosis)) for name, draw in zip(FIGURES, drawings, strict=True)}


def gap_heatmap(diagnosis: Diagnosis) -> Figure:
    """Draw the mean absolute gap of the adapted model by angle and elevation, one panel per motion."""
    motions = sorted({cell.motion for cell in diagnosis.where.cells})
    bins = len(elevation_bins(diagnosis))
    columns = min(len(motions), _MOTIONS_A_ROW)
    rows = math.ceil(len(motions) / columns)
    figure = Figure(figsize=(2.2 + 0.42 * bins * columns, 0.9 + 2.2 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.flat)
    for axes in panels[len(motions) :]:
        axes.set_visible(False)
    for number, (axes, motion) in enumerate(zip(panels, motions, strict=False)):
        draw_heat_map(axes, diagnosis, motion)
        axes.set_title(motion, loc="left")
        axes.tick_params(labelbottom=number + columns >= len(motions))
    figure.colorbar(panels[0].images[0], ax=grid, label="mean |gap|, degrees", shrink=0.8, pad=0.02)
    figure.supxlabel("humerus elevation, degrees", fontsize=8.0)
    note = "outlined: largest shares beyond noise; hatched: not measured"
    _title(figure, diagnosis, "Where the gap is after adaptation", note)
    return figure


def budget(diagnosis: Diagnosis) -> Figure:
    """Draw the gap budget (:func:`adapt.output.plots.draw_budget`)."""
    figure = Figure(figsize=(6.0, 1.1 + 0.27 * len(diagnosis.budget)), layout="constrained")
    draw_budget(figure.subplots(), diagnosis)
    _title(figure, diagnosis, "What takes the gap away", "lines: 95 % intervals; +: a cause added to all above it")
    return figure


def inclusion(diagnosis: Diagnosis) -> Figure:
    """Draw the inclusion probabilities (:func:`adapt.output.plots.draw_inclusion`)."""
    figure = Figure(figsize=(6.0, 1.0 + 0.21 * len(diagnosis.verdict.inclusion)), layout="constrained")
    draw_inclusion(figure.subplots(), diagnosis)
    named = any(cause.names for cause in diagnosis.verdict.causes)
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
        (gaps.hardest, -_APART, _HELD_OUT, f"{held_out_kind_text(gaps)}, 95 % interval"),
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
