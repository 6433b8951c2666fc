# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Draw one subject before and after adaptation from the fits.csv that `girdle adapt` writes.

Six panels, scapula above clavicle, over humerus elevation: measured angles as dots, simulated angles as a dashed line
before adaptation and a solid line after it. All panels span the same number of degrees, so that gaps compare across
panels. Where a summary.csv is beside the table, the held-out gap of each bone on the motion is printed too. The same
tables give the same bytes.

    python scripts/draw_before_after.py results/fits.csv --subject NAME --model R2 --out before_after.svg
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from adapt.cli import app as cli
from adapt.output.run_files import prepare_folder
from adapt.output.svg import BLUE, NOTE, ORANGE, svg
from adapt.solvers import status
from adapt.tables.results import ALL_MOTIONS, HELD_OUT
from motions import InputError
from motions.files import atomic_write
from scripts.reporting import NAMES, read_table

PANELS = {
    "scapula_y": "Protraction",
    "scapula_z": "Lateral rotation",
    "scapula_x": "Tipping (+ back)",
    "clavicle_y": "Protraction",
    "clavicle_z": "Elevation",
    "clavicle_x": "Axial rotation (+ back)",
}
"""The angles in reading order, each named by its positive direction."""

BONES = ("scapula", "clavicle")
"""Bones, one per row of panels."""

BEFORE = {"color": ORANGE, "linestyle": (0, (4, 2)), "label": "simulated, before adaptation"}
AFTER = {"color": BLUE, "linestyle": "-", "label": "simulated, after adaptation"}
MEASURED = {"color": "black", "linestyle": "none", "marker": "o", "markersize": 3.5, "label": "measured"}
"""Styles of the three curves, which differ in line style as well as in colour."""

TICK_DEG = 10
ELEVATION_TICK_DEG = 30
MARGIN_DEG = 2.0
"""Margin above and below the curves."""

app = typer.Typer(add_completion=False)


def chosen(fits: pd.DataFrame, column: str, wanted: str | None, file: str) -> pd.DataFrame:
    """Select the rows with this name, or with the first name of the table if ``wanted`` is None."""
    known = list(dict.fromkeys(fits[column]))
    if wanted is not None and wanted not in known:
        raise InputError(file, None, f"there is no {column} '{wanted}'", f"Use one of {', '.join(known)}")
    return fits[fits[column] == (wanted or known[0])]


def held_out_deg(summary: Path, model: str, subject: str, motion: str) -> dict[str, float]:
    """Read the held-out gap of each bone on the motion, as far as the summary has it."""
    if not summary.exists():
        return {}
    table = read_table(summary, (*NAMES, "adapted", *HELD_OUT.values()))
    mine = table[(table["model"] == model) & (table["subject"] == subject) & (table["adapted"] == 1)]
    of_motion, of_all = (mine[mine["motion"] == name] for name in (motion, ALL_MOTIONS))
    row = (of_motion if len(of_motion) else of_all)[list(HELD_OUT.values())].mean()
    return {bone: row[HELD_OUT[bone]] for bone in BONES if pd.notna(row[HELD_OUT[bone]])}


def draw_panel(axes: Axes, rows: pd.DataFrame, angle: str) -> None:
    """Draw one angle with its mean |simulated - measured| before and after. Failed fits leave a gap in the line."""
    rows = rows.sort_values("posture")
    elevation, measured = rows["humerus_elevation_deg"], rows[f"{angle}_measured_deg"]
    simulated = rows[f"{angle}_simulated_deg"].where(rows["status"] == status.OK)
    before, after = rows["adapted"] == 0, rows["adapted"] == 1
    axes.plot(elevation[after], measured[after], zorder=3, **MEASURED)
    axes.plot(elevation[before], simulated[before], **BEFORE)
    axes.plot(elevation[after], simulated[after], **AFTER)
    gap = (simulated - measured).abs()
    axes.set_title(PANELS[angle], loc="left")
    if measured.isna().all():
        axes.set_title("not measured", loc="right", **NOTE)
    else:
        axes.set_title(f"{gap[before].mean():.1f}° → {gap[after].mean():.1f}°", loc="right", **NOTE)


def share_span(panels: list[Axes]) -> None:
    """Give every panel the same height in degrees, about the middle of its own curves."""
    extents = [axes.dataLim.intervaly for axes in panels]
    half = max(high - low for low, high in extents) / 2.0 + MARGIN_DEG
    for axes, (low, high) in zip(panels, extents, strict=True):
        middle = (low + high) / 2.0
        axes.set_ylim(middle - half, middle + half)
        ticks = range(math.ceil((middle - half) / TICK_DEG), math.floor((middle + half) / TICK_DEG) + 1)
        axes.set_yticks([TICK_DEG * tick for tick in ticks])


def draw(rows: pd.DataFrame, title: str, gap_held_out_deg: Mapping[str, float]) -> Figure:
    """Draw the figure of one subject, model and motion in the current style, with the held-out gap of each bone."""
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    grid = figure.subplots(2, 3, sharex=True)
    panels = list(grid.flat)
    for axes, angle in zip(panels, PANELS, strict=True):
        draw_panel(axes, rows, angle)
    share_span(panels)
    for axes, bone in zip(grid[:, 0], BONES, strict=True):
        axes.set_ylabel(f"{bone} to thorax, degrees")
    for axes in grid[-1]:
        axes.set_xlabel("humerus elevation, degrees")
        axes.xaxis.set_major_locator(MultipleLocator(ELEVATION_TICK_DEG))
    figure.suptitle(f"{title}\n", x=0.01, ha="left", fontsize=10.0)  # the second line is for the note
    held_out = ", ".join(f"{bone} {gap:.1f}°" for bone, gap in gap_held_out_deg.items())
    note = "grey: mean |simulated − measured|, before → after" + (f"; held out: {held_out}" if held_out else "")
    figure.text(0.01, 0.95, note, ha="left", va="top", **NOTE)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


@app.command()
def main(
    fits: Annotated[Path, typer.Argument(metavar="fits.csv", help="Table of fits that `girdle adapt` wrote.")],
    out: Annotated[Path, typer.Option("--out", help="The SVG to write.")],
    subject: Annotated[str | None, typer.Option(help="Name of a subject. Default: the first.")] = None,
    model: Annotated[str | None, typer.Option(help="Name of a parameter set. Default: the first.")] = None,
    motion: Annotated[str | None, typer.Option(help="Name of a motion of the subject. Default: its first.")] = None,
    title: Annotated[str | None, typer.Option(help="Who this is. Default: the subject's name.")] = None,
) -> None:
    """Draw the measured and simulated angles of one subject over humerus elevation, before and after adaptation."""
    rows = read_table(fits, (*NAMES, "adapted", "status"))
    for column, wanted in (("model", model), ("subject", subject), ("motion", motion)):
        rows = chosen(rows, column, wanted, str(fits))
    if set(rows["adapted"]) != {0, 1}:
        raise InputError(str(fits), None, "there are no fits before and after adaptation", "Run `girdle adapt`")
    first = rows.iloc[0]
    text = f"{title or first['subject']}, {first['motion']}, parameter set {first['model']}"
    gap_held_out_deg = held_out_deg(fits.parent / "summary.csv", *(first[name] for name in NAMES))
    prepare_folder(out.parent)
    atomic_write(out, svg(lambda: draw(rows, text, gap_held_out_deg)))


if __name__ == "__main__":
    cli.main(app)
