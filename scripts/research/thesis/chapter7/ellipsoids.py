"""Question (c): an ellipsoid for each posture?"""

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from adapt.solvers import status
from models.adapted_parameters import ADAPTED_PARAMETERS
from motions.rotations import DEG
from motions.table import BONES
from scripts.research.thesis.chapter7.posture_ellipsoids import foreseen_square_sd, least_change, smooth_share
from scripts.research.thesis.chapter7.shoulders import AdaptedRows, Persons, Unseen, closest

SIZE_HEADER = ["data", "set", "part", "change, SDs", "varying, SDs", "varying by noise, SDs", "share that is smooth"]
SIZE_HEADER += ["closed", "varying, group means, SDs"]

UNSEEN_HEADER = ["data", "set", "bone", "adapted without the motion", "+ mean change", "+ line over elevation"]
UNSEEN_HEADER += ["mean change gains", "line gains over mean"]

PARTS = {"ellipsoid": slice(0, -1), "conoid": slice(-1, None)}

_LEAST_AXIS_MM = 1.0

Course = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Changes (adapted, fitted rows), elevations of the fitted and of the tested rows, to changes of the tested rows."""


def size_rows(label: str, data: AdaptedRows, persons: Persons, noise_deg: float, sd_mm: np.ndarray) -> list[list[str]]:
    """How large the least change from the adapted parameters is, how much of it varies from posture to posture, what
    noise alone would give, and how smooth it is along the motions."""
    girdle = data.girdle(data.adapted_mm)
    change = least_change(girdle, data.angles, sd_mm)
    foreseen = foreseen_square_sd(girdle, closest(girdle, data.angles), noise_deg, sd_mm)
    sequences = [rows for rows in persons.shoulders.sequences() if len(rows)]
    closed = f"{(change.status == status.OK).sum()} of {len(change.status)}"
    lines = []
    for part, numbers in PARTS.items():
        in_sd = change.in_sd[numbers]
        varying = root_mean_square(persons, in_sd - means_of_subjects(persons, in_sd))
        cells = [persons.cell(root_mean_square(persons, in_sd)), persons.cell(varying, 2)]
        cells.append(f"{persons.each(root_mean_square(persons, np.sqrt(foreseen[numbers]))).mean():.2f}")
        cells += [f"{100 * smooth_share(in_sd, sequences):.0f} %", closed, persons.of_means(varying, 2)]
        lines.append([label, data.model.name, part, *cells])
    return lines


def root_mean_square(persons: Persons, in_sd: Float[np.ndarray, "numbers rows"]) -> Float[np.ndarray, " subjects"]:
    """Root of the mean |delta / SD|^2 over the postures of each subject."""
    return np.sqrt(persons.by_subject((in_sd**2).sum(axis=0)))


def means_of_subjects(persons: Persons, in_sd: Float[np.ndarray, "numbers rows"]) -> Float[np.ndarray, "numbers rows"]:
    """Mean of each number over the postures of the row's subject."""
    return np.stack([persons.by_subject(one)[persons.shoulders.subject] for one in in_sd])


def mean_change(change, _, elevation_deg) -> np.ndarray:
    """The mean of the other motions."""
    return np.repeat(change.mean(axis=1, keepdims=True), len(elevation_deg), axis=1)


def line_over_elevation(change, seen_deg, elevation_deg) -> np.ndarray:
    """A straight line over the elevation of the arm, least squares of the other motions."""
    design = np.stack([np.ones_like(seen_deg), seen_deg], axis=1)
    line = np.linalg.lstsq(design, change.T, rcond=None)[0]
    return (np.stack([np.ones_like(elevation_deg), elevation_deg], axis=1) @ line).T


def unseen_rows(label: str, data: AdaptedRows, persons: Persons, sd_mm: np.ndarray) -> list[list[str]]:
    """The gap on motions held out: adapted without them, and with the course of their other motions' changes."""
    changes = changes_of_others(data, sd_mm)
    courses: Sequence[Course | None] = (None, mean_change, line_over_elevation)
    gaps = [unseen_gaps_deg(data, changes, course) for course in courses]
    lines = []
    for bone in ("scapula", "clavicle"):
        values = [persons.by_subject(one[:, BONES[bone]].mean(axis=1)) for one in gaps]
        gains = [persons.cell(before - after, 2, "+") for before, after in itertools.pairwise(values)]
        lines.append([label, data.model.name, bone, *(persons.cell(one, 2) for one in values), *gains])
    return lines


def changes_of_others(data: AdaptedRows, sd_mm: np.ndarray) -> list[np.ndarray]:
    """Of each motion held out, the least changes (mm) of the subject's other postures, which it was not adapted to."""
    rows = np.concatenate([one.fitted for one in data.unseen])
    theta = np.concatenate([np.repeat(one.theta_mm[:, None], len(one.fitted), axis=1) for one in data.unseen], axis=1)
    change = least_change(data.girdle(theta), data.angles[:, rows], sd_mm).change_mm
    return np.split(change, np.cumsum([len(one.fitted) for one in data.unseen])[:-1], axis=1)


def unseen_gaps_deg(
    data: AdaptedRows, changes: Sequence[np.ndarray], course: Course | None
) -> Float[np.ndarray, "rows 6"]:
    """|simulated - measured| of every row, its motion being held out; NaN where that is not possible."""
    theta = data.without_mm.copy()
    for one, change in zip(data.unseen, changes, strict=True):
        if course is not None:
            theta[:, one.tested] += predicted_change(data, one, change, course)
    lengths = np.array([parameter.is_length for parameter in ADAPTED_PARAMETERS])[:, None]
    theta = np.where(lengths, np.maximum(theta, _LEAST_AXIS_MM), theta)
    fitted = closest(data.girdle(theta), data.angles)
    return np.abs(fitted - data.angles).T * DEG


def predicted_change(data: AdaptedRows, one: Unseen, change, course: Course) -> np.ndarray:
    """What the course makes of the changes that are known."""
    elevation, known = data.motions.humerus_elevation_deg, np.isfinite(change).all(axis=0)
    return course(change[:, known], elevation[one.fitted[known]], elevation[one.tested])
