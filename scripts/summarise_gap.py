# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""What `girdle adapt` achieved, in one table: the README's "Measured results" from the folder it wrote.

    python scripts/summarise_gap.py results

Gaps are mean |simulated - measured| in degrees, before -> after: the mean over subjects and the three angles of a bone,
in brackets on what was held out from the adaptation, and the largest of one angle of one subject. Only what ended ok
counts, and the last lines say how much did.
"""

from collections.abc import Collection
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from adapt import cli, status
from adapt.tables import ALL_MOTIONS, HELD_OUT
from models.girdle import ADAPTED
from motions import ANGLES, InputError

BONES = {"scapula": ANGLES[3:], "clavicle": ANGLES[:3]}

NAMES = ("model", "subject", "motion")

app = typer.Typer(add_completion=False)


def read(folder: Path, name: str, columns: Collection[str] = ()) -> pd.DataFrame:
    """One table of the folder, with these columns; names stay text, whatever they look like."""
    path = folder / name
    try:
        table = pd.read_csv(path, converters=dict.fromkeys(NAMES, str))
    except (OSError, ValueError) as error:
        cause = "this is no table that can be read"
        raise InputError(str(path), None, cause, "Name a folder that `girdle adapt` wrote") from error
    if missing := [column for column in columns if column not in table]:
        raise InputError(str(path), None, f"it has no column {missing[0]}", "Run `girdle adapt` anew")
    return table


def gap_cells(summary: pd.DataFrame, model: str) -> list[str]:
    """Mean (with that held out) and max of each bone, before -> after, from the statistics rows of summary.csv."""
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
    """Mean over subjects of the distance between the ellipsoid's centre and the model's own."""
    return float(
        np.hypot(*(parameters[f"{name}_mm"] - parameters[f"{name}_mm_prior"] for name in ("M_y", "M_z"))).mean()
    )


def bound_cell(parameters: pd.DataFrame) -> str:
    """How many adaptations have a parameter at a bound and, in brackets, how often each is, most first."""
    at = parameters[[f"{name}_mm_at_bound" for name in ADAPTED]].set_axis(ADAPTED, axis=1) == 1
    counts = at.sum().sort_values(ascending=False, kind="stable")
    which = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    return f"{at.any(axis=1).sum()} of {len(at)}" + (f" ({which})" if which else "")


def markdown(summary: pd.DataFrame, parameters: pd.DataFrame) -> str:
    """A line a parameter set."""
    header = ["set", "scapula mean (held out)", "scapula max", "clavicle mean (held out)", "clavicle max"]
    header += ["centre moved (mean)", "subjects with a parameter at a bound"]
    rows = [header, ["---"] * len(header)]
    good = parameters[parameters["status"] == status.OK]
    for model in dict.fromkeys(parameters["model"]):
        mine = good[good["model"] == model]
        gaps = gap_cells(summary, model)
        rows.append([model, *gaps, f"{centre_moved_mm(mine):.0f} mm", bound_cell(mine)])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def endings(fits: pd.DataFrame, parameters: pd.DataFrame) -> str:
    """How the adaptations and the posture fits ended, and what ended at a bound in all sets together."""
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
    summary = read(folder, "summary.csv", HELD_OUT.values())
    parameters, fits = (read(folder, f"{name}.csv") for name in ("parameters", "fits"))
    print(f"{markdown(summary, parameters)}\n\n{endings(fits, parameters)}")


if __name__ == "__main__":
    cli.main(app)
