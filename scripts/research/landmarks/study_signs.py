"""Do the sign checks leave the people of other simulators alone, and name every angle whose sign is reversed?

    .venv/bin/python scripts/research/landmarks/study_signs.py

The worlds of the blind check simulate people, with active causes and without, and so does the published rhythm. A
reversed angle counts where it changes by more than 5 degrees.
"""

import argparse
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from models.parameter_sets import FOLDER
from motions import ANGLES, Motions, read_motions
from motions.checks.signs import exchanged, rest_and_change, wrong_signs
from motions.rhythm_subjects import simulate_subjects
from scripts.research.named_causes.synthetic_a import make_world
from scripts.research.named_causes.synthetic_b.worlds import Case, write_case

SETS = ("R2", "R4", "R6", "breteler_dissection", "breteler_mri", "das3")
LARGE_DEG = 5.0

WORLDS_A = {"none": (32, *range(1, 10)), "skin_artefact": (32, 1), "thorax_tilt": (32, 1)}
"""Seeds of each label."""

WORLDS_B = {
    "none": range(1, 13),
    "skin_artefact": range(1, 4),
    "scapula_landmark_bias": range(1, 4),
    "thorax_extension": range(1, 4),
}
CADAVERS_B = ("R2", "R4", "breteler_dissection")


def people_a(name: str, folder: Path) -> Iterator[Motions]:
    """Simulate people on a parameter set (`synthetic_a`)."""
    for label, seeds in WORLDS_A.items():
        for seed in seeds:
            path = folder / "a.csv"
            make_world(label, FOLDER / f"{name}.toml", seed=seed).table.to_csv(path, index=False)
            yield from _each(read_motions(path))


def people_b(folder: Path) -> Iterator[Motions]:
    """Simulate people whose motion follows bone-pin measurements (`synthetic_b`)."""
    for label, seeds in WORLDS_B.items():
        for seed in seeds:
            place = folder / "c" / f"{label}{seed}"  # the folder's name is part of the seed
            write_case(place, [] if label == "none" else [label], Case(CADAVERS_B[seed % 3], seed))
            yield from _each(read_motions(place / "motions.csv"))


def _each(motions: Motions) -> Iterator[Motions]:
    for rows in motions.rows_by_subject():
        yield motions.take(rows)


def judged(people: Iterable[Motions]) -> dict[str, int]:
    """Count the people with a warning and, for each reversed angle, the people without a warning."""
    count, warned, turned, missed = 0, 0, 0, dict.fromkeys(ANGLES, 0)
    for one in people:
        low_and_change = rest_and_change(one)
        signs = wrong_signs(low_and_change)
        count, warned = count + 1, warned + bool(signs or exchanged(low_and_change, signs))
        for k, angle in enumerate(ANGLES):
            if np.nanmax(np.abs(2.0 * one.angles_deg[:, k])) > LARGE_DEG:
                flip = np.where(np.arange(6) == k, -1.0, 1.0)
                other = Motions(**{**vars(one), "angles_deg": one.angles_deg * flip})
                turned, missed[angle] = turned + 1, missed[angle] + (angle not in _named(other))
    return {"people": count, "warned": warned, "turned": turned} | missed


def _named(motions: Motions) -> set[str]:
    return {one.angle for one in wrong_signs(rest_and_change(motions))}


def main() -> None:
    """Print the table: people, warned people, reversed signs, and the missed ones for each angle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", nargs="*", default=list(SETS), help="of the first generator")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # warnings of the reader: the study counts them itself
    with tempfile.TemporaryDirectory() as folder:
        rows = {f"a, {name}": judged(people_a(name, Path(folder))) for name in arguments.sets}
        rows["b"] = judged(people_b(Path(folder)))
    rows["rhythm"] = judged(one for seed in range(1, 13) for one in _each(simulate_subjects(10, seed)))
    print(pd.DataFrame(rows).T.to_string())


if __name__ == "__main__":
    main()
