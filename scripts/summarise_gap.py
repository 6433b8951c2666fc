# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Summarise a run of `girdle adapt` in one table, as in docs/research/trust.md, from the folder that it wrote.

    python scripts/summarise_gap.py results

Gaps are mean |simulated - measured| in degrees, before -> after: the mean over subjects and the three angles of a bone,
with the held-out gap in brackets, and the largest gap of one angle of one subject. Only fits with status ok count; the
last lines say how many they are.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from adapt.cli import app as cli
from adapt.solvers import status
from adapt.tables.results import ALL_MOTIONS, HELD_OUT
from models.adapted_parameters import ADAPTED
from motions import ANGLES
from scripts.reporting import markdown, read_table

BONES = {"scapula": ANGLES[3:], "clavicle": ANGLES[:3]}

app = typer.Typer(add_completion=False)


def gap_cells(summary: pd.DataFrame, model: str) -> list[str]:
    """Format mean gap (with the held-out gap) and largest gap of each bone, before -> after, from summary.csv."""
    mine = summary[(summary["model"] == model) & (summary["motion"] == ALL_MOTIONS)]
    mean, most = (mine[mine["subject"] == row].set_index("adapted") for row in ("mean", "max"))
    cells = []
    for bone, angles in BONES.items():
        largest = most[[f"{angle}_deg" for angle in angles]].max(axis=1)
        all_gaps, most_gaps = (
            " -> ".join(f"{gap[state]:.1f}" for state in (0, 1)) for gap in (mean[f"{bone}_deg"], largest)
        )
        cells += [f"{all_gaps} ({mean[HELD_OUT[bone]][1]:.1f})", most_gaps]
    return cells


def centre_moved_mm(parameters: pd.DataFrame) -> float:
    """Compute the mean over subjects of the distance between the adapted and the model's own ellipsoid centre."""
    return float(
        np.hypot(*(parameters[f"{name}_mm"] - parameters[f"{name}_mm_model"] for name in ("M_y", "M_z"))).mean()
    )


def bound_cell(parameters: pd.DataFrame) -> str:
    """Count the adaptations with a parameter at a bound and, in brackets, each such parameter, most frequent first."""
    at = parameters[[f"{name}_mm_at_bound" for name in ADAPTED]].set_axis(ADAPTED, axis=1) == 1
    counts = at.sum().sort_values(ascending=False, kind="stable")
    which = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    return f"{at.any(axis=1).sum()} of {len(at)}" + (f" ({which})" if which else "")


def gap_table(summary: pd.DataFrame, parameters: pd.DataFrame) -> str:
    """Tabulate the gaps, one line per parameter set."""
    header = ["set", "scapula mean (held out)", "scapula max", "clavicle mean (held out)", "clavicle max"]
    header += ["centre moved (mean)", "subjects with a parameter at a bound"]
    rows = []
    good = parameters[parameters["status"] == status.OK]
    for model in dict.fromkeys(parameters["model"]):
        mine = good[good["model"] == model]
        gaps = gap_cells(summary, model)
        rows.append([model, *gaps, f"{centre_moved_mm(mine):.0f} mm", bound_cell(mine)])
    return markdown(header, rows)


def endings(fits: pd.DataFrame, parameters: pd.DataFrame) -> str:
    """Summarise the statuses of adaptations and posture fits, and the parameters at a bound over all sets."""
    adapted, fitted = (table["status"] == status.OK for table in (parameters, fits))
    return (
        f"ok: {adapted.sum()} of {len(adapted)} adaptations, {fitted.sum()} of {len(fitted)} posture fits; "
        f"{fits['jump'].sum()} jumps along a motion. With a parameter at a bound: {bound_cell(parameters[adapted])}."
    )


@app.command()
def main(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `girdle adapt` wrote.")],
) -> None:
    """Print, as Markdown, the gap before and after adaptation, how far the ellipsoid went and what is at a bound."""
    summary = read_table(folder / "summary.csv", HELD_OUT.values())
    parameters, fits = (read_table(folder / f"{name}.csv") for name in ("parameters", "fits"))
    print(f"{gap_table(summary, parameters)}\n\n{endings(fits, parameters)}")


if __name__ == "__main__":
    cli.main(app)
