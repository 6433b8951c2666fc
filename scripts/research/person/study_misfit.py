"""How often is what own bones leave taken for more than noise, where nothing but own bones is active? Prints Markdown.

Simulated people with own bones, who differ as the prior says or twice as much. The estimate of the noise is drawn too,
with the degrees of freedom that a diagnosis has of two motions of seven postures a person.

    python scripts/research/person/study_misfit.py --persons 120 --seed 40
"""

import numpy as np
import typer

from adapt.diagnosis.inference.unexplained import more_than_noise
from adapt.diagnosis.result import Noise
from adapt.own_bones.own_adaptation import learn_people, misfit
from adapt.solvers.rows import posture_rows
from models import load_model
from motions.rhythm_subjects import NOISE_DEG
from scripts.reporting import markdown
from scripts.research.person.own_bone_worlds import WORLDS, People, simulate_people
from scripts.research.person.study_own_bones import in_runs

FREEDOM = 8.6
"""Degrees of freedom of the noise that a diagnosis estimates from 14 postures of a person."""


def is_rejected(run: People, generator: np.random.Generator) -> bool:
    """Test the misfit of the persons of a run against noise that was estimated."""
    rows, freedom = posture_rows(run.motions), FREEDOM * len(run.motions.subjects)
    noise = Noise(run.noise_deg * float(np.sqrt(generator.chisquare(freedom) / freedom)), "estimated", freedom)
    people = learn_people(rows, [run.model], held_out=False)
    return more_than_noise(*misfit(rows, run.model, people, noise.angle_deg), noise)


def main(persons: int = 120, seed: int = 40) -> None:
    """Print the share of runs that are rejected, by how people differ and the number of persons in a run."""
    model, generator, lines = load_model("R2"), np.random.default_rng(seed), []
    for name in ("as the prior", "all twice as much"):
        people = simulate_people(model, WORLDS[name](model), persons, NOISE_DEG, seed)
        for size in (1, 3, 10):
            found = [is_rejected(run, generator) for run in in_runs(people, size)]
            lines.append([name, f"{size}", f"{len(found)}", f"{np.mean(found):.0%}"])
    print(markdown(["people differ", "persons in a run", "runs", "more than noise"], lines))


if __name__ == "__main__":
    typer.run(main)
