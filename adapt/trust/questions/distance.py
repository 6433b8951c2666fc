"""Question (a): is the distance of TS and AI to the thorax constant?"""

import numpy as np

from adapt.trust.questions.answer import DISTANCE, Answer, Collector
from adapt.trust.questions.constant_distance import (
    POINTS,
    distances_over_elevation,
    noise_over_elevation,
    thorax_distances_mm,
)
from adapt.trust.questions.persons import AdaptedRows, Interval, Persons, closest

REPEATS, SEED = 200, 7
"""Number and seed of the simulated repetitions of all measurements. This number gives the ends of a 95 % band to a
tenth of the band's width."""

_FULL_MOTION_DEG = 90.0

SPREAD, BY_NOISE = "SD over postures", "SD by noise alone"
CHANGE, CHANGE_BY_NOISE = "change over 90 deg", "change by noise alone"


def distance_answers(data: AdaptedRows, persons: Persons, noise_deg: float) -> list[Answer]:
    """Answer for TS and AI, with the set as it is and adapted. Results of noise alone are 95 % bands of the same mean
    over persons."""
    found = Collector(DISTANCE, data.model.name, persons)
    motions = data.motions
    by = motions.subject, motions.motion, motions.humerus_elevation_deg
    for state, theta in (("as it is", None), ("adapted", data.adapted_mm)):
        girdle = data.girdle(theta)
        over_elevation = distances_over_elevation(thorax_distances_mm(girdle, data.angles), *by)
        closed = closest(girdle, data.angles)
        noise = noise_over_elevation(girdle, closed, noise_deg, *by, repeats=REPEATS, seed=SEED)
        for k, point in enumerate(POINTS):
            case, sd, sds = f"{point}, {state}", over_elevation.sd_mm[k], noise.sd_mm[k]
            found.add(case, "mean distance", "mm", over_elevation.mean_mm[k])
            found.add(case, SPREAD, "mm", sd)
            found.add_interval(case, BY_NOISE, "mm", _band(persons, sds))
            found.add(case, "noise that gives this SD", "deg", noise_deg * sd / sds.mean(axis=-1))
            found.add(case, CHANGE, "mm", _FULL_MOTION_DEG * over_elevation.slope_mm_per_deg[k])
            found.add_interval(
                case, CHANGE_BY_NOISE, "mm", _band(persons, _FULL_MOTION_DEG * noise.slope_mm_per_deg[k])
            )
    return found.answers


def _band(persons: Persons, values: np.ndarray) -> Interval:
    """Compute the median and 95 % band of the mean over persons in the repetitions."""
    middle = [persons.mean(one) for one in values.T]
    low, median, high = np.quantile(middle, [0.025, 0.5, 0.975])
    return Interval(float(median), float(low), float(high))
