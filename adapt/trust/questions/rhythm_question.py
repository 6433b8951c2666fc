"""Question (b): a rhythm, or scapula and clavicle measured?"""

import numpy as np
from jaxtyping import Float

from adapt.tables.driven_table import drive_each
from adapt.trust.questions.answer import RHYTHM, Answer, Collector
from adapt.trust.questions.persons import AdaptedRows, Interval, Persons, closest
from adapt.trust.questions.rhythm_prediction import Predicted, predict_from_lowest
from models.drive import free_coordinates_mm
from motions.rotations import DEG
from motions.table import ANGLES, BONES, Motions

_NORMAL_95 = 1.959964

SCAPULA, CLAVICLE = "scapula, mean difference", "clavicle, mean difference"
WIDTH = "95 % width of a scapular angle"


def rhythm_answers(data: AdaptedRows, persons: Persons) -> list[Answer]:
    """Answer by the differences between simulated and measured angles of the scored postures, per way of simulation.

    The list is empty where no posture's plane of elevation is known (``rhythm_prediction``).
    """
    motions = data.motions
    own, mean = predict_from_lowest(motions), predict_from_lowest(motions, measured_rest=False)
    found = Collector(RHYTHM, data.model.name, persons)
    if not own.scored.any():
        return []
    ways = {
        "rhythm from the published rest, no model": mean.angles_deg,
        "rhythm from the subject's rest, no model": own.angles_deg,
        **simulated_deg(data, own.angles_deg),
    }
    for way, angles_deg in ways.items():
        _add_way(found, way, angles_deg, motions, own, persons)
    for angle, off in zip(ANGLES, _off(own.angles_deg, motions, own).T, strict=True):
        found.add("rhythm from the subject's rest, no model", f"{angle} less measured", "deg", persons.by_subject(off))
    pair = ("rhythm, closest posture", "measured, closest posture, adapted without the motion")
    apart = [np.abs(_off(ways[way], motions, own)) for way in pair]
    for bone in ("scapula", "clavicle"):
        gain = (apart[0] - apart[1])[:, BONES[bone]].mean(axis=1)
        found.add(f"{pair[1]}, against {pair[0]}", f"{bone}, gain", "deg", persons.by_subject(gain))
    return found.answers


def _off(angles_deg, motions: Motions, predicted: Predicted) -> Float[np.ndarray, "rows 6"]:
    """Compute simulated minus measured angles of the scored postures; NaN elsewhere."""
    return np.where(predicted.scored[:, None], angles_deg - motions.angles_deg, np.nan)


def _add_way(found: Collector, way: str, angles_deg, motions: Motions, predicted: Predicted, persons: Persons) -> None:
    off = _off(angles_deg, motions, predicted)
    for quantity, bone in ((SCAPULA, "scapula"), (CLAVICLE, "clavicle")):
        found.add(way, quantity, "deg", persons.by_subject(np.abs(off[:, BONES[bone]]).mean(axis=1)))
    widths = [_width_deg(persons, angle) for angle in off[:, BONES["scapula"]].T]
    found.add_interval(way, WIDTH, "deg", Interval(float(np.mean(widths)), min(widths), max(widths)))
    missing = int(np.isnan(off[predicted.scored]).any(axis=1).sum())
    found.add_number(way, f"not reached, of {predicted.scored.sum()} postures", "postures", missing)


def simulated_deg(data: AdaptedRows, rhythm_deg: Float[np.ndarray, "rows 6"]) -> dict[str, np.ndarray]:
    """Simulate the postures in each way, (rows, 6), degrees; NaN where the chain cannot take a posture."""
    own, adapted, without = data.girdle(), data.girdle(data.adapted_mm), data.girdle(data.without_mm)
    rhythm = rhythm_deg.T / DEG
    found = {
        "rhythm, AC_y, AC_z, TS_x of it": driven(own, rhythm),
        "rhythm, closest posture": closest(own, rhythm),
        "rhythm, closest posture, adapted": closest(adapted, rhythm),
        "measured, AC_y, AC_z, TS_x of it": driven(own, data.angles),
        "measured, closest posture": closest(own, data.angles),
        "measured, closest posture, adapted without the motion": closest(without, data.angles),
        "measured, closest posture, adapted": closest(adapted, data.angles),
    }
    return {label: angles.T * DEG for label, angles in found.items()}


def driven(girdle, angles: Float[np.ndarray, "6 rows"]) -> Float[np.ndarray, "6 rows"]:
    """Drive the girdle by the free coordinates of these angles, which need not close the chain; angles in rad."""
    return drive_each(girdle, free_coordinates_mm(girdle, angles), np.nan_to_num(angles)).angles


def _width_deg(persons: Persons, off_deg: Float[np.ndarray, " rows"]) -> float:
    """Compute the width of the interval about 0 that holds 95 % of normal differences with the mean square over
    persons."""
    squares = persons.by_subject(off_deg**2)
    return 2.0 * _NORMAL_95 * float(np.sqrt(persons.mean(squares)))
