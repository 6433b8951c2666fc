# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Does an adaptation hold on a held-out motion, and which w is best then? Adapted to one motion, tested on another.

    python scripts/research/trust/study_heldout.py ../shared/motions/*.csv --model R6 --weights

Prints Markdown: for every subject with both motions, the gap (mean |simulated - measured|, degrees) on the second
motion of the unadapted model, of the model adapted to all motions, and of the model adapted to the first motion alone;
then the same with the motions exchanged. With --weights also the trade-off curve of w: the distance of the thorax
points to the ellipsoid against J, and the gap on each motion held out from the others.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from adapt import adapt_subjects
from adapt.cli import app as cli
from adapt.solvers.problems import problems_of
from adapt.solvers.rows import posture_rows
from adapt.tables.folds import Fold, motions_and_thirds
from adapt.trust.weight_choice import weight_table
from models import load_model
from motions import InputError, Motions, read_motions
from scripts.reporting import markdown

app = typer.Typer(add_completion=False)

GAPS = ("gap_before_deg", "gap_in_sample_deg", "gap_unseen_deg")


def gap_table(table: pd.DataFrame, fitted: str) -> str:
    """Format as Markdown one line per model and subject, then the mean of each model."""
    tested = table["held_out"].iloc[0]
    header = ["set", "subject", f"{tested}: before", "adapted to all", f"adapted to {fitted} alone"]
    header += ["scapula", "clavicle"]
    lines = []
    for model, rows in table.groupby("model", sort=False):
        for row in rows.to_dict("records"):
            lines.append([str(model), row["subject"], *cells(row)])
        means = rows.select_dtypes("number").mean()
        lines.append([str(model), f"mean of {len(rows)}", *cells(means)])
    return markdown(header, lines)


def cells(row) -> list[str]:
    """Format the gaps of all angles, then of each bone, before -> held out."""
    bones = [
        f"{row[f'{bone}_gap_before_deg']:.1f} -> {row[f'{bone}_gap_unseen_deg']:.1f}"
        for bone in ("scapula", "clavicle")
    ]
    return [*(f"{row[gap]:.2f}" for gap in GAPS), *bones]


def curve(table: pd.DataFrame) -> str:
    """Format the trade-off curve as Markdown."""
    header = ["set", "w", "thorax points, rms mm", "J, rms deg", "gap seen, deg", "gap unseen, deg", "at a bound"]
    lines = []
    for row in table.to_dict("records"):
        keys = ("thorax_points_rms_mm", "j_rms_deg", "gap_in_sample_deg", "gap_unseen_deg")
        weight = f"{row['weight']:g}" + (" (best)" if row["best"] else "")
        bound = f"{row['at_bound']} of {row['subjects_ok']}"
        lines.append([row["model"], weight, *(f"{row[key]:.2f}" for key in keys), bound])
    return markdown(header, lines)


ONLY = "only"
"""Kind of a fold in which one motion alone is adapted to."""


def one_motion_for_another(motions: Motions, fitted: str, tested: str) -> list[Fold]:
    """Make folds that adapt to one motion and test another, for every subject that has both."""
    found = []
    for subject, rows in enumerate(motions.rows_by_subject()):
        one, other = (rows[motions.motion[rows] == name] for name in (fitted, tested))
        if len(one) and len(other):
            found.append(Fold(ONLY, subject, tested, one, other))
    return found


@app.command()
def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files.")],
    model: Annotated[list[str] | None, typer.Option(help="Parameter set; repeatable. Default R2, R4 and R6.")] = None,
    one: Annotated[str, typer.Option(help="A motion.")] = "frontal_elevation",
    other: Annotated[str, typer.Option(help="Another one.")] = "sagittal_elevation",
    weights: Annotated[bool, typer.Option("--weights", help="Also the trade-off curve of w.")] = False,
) -> None:
    """Print, as Markdown, the gaps on a motion that was held out of the adaptation."""
    motions = read_motions(*files)
    names = model or ["R2", "R4", "R6"]
    models = [load_model(name) for name in names]
    for fitted, tested in ((one, other), (other, one)):
        folds = partial(one_motion_for_another, fitted=fitted, tested=tested)
        if not folds(motions):
            known = ", ".join(sorted(set(motions.motion.tolist())))
            raise InputError("--one", None, f"no subject has both '{one}' and '{other}'", f"The motions are {known}")
        heldout = adapt_subjects(motions, models, held_out=motions.subjects, folds=folds).heldout
        print(gap_table(heldout, fitted), end="\n\n")
    if weights:
        report = lambda stage: print(stage, file=sys.stderr, flush=True)  # noqa: E731
        batch = posture_rows(motions)
        data, folds = problems_of(batch, models), motions_and_thirds(motions)
        print(curve(weight_table(data, batch, names, folds, progress=report)))


if __name__ == "__main__":
    cli.main(app)
