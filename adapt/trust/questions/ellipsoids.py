"""Question (c): an ellipsoid for each posture?"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from adapt.solvers import status
from adapt.trust.questions.answer import ELLIPSOID, Answer, Collector
from adapt.trust.questions.persons import AdaptedRows, HeldOutMotion, Persons, adapt_rows, closest, with_noise_alone
from adapt.trust.questions.posture_ellipsoids import foreseen_square_sd, least_change, smooth_share
from adapt.trust.thesis.printed import SETS, sd_mm
from models.adapted_parameters import ADAPTED_PARAMETERS, PERSON_SD_MM
from motions.rotations import DEG
from motions.table import BONES

MEASURED, SIMULATED = "measured", "simulated noise"

SEED = 1999

PARTS = {"ellipsoid": slice(0, -1), "conoid": slice(-1, None)}

WITHOUT, WITH_MEAN, WITH_LINE = "adapted without the motion", "+ mean change", "+ line over elevation"

_LEAST_AXIS_MM = 1.0

Predictor = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Function from the changes (adapted, fitted rows), the elevations of the fitted rows and those of the tested rows to
the changes of the tested rows."""


def spread_mm(model: str) -> Float[np.ndarray, " adapted"]:
    """Return the SDs of Table 6.5 for this set; for sets that are not in the table, ``PERSON_SD_MM``."""
    return sd_mm()[SETS.index(model)] if model in SETS else PERSON_SD_MM


def ellipsoid_answers(data: AdaptedRows, persons: Persons, noise_deg: float) -> list[Answer]:
    """Answer by size, smoothness and predictions of the change, for the measurements and for simulated noise alone.

    For simulated noise, the change is relative to the parameters of the simulation; the gaps on held-out motions come
    from parameters adapted anew. There are no gaps where no subject has two motions.
    """
    found, of_mm = Collector(ELLIPSOID, data.model.name, persons), spread_mm(data.model.name)
    noisy = with_noise_alone(data, noise_deg, SEED)
    worlds = {MEASURED: (data, data), SIMULATED: (replace(data, motions=noisy), adapt_rows(noisy, data.model))}
    for label, (known, adapted) in worlds.items():
        _add_sizes(found, label, known, persons, noise_deg, of_mm)
        if adapted.held_out_motions:
            _add_held_out(found, label, adapted, persons, of_mm)
    return found.answers


def _add_sizes(found: Collector, label: str, data: AdaptedRows, persons: Persons, noise_deg: float, of_mm) -> None:
    """Add the size of the least change from the adapted parameters, the part that varies from posture to posture, this
    part for noise alone, and the smoothness of the change along the motions."""
    girdle = data.girdle(data.adapted_mm)
    change = least_change(girdle, data.angles, of_mm)
    foreseen = foreseen_square_sd(girdle, closest(girdle, data.angles), noise_deg, of_mm)
    sequences = [rows for rows in persons.shoulders.sequences() if len(rows)]
    for part, numbers in PARTS.items():
        in_sd, case = change.in_sd[numbers], f"{label}, {part}"
        found.add(case, "change", "SD", root_mean_square(persons, in_sd))
        varying = root_mean_square(persons, in_sd - means_of_subjects(persons, in_sd))
        found.add(case, "varying", "SD", varying)
        by_noise = root_mean_square(persons, np.sqrt(foreseen[numbers]))
        found.add_number(case, "varying by noise", "SD", persons.mean(by_noise))
        found.add_number(case, "share that is smooth", "%", 100.0 * smooth_share(in_sd, sequences))
        closed = int((change.status == status.OK).sum())
        found.add_number(case, f"closed, of {len(change.status)} postures", "postures", closed)


def root_mean_square(persons: Persons, in_sd: Float[np.ndarray, "numbers rows"]) -> Float[np.ndarray, " subjects"]:
    """Compute the root of the mean |delta / SD|^2 over the postures of each subject."""
    return np.sqrt(persons.by_subject((in_sd**2).sum(axis=0)))


