"""Effects outside the list: mistakes of the laboratory, most of which need the whole recording."""

import numpy as np
from scipy.spatial.transform import Rotation

from scripts.research.named_causes.synthetic_b.chain import Array, cardan, cardan_angles
from scripts.research.named_causes.synthetic_b.effects import Effect, turned
from scripts.research.named_causes.synthetic_b.people import MOTION

OUTSIDE_SIZES = {
    "outside_wrong_sequence": (1.0, 1.0),  # scapula angles decomposed Z-Y'-X'' instead of Y-Z'-X''
    "outside_time_shift": (26.0, 38.0),  # deg of elevation by which the clavicle's recording runs late
    "outside_sensor_slip": (9.0, 15.0),  # deg, the scapula's sensor slips once, somewhere within each recording
    "outside_breathing": (8.0, 13.0),  # mm, postures held at different depths of breath
    "outside_palpation_blunders": (12.0, 18.0),  # deg, some postures have a bone that is palpated altogether wrong
    "outside_magnetic_distortion": (9.0, 14.0),  # deg, field warped by a steel table: varies with the sensor's place
    "outside_digitiser_gain": (0.30, 0.45),  # worn potentiometers: two angles deviate too far from their mean
    "outside_swapped_motion": (1.0, 1.0),  # the clavicle's two recordings are exchanged
    "outside_outlier_subject": (20.0, 30.0),  # deg, in two subjects of ten the clavicle's sensor is loose
}


def laboratory_mistake(degrees: Array, effect: Effect, elevation: Array, rng: np.random.Generator) -> Array:
    """Apply a mistake that needs the whole recording to the six angles (postures, 6); other effects change nothing."""
    out = degrees.copy()
    one, two = np.flatnonzero(MOTION == 0), np.flatnonzero(MOTION == 1)
    match effect.name:
        case "outside_wrong_sequence":
            matrices = Rotation.from_matrix(cardan(degrees[:, 3:]))
            out[:, 3:] = matrices.as_euler("ZYX", degrees=True)[:, [1, 0, 2]]
        case "outside_time_shift":
            for rows in (one, two):
                for angle in range(3):
                    course = np.polynomial.Polynomial.fit(elevation[rows], degrees[rows, angle], 3)
                    when = np.maximum(elevation[rows] - effect.size, elevation[rows][0])
                    out[rows, angle] += course(when) - course(elevation[rows])
        case "outside_sensor_slip":
            for rows, sign in ((one, 1.0), (two, -1.0)):
                slipped = rows[int(rng.integers(2, 5)) :]
                slip = turned(sign * effect.size * effect.direction)
                out[slipped, 3:] = cardan_angles(cardan(degrees[slipped, 3:]) @ slip)
        case "outside_palpation_blunders":
            for row in np.flatnonzero(rng.random(len(degrees)) < 0.14):
                bone = slice(0, 3) if rng.random() < 0.3 else slice(3, 6)
                axis = rng.normal(size=3)
                wrong = turned(effect.size * axis / np.linalg.norm(axis))
                out[row, bone] = cardan_angles(cardan(degrees[row, bone]) @ wrong)
        case "outside_magnetic_distortion":
            for bone, gain in ((slice(0, 3), 0.5), (slice(3, 6), -1.0)):
                phase = elevation / 38.0 + 1.1 * MOTION + 2.0 * effect.ratio
                warp = turned(gain * effect.size * np.sin(phase)[:, None] * effect.direction)
                out[:, bone] = cardan_angles(warp @ cardan(degrees[:, bone]))
        case "outside_digitiser_gain":
            for angle in (0, 4):
                out[:, angle] += effect.size * (degrees[:, angle] - degrees[:, angle].mean())
        case "outside_swapped_motion":
            out[one, :3], out[two, :3] = degrees[two, :3], degrees[one, :3]
        case "outside_outlier_subject":
            for row in range(len(degrees)):
                loose = turned(effect.size * rng.normal(size=3) * np.array([0.7, 0.5, 0.5]))
                out[row, :3] = cardan_angles(cardan(degrees[row, :3]) @ loose)
    return out
