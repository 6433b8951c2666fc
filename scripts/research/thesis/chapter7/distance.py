"""Question (a): is the distance of TS and AI to the thorax constant?"""

from collections.abc import Sequence

import numpy as np

from scripts.reporting import markdown
from scripts.research.thesis.chapter7.constant_distance import (
    POINTS,
    DistanceCourse,
    distance_courses,
    noise_courses,
    thorax_distances_mm,
)
from scripts.research.thesis.chapter7.shoulders import AdaptedRows, Persons, closest

REPEATS, SEED = 200, 7
"""Simulated repetitions of all measurements: the ends of a 95 % band to a tenth of its width."""

_FULL_MOTION_DEG = 90.0

HEADER = ["set", "point", "mean, mm", "SD over postures, mm", "SD by noise alone", "noise for this SD, deg"]
HEADER += ["change over 90 deg, mm", "by noise alone", "SD, group means, mm"]


def distance_table(data: Sequence[AdaptedRows], persons: Persons, noise_deg: float) -> str:
    """One row a set, as it is and adapted, and point; noise columns are 95 % bands of the same mean over persons."""
    lines = []
    for one in data:
        for state, theta in (("", None), (", adapted", one.adapted_mm)):
            girdle, motions = one.girdle(theta), one.motions
            by = motions.subject, motions.motion, motions.humerus_elevation_deg
            found = distance_courses(thorax_distances_mm(girdle, one.angles), *by)
            closed = closest(girdle, one.angles)
            noise = noise_courses(girdle, closed, noise_deg, *by, repeats=REPEATS, seed=SEED)
            for k, point in enumerate(POINTS):
                lines.append([one.model.name + state, point, *_cells(k, found, noise, persons, noise_deg)])
    return markdown(HEADER, lines)


def _cells(k: int, found: DistanceCourse, noise: DistanceCourse, persons: Persons, noise_deg: float) -> list[str]:
    sd, slope = found.sd_mm[k], _FULL_MOTION_DEG * found.slope_mm_per_deg[k]
    sds, slopes = noise.sd_mm[k], _FULL_MOTION_DEG * noise.slope_mm_per_deg[k]
    return [
        persons.cell(found.mean_mm[k]),
        persons.cell(sd),
        _band(persons, sds),
        persons.cell(noise_deg * sd / sds.mean(axis=-1)),
        persons.cell(slope, sign="+"),
        _band(persons, slopes, "+"),
        persons.of_means(sd),
    ]


def _band(persons: Persons, values: np.ndarray, sign: str = "") -> str:
    """95 % of the mean over persons in the repetitions."""
    low, high = np.quantile([persons.each(one).mean() for one in values.T], [0.025, 0.975])
    return f"{low:{sign}.2f} to {high:{sign}.2f}"
