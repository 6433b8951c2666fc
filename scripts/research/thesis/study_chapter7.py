"""Questions of the thesis's chapter 7 that measured motions can answer.

    python scripts/research/thesis/study_chapter7.py ../shared/motions/*.csv --mean mean_ludewig2009 --mean mean_oki2012

Prints Markdown: (a) is the distance of TS and AI to the thorax constant; (b) a rhythm, or scapula and clavicle
measured; (c) an ellipsoid for each posture. In brackets are 95 % t intervals over persons. Left and right of one person
are one; group means (--mean) are none and stand beside.
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from adapt.cli import app as cli
from adapt.diagnosis.fit.noise import estimate_noise
from models import load_model
from motions import read_motions
from scripts.reporting import check_known, markdown
from scripts.research.thesis.chapter7.distance import distance_table
from scripts.research.thesis.chapter7.ellipsoids import SIZE_HEADER, UNSEEN_HEADER, size_rows, unseen_rows
from scripts.research.thesis.chapter7.rhythm import better_by_measuring, bias_table, rhythm_table
from scripts.research.thesis.chapter7.shoulders import AdaptedRows, Persons, adapt_rows, whole, with_noise_alone
from scripts.research.thesis.printed import SETS, sd_mm

SEED = 1999

MEASURED, SIMULATED = "measured", "simulated, noise alone"

app = typer.Typer(add_completion=False)


def ellipsoid_tables(data: list[AdaptedRows], persons: Persons, noise_deg: float) -> str:
    """Size and smoothness of the change, and what it predicts; then of simulated measurements with noise alone.

    Simulated, the size is that of the change from the parameters that the simulation has; the gaps on motions held out
    are of parameters adapted anew."""
    sizes, unseen = [], []
    for one in data:
        of_table_mm = sd_mm()[SETS.index(one.model.name)]
        noisy = with_noise_alone(one, noise_deg, SEED)
        worlds = {MEASURED: (one, one), SIMULATED: (replace(one, motions=noisy), adapt_rows(noisy, one.model))}
        for label, (known, adapted) in worlds.items():
            sizes += size_rows(label, known, persons, noise_deg, of_table_mm)
            unseen += unseen_rows(label, adapted, persons, of_table_mm)
    return f"{markdown(SIZE_HEADER, sorted(sizes))}\n\n{markdown(UNSEEN_HEADER, sorted(unseen))}"


@app.command()
def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files, all six angles.")],
    mean: Annotated[list[str] | None, typer.Option(help="Subject that is a group mean; repeatable.")] = None,
    model: Annotated[list[str] | None, typer.Option(help="Set of Table 6.5; repeatable. Default: all three.")] = None,
) -> None:
    """Print, as Markdown, what measured motions say of the questions of chapter 7."""
    names = model or list(SETS)
    check_known(names, SETS, "set of Table 6.5")
    motions = whole(read_motions(*files))
    persons = Persons.of(motions, mean or [])
    noise = estimate_noise(persons.shoulders, motions.angles_deg)
    print("adaptations", file=sys.stderr, flush=True)
    data = [adapt_rows(motions, load_model(name)) for name in names]
    print(f"{len(motions.posture)} postures. Noise of an angle, {noise.source}: {noise.angle_deg:.2f} deg.\n")
    print(f"## Is the distance to the thorax constant?\n\n{distance_table(data, persons, noise.angle_deg)}\n")
    print(f"## A rhythm, or measured?\n\n{rhythm_table(data, persons)}\n")
    print(f"Rhythm from the subject's rest less measured, deg:\n\n{bias_table(motions, persons)}\n")
    gains = [[one.model.name, *better_by_measuring(one, persons)] for one in data]
    print(markdown(["set", "measured better by, scapula, deg", "clavicle, deg"], gains), end="\n\n")
    print(f"## An ellipsoid for each posture?\n\n{ellipsoid_tables(data, persons, noise.angle_deg)}")


if __name__ == "__main__":
    cli.main(app)
