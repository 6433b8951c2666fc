"""Does the conoid strain alike in all persons, where SC and AC move as bone pins have measured?

    python scripts/research/named_causes/study_conoid.py ../shared/motions_positions/bonepin_*.csv

The conoid ends on the clavicle and on the scapula: the measured angles and the measured movement of AC give its length
in every posture, whatever the thorax is like. A person's own length and attachments are taken out, by least squares
with their prior SD. What is left is compared with a course over the six angles that was fitted to the shoulders of the
other persons. No cause, no search and no posture fit takes part. Prints Markdown.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from adapt import adapt_subjects
from adapt.evaluation.held_out import AdaptedSubjects
from models import load_model
from models.effects.extended_girdle import ExtendedGirdle
from motions.table import person_of
from scripts.reporting import markdown, measured
from scripts.research.named_causes.study_measured_movement import JOINTS, SETS
from scripts.research.thesis.scores import rms

ATTACHMENT_SD_MM = 8.0
"""SD believed of persons in each coordinate of an attachment: wide, so that what an attachment does is no strain."""

NOISE_MM = 0.3
"""Error of the length: 0.15 degrees and 0.3 mm of bone pins."""

COURSE_SD_MM = 2.0
"""SD believed of the strain for one SD of an angle."""


def main() -> None:
    """Print one table: a row for each set, the shoulders in order."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    described.add_argument("motions", nargs="+", type=Path)
    described.add_argument("--model", action="append", default=[], help=f"parameter sets; default: {', '.join(SETS)}")
    given = described.parse_args()
    motions, rows = measured(described, given.motions), []
    for name in given.model or SETS:
        moved = dict.fromkeys(JOINTS["both"], "measured")
        found = adapt_subjects(motions, load_model(name), held_out=motions.subjects, effects=moved).of(name)
        left, courses = strains_mm(found)
        person = np.array([person_of(subject) for subject in found.rows.subjects])
        of_others = [course_of_others(left, courses, person, shoulder) for shoulder in range(len(left))]
        agree = [np.corrcoef(one, two)[0, 1] for one, two in zip(left, of_others, strict=True)]
        after = [rms(one - two) for one, two in zip(left, of_others, strict=True)]
        rows.append(
            [name, *(" ".join(f"{x:.{d}f}" for x in each) for each, d in ((map(rms, left), 1), (after, 1), (agree, 2)))]
        )
    print(markdown(["set", "strain, mm RMS", "less the course of the other persons, mm", "correlation with it"], rows))


def strains_mm(found: AdaptedSubjects) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Compute the strain of every shoulder, and the angles in SDs, both less what the own bones explain."""
    left, courses = [], []
    for shoulder in range(len(found.rows.subjects)):
        own = np.flatnonzero(found.rows.subject == shoulder)
        conoid_mm, angles = conoid_of(found, shoulder, own), found.rows.angles[:, own].T
        strain, slopes = beside_own_bones(conoid_mm)
        angles /= found.rows.angles.std(axis=1)
        left.append(strain)
        courses.append(angles - slopes @ np.linalg.lstsq(slopes, angles, rcond=None)[0])
    return left, courses


def beside_own_bones(conoid_mm: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Fit length and attachments of the person; return what is left, and its slopes in these seven numbers."""

    def misfit(x: np.ndarray) -> np.ndarray:
        return np.concatenate([(conoid_mm(x[1:]) - x[0]) / NOISE_MM, x[1:] / ATTACHMENT_SD_MM])

    fit = least_squares(misfit, np.zeros(7), jac="3-point")
    count = len(fit.fun) - 6
    return fit.fun[:count] * NOISE_MM, fit.jac[:count]


def conoid_of(found: AdaptedSubjects, shoulder: int, own: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return A3 at the measured angles as a function of shifts of both attachments, mm."""
    held_out, rows = found.held_out, found.rows
    fold = next(k for k, one in enumerate(held_out.folds) if one.subject == shoulder)
    at = held_out.data.girdles_at(held_out.adapted.theta_mm, rows.posture[own], np.full(len(own), fold))
    assert isinstance(at, ExtendedGirdle)
    ends = "clavicle_conoid_mm", "scapula_conoid_mm"

    def conoid_mm(shift_mm: np.ndarray) -> np.ndarray:
        moved = {
            name: getattr(at.girdle, name) + mm[:, None] for name, mm in zip(ends, shift_mm.reshape(2, 3), strict=True)
        }
        return np.asarray(replace(at, girdle=replace(at.girdle, **moved)).residuals_mm(rows.angles[:, own]))[2]

    return conoid_mm


def course_of_others(
    left: list[np.ndarray], courses: list[np.ndarray], person: np.ndarray, shoulder: int
) -> Float[np.ndarray, " own"]:
    """Predict the strain of a shoulder from a course over the angles, fitted to the shoulders of the other persons."""
    others = np.flatnonzero(person != person[shoulder])
    x, y = np.concatenate([courses[one] for one in others]), np.concatenate([left[one] for one in others])
    certain = (NOISE_MM / COURSE_SD_MM) ** 2 * np.eye(x.shape[1])
    return courses[shoulder] @ np.linalg.solve(x.T @ x + certain, x.T @ y)


if __name__ == "__main__":
    main()
