# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Files of ``girdle muscles``: its tables, and a figure of muscle arms over the elevation of the arm."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from adapt.output.run_files import write_table
from adapt.output.svg import BLUE, GREEN, ORANGE, svg
from adapt.tables.muscle_tables import JOINTS, MuscleTables
from motions.files import atomic_write

FIGURE = "muscle_arms.svg"

_BIN_DEG = 15.0
"""Width of the bins of elevation; the postures of a bin are drawn as their mean."""

_MARGIN = 1.1
"""Upper limit of the axis, relative to the largest arm."""

_STYLES = {"before": "--", "after": "-"}

_COLOURS = {"sc": BLUE, "ac": ORANGE, "gh": GREEN}

_COLUMNS = 5
"""Columns of the figure; each panel shows one muscle."""

_PANEL, _LEFT, _RIGHT, _TOP, _BOTTOM = 1.9, 0.55, 0.1, 0.5, 0.5
"""Size of a panel with the space beside it, and of the margins, in inches. If matplotlib computed them,
this would take half of the drawing time."""


def write_muscles(folder: Path, found: MuscleTables) -> None:
    """Write ``muscle_arms.csv``, ``muscles.csv``, ``balance.csv``, ``muscle_lines.csv`` and ``muscle_arms.svg``."""
    tables = {"muscle_arms": found.arms, "muscles": found.muscles, "balance": found.balance}
    for name, table in (tables | {"muscle_lines": found.lines}).items():
        write_table(table, folder / f"{name}.csv")
    atomic_write(folder / FIGURE, svg(lambda: arms_figure(found.muscles)))


def arms_figure(muscles: pd.DataFrame) -> Figure:
    """Draw the arms of each muscle over elevation, before and after adaptation, as means over all subjects and sets."""
    names = list(muscles["muscle"].unique())
    rows = -(-len(names) // _COLUMNS)
    width, height = _PANEL * _COLUMNS, _PANEL * rows
    figure = Figure(figsize=(width, height))
    figure.subplots_adjust(_LEFT / width, _BOTTOM / height, 1.0 - _RIGHT / width, 1.0 - _TOP / height, 0.08, 0.18)
    grid = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    tops = [_draw(axes, muscles[muscles["muscle"] == name]) for axes, name in zip(grid, names, strict=False)]
    grid[0].set_ylim(0.0, _MARGIN * max(tops))
    for axes, name in zip(grid, names, strict=False):
        axes.set_title(name.replace("_", " "), loc="left", fontsize=8.0)
    for axes in grid[len(names) :]:
        axes.set_visible(False)
    figure.legend(handles=_legend(), frameon=False, loc="upper center", ncols=len(JOINTS) * len(_STYLES))
    figure.supylabel("arm, mm", fontsize=8.0, x=0.08 / width)
    figure.supxlabel("humerus elevation, degrees", fontsize=8.0, y=0.08 / height)
    return figure


def _legend() -> list[Line2D]:
    return [
        Line2D([], [], color=_COLOURS[joint], linestyle=style, label=f"about {joint.upper()}, {word}")
        for joint in JOINTS
        for word, style in _STYLES.items()
    ]


def _draw(axes: Axes, rows: pd.DataFrame) -> float:
    """Draw one muscle about the joints that it crosses, in both states; return the largest arm drawn."""
    top = 0.0
    place = np.round(rows["humerus_elevation_deg"] / _BIN_DEG) * _BIN_DEG
    for joint in JOINTS:
        for word, style in _STYLES.items():
            mean = rows.groupby(place)[f"about_{joint}_{word}_mm"].mean()
            largest = float(np.nan_to_num(mean.to_numpy(float)).max(initial=0.0))
            if largest > 0.0:
                axes.plot(mean.index, mean, color=_COLOURS[joint], linestyle=style)
                top = max(top, largest)
    return top
