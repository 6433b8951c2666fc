"""Question (b): a rhythm, or scapula and clavicle measured?"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from models.drive import drive, free_coordinates_mm
from motions import Motions
from motions.rotations import DEG
from motions.table import ANGLE_NAMES, ANGLES, BONES
from scripts.reporting import markdown
from scripts.research.thesis.chapter7.rhythm_prediction import Predicted, predict_from_lowest
from scripts.research.thesis.chapter7.shoulders import AdaptedRows, Persons, closest

_NORMAL_95 = 1.959964

HEADER = ["input", "set", "scapula, deg", "clavicle, deg", "95 % width of a scapular angle, deg", "not reached"]
HEADER += ["scapula, group means, deg"]


def rhythm_table(data: Sequence[AdaptedRows], persons: Persons) -> str:
    """Differences of what each way of simulating makes of the scored postures, from the measured angles."""
    motions = data[0].motions
    own, mean = predict_from_lowest(motions), predict_from_lowest(motions, measured_rest=False)
    lines = [
        ["rhythm from the published rest", "none", *_cells(mean.angles_deg, motions, own, persons)],
        ["rhythm from the subject's rest", "none", *_cells(own.angles_deg, motions, own, persons)],
    ]
    for one in data:
        for label, angles_deg in simulated_deg(one, own.angles_deg).items():
            lines.append([label, one.model.name, *_cells(angles_deg, motions, own, persons)])
    return markdown(HEADER, lines)


def bias_table(motions: Motions, persons: Persons) -> str:
    """The rhythm from the subject's rest less the measured angles, mean of the scored postures."""
    predicted = predict_from_lowest(motions)
    off = np.where(predicted.scored[:, None], predicted.angles_deg - motions.angles_deg, np.nan)
    cells = [persons.cell(persons.by_subject(angle), sign="+") for angle in off.T]
    return markdown([ANGLE_NAMES[angle] for angle in ANGLES], [cells])


def simulated_deg(data: AdaptedRows, rhythm_deg: Float[np.ndarray, "rows 6"]) -> dict[str, np.ndarray]:
    """Simulate the postures in each way, (rows, 6), degrees; NaN where the chain cannot."""
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
    """Drive the girdle by the free coordinates that it would have at these angles, rad, the chain left open."""
    return np.asarray(drive(girdle, free_coordinates_mm(girdle, angles), np.nan_to_num(angles)).angles)


def _cells(angles_deg, motions: Motions, predicted: Predicted, persons: Persons) -> list[str]:
    scored = predicted.scored[:, None]
    off = np.where(scored, angles_deg - motions.angles_deg, np.nan)
    gaps = {bone: persons.by_subject(np.abs(off[:, part]).mean(axis=1)) for bone, part in BONES.items()}
    widths = [_width_deg(persons, angle) for angle in off[:, BONES["scapula"]].T]
    missing = np.isnan(off[predicted.scored]).any(axis=1).sum()
    return [
        persons.cell(gaps["scapula"]),
        persons.cell(gaps["clavicle"]),
        f"{min(widths):.0f}-{max(widths):.0f}",
        f"{missing} of {predicted.scored.sum()}",
        persons.of_means(gaps["scapula"]),
    ]


def _width_deg(persons: Persons, off_deg: Float[np.ndarray, " rows"]) -> float:
    """Width of the interval about 0 that holds 95 % of normal differences with this mean square over persons."""
    squares = persons.by_subject(off_deg**2)
    return 2.0 * _NORMAL_95 * float(np.sqrt(persons.each(squares).mean()))


def better_by_measuring(data: AdaptedRows, persons: Persons) -> list[str]:
    """Scapula and clavicle: how much smaller the difference is with measured input, adapted without the motion, than
    with the rhythm through the model as it is."""
    predicted = predict_from_lowest(data.motions)
    ways = simulated_deg(data, predicted.angles_deg)
    pair = (ways["rhythm, closest posture"], ways["measured, closest posture, adapted without the motion"])
    off = [np.where(predicted.scored[:, None], np.abs(one - data.motions.angles_deg), np.nan) for one in pair]
    return [
        persons.cell(persons.by_subject((off[0] - off[1])[:, BONES[bone]].mean(axis=1)), sign="+")
        for bone in ("scapula", "clavicle")
    ]