def means_of_subjects(persons: Persons, in_sd: Float[np.ndarray, "numbers rows"]) -> Float[np.ndarray, "numbers rows"]:
    """Compute the mean of each number over the postures of the row's subject."""
    return np.stack([persons.by_subject(one)[persons.shoulders.subject] for one in in_sd])


def mean_change(change, _, elevation_deg) -> np.ndarray:
    """Predict the mean change of the subject's other motions."""
    return np.repeat(change.mean(axis=1, keepdims=True), len(elevation_deg), axis=1)


def line_over_elevation(change, seen_deg, elevation_deg) -> np.ndarray:
    """Predict by a straight line over the elevation of the arm, a least-squares fit to the other motions."""
    design = np.stack([np.ones_like(seen_deg), seen_deg], axis=1)
    line = np.linalg.lstsq(design, change.T, rcond=None)[0]
    return (np.stack([np.ones_like(elevation_deg), elevation_deg], axis=1) @ line).T


def _add_held_out(found: Collector, label: str, data: AdaptedRows, persons: Persons, of_mm) -> None:
    """Add the gap on held-out motions: adapted without them, and with changes predicted from the other motions."""
    changes = changes_of_others(data, of_mm)
    predictors: dict[str, Predictor | None] = {WITHOUT: None, WITH_MEAN: mean_change, WITH_LINE: line_over_elevation}
    gaps = {name: held_out_gaps_deg(data, changes, predictor) for name, predictor in predictors.items()}
    for bone in ("scapula", "clavicle"):
        values = {name: persons.by_subject(one[:, BONES[bone]].mean(axis=1)) for name, one in gaps.items()}
        for name, value in values.items():
            found.add(f"{label}, {bone}", name, "deg", value)
        found.add(f"{label}, {bone}", "mean change gains", "deg", values[WITHOUT] - values[WITH_MEAN])
        found.add(f"{label}, {bone}", "line gains over mean", "deg", values[WITH_MEAN] - values[WITH_LINE])


def changes_of_others(data: AdaptedRows, of_mm: np.ndarray) -> list[np.ndarray]:
    """Compute, per held-out motion, the least changes (mm) of the subject's other postures from the parameters adapted
    without the motion."""
    rows = np.concatenate([one.fitted for one in data.held_out_motions])
    theta = np.concatenate(
        [np.repeat(one.theta_mm[:, None], len(one.fitted), axis=1) for one in data.held_out_motions], axis=1
    )
    change = least_change(data.girdle_at(rows, theta), data.angles[:, rows], of_mm).change_mm
    return np.split(change, np.cumsum([len(one.fitted) for one in data.held_out_motions])[:-1], axis=1)


def held_out_gaps_deg(
    data: AdaptedRows, changes: Sequence[np.ndarray], predictor: Predictor | None
) -> Float[np.ndarray, "rows 6"]:
    """Compute |simulated - measured| of every row with the row's motion held out; NaN where that is not possible."""
    theta = data.without_mm.copy()
    for one, change in zip(data.held_out_motions, changes, strict=True):
        if predictor is not None:
            theta[:, one.tested] += predicted_change(data, one, change, predictor)
    lengths = np.array([parameter.is_length for parameter in ADAPTED_PARAMETERS])[:, None]
    theta = np.where(lengths, np.maximum(theta, _LEAST_AXIS_MM), theta)
    fitted = closest(data.girdle(theta), data.angles)
    return np.abs(fitted - data.angles).T * DEG


def predicted_change(data: AdaptedRows, one: HeldOutMotion, change, predictor: Predictor) -> np.ndarray:
    """Predict the changes of a held-out motion from the known changes, by ``predictor``."""
    elevation, known = data.motions.humerus_elevation_deg, np.isfinite(change).all(axis=0)
    return predictor(change[:, known], elevation[one.fitted[known]], elevation[one.tested])
