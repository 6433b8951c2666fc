# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Thesis and girdle side by side: Tables 3.4, 3.5 and 6.1-6.6, of measured motions.

The tables of docs/research/thesis.md.

    python scripts/research/thesis/compare_thesis.py ../shared/motions/*.csv --mean mean_ludewig2009 --mean mean_oki2012

Tables 3.4 and 3.5 are of mean motions (--mean), the sets as they are. Tables 6.1-6.6 are of the other subjects, adapted
to abduction and flexion and looked at in abduction, as shipped. Prints Markdown.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from jaxtyping import Float

from adapt import fit_postures
from adapt.cli import app as cli
from adapt.solvers import status
from adapt.tables.results import DIFFERENCES
from models import load_model
from models.adapted_parameters import ADAPTED
from motions import ANGLES, read_motions
from scripts.reporting import check_known, markdown
from scripts.research.thesis import printed
from scripts.research.thesis.outcomes import ABDUCTION, FLEXION, Outcome, outcomes, persons, prepare
from scripts.research.thesis.scores import complete
from scripts.research.thesis.variants import Variant

MEAN_MOTIONS = {"Table 3.4": ABDUCTION, "Table 3.5": FLEXION}

FIVE = tuple(angle for angle in ANGLES if angle != "clavicle_x")

Gaps = Float[np.ndarray, "sets angles subjects"]

app = typer.Typer(add_completion=False)


def mean_motion_table(fits, name: str, subjects: list[str]) -> str:
    """Table 3.4 or 3.5, mean |simulated - measured| (SD over postures): as printed, then ours of each subject."""
    table, rows = printed.tables()[name], []
    good = fits[(fits["status"] == status.OK) & (fits["motion"] == MEAN_MOTIONS[name])]
    for model in printed.SETS:
        mean, sd = (table.values[:, table.columns.index(column)] for column in (model, f"{model} SD"))
        rows.append([model, "thesis", *with_sd(mean, sd), f"{mean.mean():.1f}"])
        for subject in subjects:
            off = good[(good["subject"] == subject) & (good["model"] == model)][DIFFERENCES].abs()
            mean, sd = off.mean().to_numpy(), off.std().to_numpy()
            rows.append([model, subject, *with_sd(mean, sd), f"{mean.mean():.1f}"])
    return markdown(["set", f"{name}, degrees", *ANGLES, "all"], rows)


def with_sd(means, sds) -> list[str]:
    """'2.9 (1.6)' of each."""
    return [f"{mean:.1f} ({sd:.1f})" for mean, sd in zip(means, sds, strict=True)]


def gap_table(ours: dict[bool, Gaps]) -> str:
    """Tables 6.1-6.4 without their subjects: mean (SD), max of each angle."""
    rows = []
    for k, name in enumerate(printed.SETS):
        for adapted, state in ((False, "before"), (True, "after")):
            for who, gaps in (("thesis", printed.gaps_deg(adapted)), ("girdle", ours[adapted])):
                cells = with_sd(gaps[k].mean(axis=1), gaps[k].std(axis=1, ddof=1))
                cells = [f"{cell}, {most:.1f}" for cell, most in zip(cells, gaps[k].max(axis=1), strict=True)]
                rows.append([name, state, who, *cells])
    return markdown(["set", "state", "Tables 6.1-6.4, degrees", *ANGLES], rows)


def parameter_table(found: dict[str, Outcome]) -> str:
    """Tables 6.6 and 6.5: own parameters, adapted mean (SD over subjects), mm."""
    rows = []
    for k, name in enumerate(printed.SETS):
        one = found[name]
        rows.append([name, "6.6, thesis", *(f"{x:.0f}" for x in printed.own_mm()[k])])
        rows.append([name, "6.6, girdle", *(f"{x:.0f}" for x in one.own_mm[:, 0])])
        thesis = printed.adapted_mm()[k], printed.sd_mm()[k]
        for who, mean, sd in (("thesis", *thesis), ("girdle", one.theta_mm.mean(axis=1), one.sd_mm)):
            cells = [f"{m:.0f} ({s:.0f})" for m, s in zip(mean, sd, strict=True)]
            rows.append([name, f"6.5, {who}", *cells])
    return markdown(["set", "Table, mm", *ADAPTED], rows)


def summary_table(ours: dict[bool, Gaps]) -> str:
    """What the thesis concludes from Tables 6.1-6.4, and two counts more."""
    thesis = {adapted: printed.gaps_deg(adapted) for adapted in (False, True)}
    rows = [
        [label, *(f"{measure(gaps[False]):.1f} -> {measure(gaps[True]):.1f}" for gaps in (thesis, ours))]
        for label, measure in _MEASURES.items()
    ]
    cells = [gaps[True] < gaps[False] for gaps in (thesis, ours)]
    rows.append(
        [
            "cells of set, subject, angle that shrink",
            *(f"{x.sum()} of {x.size} ({100 * x.mean():.0f} %)" for x in cells),
        ]
    )
    return markdown(["over sets and subjects, degrees", "thesis", "girdle"], rows)


_MEASURES = {
    "scapula, mean": lambda gaps: gaps[:, 3:].mean(),
    "scapula, max": lambda gaps: gaps[:, 3:].max(),
    "clavicle, mean": lambda gaps: gaps[:, :3].mean(),
    "clavicle without axial rotation, mean": lambda gaps: gaps[:, :2].mean(),
    "clavicle, max": lambda gaps: gaps[:, :3].max(),
}


def least_j_table(ours: dict[bool, Gaps]) -> str:
    """The least mean(J) of abduction that the mean gaps allow, and of how many subjects it grows."""
    rows = []
    for label, angles in (("six angles", ANGLES), ("five, without the axial rotation", FIVE)):
        for who, gaps in (("thesis", {a: printed.gaps_deg(a) for a in (False, True)}), ("girdle", ours)):
            before, after = (printed.least_mean_j_deg2(gaps[adapted], angles) for adapted in (False, True))
            cells = [
                f"{b.mean():.0f} -> {a.mean():.0f} ({(a > b).sum()} of {len(a)})"
                for b, a in zip(before, after, strict=True)
            ]
            rows.append([label, who, *cells])
    return markdown(["J of", "deg^2 (subjects in whom it grows)", *printed.SETS], rows)


@app.command()
def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files.")],
    mean: Annotated[list[str] | None, typer.Option(help="Subject that is a mean motion; repeatable.")] = None,
) -> None:
    """Print, as Markdown, Tables 3.4, 3.5 and 6.1-6.6 of the thesis beside ours."""
    motions, means = read_motions(*files), mean or []
    check_known(means, motions.subjects, "subject")
    study = prepare(persons(files, means), printed.SETS)
    found = complete(outcomes(study, Variant()))
    sets = [found[name] for name in printed.SETS]
    ours = {False: np.array([one.before_deg for one in sets]), True: np.array([one.after_deg for one in sets])}
    if means:
        chosen = motions.select(np.isin(motions.subject, means))
        fits = fit_postures(chosen, [load_model(name) for name in printed.SETS]).fits
        for name in MEAN_MOTIONS:
            print(mean_motion_table(fits, name, means), end="\n\n")
    print(f"{len(sets[0].ok)} of {len(study.subjects)} subjects; thesis: 10.\n")
    print(gap_table(ours), summary_table(ours), least_j_table(ours), parameter_table(found), sep="\n\n")


if __name__ == "__main__":
    cli.main(app)
