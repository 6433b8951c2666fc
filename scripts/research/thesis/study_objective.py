"""Which reading of E does the thesis use? Every choice that it leaves open, varied alone, against Tables 6.1-6.6.

    python scripts/research/thesis/study_objective.py ../shared/motions/*.csv \
        --leave-out mean_ludewig2009 --leave-out mean_oki2012

As in the thesis, R2, R4 and R6 are adapted to abduction and flexion, and the gap is that in abduction. ``scores``
defines the scores; 0 is the thesis. Prints Markdown.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from adapt.cli import app as cli
from adapt.solvers.objective import DEFAULT_OBJECTIVE, OBJECTIVES, WEIGHT
from adapt.trust.thesis import printed
from models.adapted_parameters import ADAPTED
from motions import ANGLES
from scripts.reporting import markdown
from scripts.research.thesis.outcomes import Outcome, Study, outcomes, persons, prepare
from scripts.research.thesis.scores import TERMS, WITHOUT_CONOID, beats, complete, scores
from scripts.research.thesis.variants import AXIAL, BOUNDS, LEFT_OUT, POINTS, SIDES, Variant

WEIGHTS = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 1e4)
"""Weights; 0 is D alone. From 1e4 to 1e5 no gap falls by another 0.1 degrees: the bounds are active and J dominates."""

_CONOID, _AXIAL = ADAPTED.index("conoid_length"), ANGLES.index("clavicle_x")

HEADER = [
    "choice",
    "variant",
    "sum",
    *TERMS,
    "sum without the conoid",
    "lower than shipped",
    "scapula, deg",
    "clavicle y, z, deg",
]
HEADER += ["clavicle x, deg", "A_z, mm", "conoid, mm", "at a bound", "not ok"]

app = typer.Typer(add_completion=False)


def choices() -> dict[str, dict[str, Variant]]:
    """Return the variants of each choice by their label."""
    return {
        "reading": {name: Variant(objective=name) for name, one in OBJECTIVES.items() if not one.landmarks},
        "weight": {f"w = {weight:g}": Variant(weight=weight) for weight in WEIGHTS},
        "angles in J": {name: Variant(axial=name) for name in AXIAL},
        "five angles, reading": {
            # Iterated readings would take another ten minutes: with five angles E is often flat in the conoid length.
            name: Variant(objective=name, axial=LEFT_OUT)
            for name, one in OBJECTIVES.items()
            if one.form == "squares" and name != DEFAULT_OBJECTIVE and not one.landmarks
        },
        "thorax points": {name: Variant(points=name) for name in POINTS},
        "bounds": {name: Variant(bounds=name) for name in BOUNDS},
        "distance of TS, AI": {name: Variant(distances=name) for name in SIDES},
    }


def run(study: Study, progress: Callable[[str], None]) -> dict[Variant, dict[str, Outcome]]:
    """Run every variant once, even if it belongs to several choices."""
    found: dict[Variant, dict[str, Outcome]] = {}
    for choice, variants in choices().items():
        for label, variant in variants.items():
            if variant not in found:
                progress(f"{choice}: {label}")
                found[variant] = outcomes(study, variant)
    return found


def score_table(found: dict[Variant, dict[str, Outcome]]) -> str:
    """Tabulate the variants, one line each, in the order of the choices; the shipped one only once, first."""
    shipped = Variant()
    lines = [line("as shipped", "", found[shipped], found[shipped])]
    for choice, variants in choices().items():
        lines += [
            line(choice, label, found[variant], found[shipped])
            for label, variant in variants.items()
            if variant != shipped
        ]
    return markdown(HEADER, [thesis_line(), *lines])


def thesis_line() -> list[str]:
    """Format the line of the published adaptations."""
    before, after = (printed.gaps_deg(adapted) for adapted in (False, True))
    change = (printed.adapted_mm() - printed.own_mm())[:, _CONOID]
    cells = [arrow(before[:, part].mean(), after[:, part].mean()) for part in _PARTS]
    A_z = printed.adapted_mm()[:, ADAPTED.index("A_z")]
    return ["thesis", "", *["0"] * (2 + len(TERMS)), "", *cells, listed(A_z, ".0f"), listed(change, "+.0f"), "", ""]


_PARTS = (slice(3, 6), slice(0, 2), slice(_AXIAL, _AXIAL + 1))
"""Groups of angles: scapula, clavicle without axial rotation, axial rotation."""


def line(choice: str, label: str, found: dict[str, Outcome], shipped: dict[str, Outcome]) -> list[str]:
    """Format scores, mean gaps, the three sets' A_z and change of the conoid, and counts of bounds and failures."""
    good = complete(found)
    sets = [good[name] for name in printed.SETS]
    numbers = scores(good)
    same = all(one.ok.all() for one in (*found.values(), *shipped.values()))
    lower = f"{100 * beats(found, shipped):.0f} %" if same and found is not shipped else ""
    gaps = [
        arrow(*(sum(getattr(one, state)[part].mean() for one in sets) / len(sets) for state in _STATES))
        for part in _PARTS
    ]
    return [
        choice,
        label,
        f"{numbers.sum():.2f}",
        *(f"{number:.2f}" for number in numbers),
        f"{scores(good, WITHOUT_CONOID).sum():.2f}",
        lower,
        *gaps,
        listed([one.theta_mm[ADAPTED.index("A_z")].mean() for one in sets], ".0f"),
        listed([one.shift_mm[_CONOID].mean() for one in sets], "+.0f"),
        str(sum(int(one.at_bound.any(axis=0).sum()) for one in sets)),
        str(sum(int((~one.ok).sum()) for one in found.values())),
    ]


_STATES = ("before_deg", "after_deg")


def arrow(before: float, after: float) -> str:
    """Format a change as '6.0 -> 3.0'."""
    return f"{before:.1f} -> {after:.1f}"


def listed(values, form: str) -> str:
    """Format a number of each of the three sets."""
    return ", ".join(f"{value:{form}}" for value in values)


@app.command()
def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files.")],
    leave_out: Annotated[list[str] | None, typer.Option(help="Subject that is no person; repeatable.")] = None,
) -> None:
    """Vary the objective of the adaptation, one choice at a time, and score it against the thesis. Markdown."""
    study = prepare(persons(files, leave_out or []), printed.SETS)
    found = run(study, lambda stage: print(stage, file=sys.stderr, flush=True))
    print(
        f"{len(study.subjects)} subjects with R2, R4 and R6, adapted to {study.data.counted[:, 0].sum()} postures (the "
        f"first); as shipped: reading {DEFAULT_OBJECTIVE}, w = {WEIGHT:g}.\n\n{score_table(found)}"
    )


if __name__ == "__main__":
    cli.main(app)
