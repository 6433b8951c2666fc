# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""The files of ``girdle muscles``: its tables, and muscle arms over the elevation of the arm."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adapt.output.run_files import write_table
from adapt.output.svg import BLUE, ORANGE, svg
from adapt.tables.muscle_tables import JOINTS, MuscleTables
from motions.files import atomic_write

FIGURE = "muscle_arms.svg"

_BIN_DEG = 15.0
"""Of elevation: postures in it are drawn as their mean."""

_MARGIN = 1.1
"""Above the largest arm."""

_STYLES = {"before": {"color": ORANGE, "linestyle": "--"}, "after": {"color": BLUE}}


def write_muscles(folder: Path, found: MuscleTables) -> None:
    """Write ``muscle_arms.csv``, ``muscles.csv``, ``balance.csv``, ``muscle_lines.csv`` and ``muscle_arms.svg``."""
    tables = {"muscle_arms": found.arms, "muscles": found.muscles, "balance": found.balance}
    for name, table in (tables | {"muscle_lines": found.lines}).items():
        write_table(table, folder / f"{name}.csv")
    atomic_write(folder / FIGURE, svg(lambda: arms_figure(found.muscles)))


def arms_figure(muscles: pd.DataFrame) -> Figure:
    """Draw the arms of each muscle over elevation, means of all subjects and sets, before and after adaptation."""
    names = list(muscles["muscle"].unique())
    figure = Figure(figsize=(1.9 * len(names), 4.2), layout="constrained")
    grid = figure.subplots(len(JOINTS), len(names), sharex=True, sharey="row", squeeze=False)
    for row, joint in zip(grid, JOINTS, strict=True):
        row[0].set_ylabel(f"arm about {joint.upper()}, mm")
        tops = [_draw(axes, muscles[muscles["muscle"] == name], joint) for axes, name in zip(row, names, strict=True)]
        row[0].set_ylim(0.0, _MARGIN * max(tops))
    for axes, name in zip(grid[0], names, strict=True):
        axes.set_title(name.replace("_", " "), loc="left")
    grid[0][0].legend(frameon=False)
    figure.supxlabel("humerus elevation, degrees", fontsize=8.0)
    return figure


def _draw(axes: Axes, rows: pd.DataFrame, joint: str) -> float:
    """Draw one muscle in both states; the largest arm drawn."""
    top = 0.0
    place = np.round(rows["humerus_elevation_deg"] / _BIN_DEG) * _BIN_DEG
    for word, style in _STYLES.items():
        mean = rows.groupby(place)[f"about_{joint}_{word}_mm"].mean()
        axes.plot(mean.index, mean, label=word, **style)
        top = max(top, float(np.nanmax(mean)))
    return top
