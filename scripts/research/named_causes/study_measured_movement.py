"""How far does the gap shrink where SC and AC move as bone pins have measured, without any fitted number?

    python scripts/research/named_causes/study_measured_movement.py ../shared/motions_positions/bonepin_*.csv

Each set is adapted, plain and with own bones, with fixed joint centres and with the measured movement
(`--effect sc_translation=measured`, `ac_translation=measured`). For each kind of motion, held out: the gap of clavicle
and scapula, deg; the root mean square of A1-A3 at the measured angles, mm; and the distance to the measured positions,
mm. Means over shoulders. Prints Markdown.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from adapt import adapt_subjects
from adapt.evaluation.held_out import AdaptedSubjects
from adapt.evaluation.position_check import Judge, adapted_to_folds, of_motions
from models import ParameterSet, load_model
from motions import Motions
from scripts.reporting import markdown, measured
from scripts.research.person.own_bone_predictions import bone_means

SETS = ("R2", "breteler_dissection", "breteler_mri")

JOINTS = {
    "none": (),
    "SC": ("sc_translation",),
    "AC": ("ac_translation",),
    "both": ("sc_translation", "ac_translation"),
}
"""Joints that move as measured."""


def main() -> None:
    """Print one table."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    described.add_argument("motions", nargs="+", type=Path)
    described.add_argument("--model", action="append", default=[], help=f"parameter sets; default: {', '.join(SETS)}")
    given = described.parse_args()
    motions = measured(described, given.motions)
    rows = [row for name in given.model or SETS for row in lines(motions, load_model(name))]
    header = ["set", "bones", "moves as measured", "clavicle, scapula, deg", "A1, A2, A3, mm", "positions, mm"]
    print(markdown(header, rows))


def lines(motions: Motions, model: ParameterSet) -> Iterator[list[str]]:
    """Adapt with every choice of bones and moving joints; yield one row each."""
    for bones in (False, True):
        for word, names in JOINTS.items():
            effects = dict.fromkeys(names, "measured")
            result = adapt_subjects(motions, model, held_out=motions.subjects, effects=effects, own_bones=bones)
            found = result.of(model.name)
            gaps = [bone_means(gap) for gap in by_subject(found, found.held_out.gaps_deg)]
            residuals = [np.sqrt(np.nanmean(one**2, axis=1)) for one in by_subject(found, residuals_mm(found))]
            held_out = of_motions(found.held_out)
            away = Judge.of(model, found.rows).gap_mm(adapted_to_folds(found.rows, held_out), held_out.folds)
            numbers = (f"{value:.2f}" for value in np.mean(gaps, axis=0))
            mm = (f"{value:.1f}" for value in np.mean(residuals, axis=0))
            yield [model.name, "own" if bones else "the set's", word, ", ".join(numbers), ", ".join(mm), f"{away:.1f}"]


def residuals_mm(found: AdaptedSubjects) -> list[Float[np.ndarray, "3 tested"]]:
    """Compute A1-A3 at the measured angles of the held-out postures of each fold, with the fold's adapted girdle."""
    held_out, rows = found.held_out, found.rows
    each = []
    for k, fold in enumerate(held_out.folds):
        number = np.full(len(fold.tested), k)
        girdle = held_out.data.girdles_at(held_out.adapted.theta_mm, rows.posture[fold.tested], number)
        each.append(np.asarray(girdle.residuals_mm(rows.angles[:, fold.tested])))
    return each


def by_subject(found: AdaptedSubjects, of_folds: Sequence[Float[np.ndarray, "n tested"]]):
    """Concatenate the held-out postures of all folds, subject by subject."""
    subject = [fold.subject for fold in found.held_out.folds]
    for number in sorted(set(subject)):
        yield np.concatenate([one for one, of in zip(of_folds, subject, strict=True) if of == number], axis=1)


if __name__ == "__main__":
    main()
