"""The effects that change the girdle or the laboratory's frames, posture by posture."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from scripts.research.named_causes.synthetic_b.chain import Array, Girdle

# Range of an effect's typical size, at its largest within the motion: mm, deg, or a fraction (`girdle effects`).
SIZES = {
    "scapulothoracic_gap": (5.0, 10.0),
    "conoid_strain": (2.0, 4.0),
    "ac_translation": (3.0, 6.0),
    "sc_translation": (3.0, 8.0),
    "thorax_tilt": (5.0, 10.0),
    "thorax_asymmetry": (5.0, 10.0),
    "thorax_shape": (0.2, 0.4),  # as a superquadric exponent; here a bulge of 20 mm per unit, see Girdle.bulge_mm
    "clavicle_length": (0.06, 0.10),
    "scapula_size": (0.06, 0.10),
    "scapula_landmark_bias": (4.0, 12.0),
    "clavicle_axial_estimate": (10.0, 25.0),
    "skin_artefact": (6.0, 13.0),
    "thorax_extension": (6.0, 13.0),
}
ONE_SIDED = {"conoid_strain", "clavicle_axial_estimate", "skin_artefact", "thorax_extension"}


@dataclass(frozen=True)
class Effect:
    """One effect in one subject. `direction` is a unit vector whose meaning depends on the effect."""

    name: str
    size: float
    direction: Array
    onset: float  # deg of elevation
    top: float  # deg, the subject's largest elevation, where the effect has its full size
    ratio: float  # between 0 and 1, a proportion within the effect


def ramp(elevation: float, onset: float, top: float) -> float:
    """Compute a smooth rise from 0 at the onset to 1 at the top, flat at both ends."""
    x = float(np.clip((elevation - onset) / (top - onset), 0.0, 1.0))
    return x * x * (3.0 - 2.0 * x)


def late(elevation: float, onset: float, top: float, power: float = 1.8) -> float:
    """Compute an accelerating rise: 0 up to the onset, 1 at the top."""
    return float(np.clip((elevation - onset) / (top - onset), 0.0, None) ** power)


def early(elevation: float, top: float) -> float:
    """Compute a rise to 1 at the top that is mostly done in the first part of the motion."""
    return float((1.0 - np.exp(-elevation / 45.0)) / (1.0 - np.exp(-top / 45.0)))


def turned(axis_angle_deg: Array) -> Array:
    """Compute the rotation matrix of a rotation vector (axis times angle) in degrees."""
    return Rotation.from_rotvec(axis_angle_deg, degrees=True).as_matrix()


def bend_geometry(girdle: Girdle, effect: Effect, elevation: float, breath: float) -> Girdle:
    """Return the girdle with the effect at this elevation; effects on the measurement leave it unchanged."""
    size, onset, top, ratio = effect.size, effect.onset, effect.top, effect.ratio
    match effect.name:
        case "scapulothoracic_gap":  # the muscle under the scapula swells up to a limit; less under TS than under AI
            rise = size * ramp(elevation, onset, 0.8 * top)
            return replace(
                girdle,
                ts_distance=girdle.ts_distance + (0.3 + 0.5 * ratio) * rise,
                ai_distance=girdle.ai_distance + rise,
            )
        case "conoid_strain":  # the conoid is taut past the onset only: a soft toe region, then a straight line
            soft = np.logaddexp(0.0, (elevation - onset - 15.0) / 12.0) / np.logaddexp(0.0, (top - onset - 15.0) / 12.0)
            return replace(girdle, conoid_length=girdle.conoid_length + size * float(soft))
        case "ac_translation":  # slides front-to-back early, moves up late
            slide = 0.8 * early(elevation, top) * effect.direction
            up = 0.6 * late(elevation, onset, top) * np.array([0.0, 1.0, 0.0])
            return replace(girdle, ac_shift=size * (slide + up))
        case "sc_translation":  # glides with the clavicle's elevation, which is mostly mid-range
            return replace(girdle, sc=girdle.sc + size * ramp(elevation, onset, top) * effect.direction)
        case "thorax_tilt":
            return replace(girdle, tilt=turned(size * effect.direction))
        case "thorax_asymmetry":
            return replace(girdle, centre=girdle.centre + np.array([size, 0.0, 0.0]))
        case "thorax_shape":
            return replace(girdle, bulge_mm=20.0 * size, bulge_azimuth=0.75 + 0.3 * ratio)
        case "clavicle_length":  # a longer bone is thicker too, but less so
            grow = np.array([1.0 + size, 1.0 + 0.5 * size, 1.0 + 0.5 * size])
            longer = girdle.length * (1.0 + size)
            return replace(girdle, length=longer, clavicle_conoid=girdle.clavicle_conoid * grow)
        case "scapula_size":  # height differs a little more between people than breadth
            grow = np.array([1.0 + (0.8 + 0.2 * ratio) * size, 1.0 + 1.1 * size, 1.0 + size])
            grown = [part * grow for part in (girdle.ts, girdle.ai, girdle.scapula_conoid)]
            return replace(girdle, ts=grown[0], ai=grown[1], scapula_conoid=grown[2])
        case "outside_breathing":  # deeper at the front and back than at the sides; the ribs also rise
            deep = size * breath
            rise, wider = deep * np.array([0.0, 0.6, -0.2]), deep * np.array([0.5, 0.0, 1.0])
            return replace(girdle, axes=girdle.axes + wider, centre=girdle.centre + rise)
    return girdle


def bend_frames(
    R_clavicle: Array, R_scapula: Array, frame: Array, effect: Effect, elevation: float, motion: int
) -> tuple[Array, Array, Array]:
    """Return clavicle, scapula and thorax frame as the laboratory measures them at this elevation."""
    size, onset, top, ratio = effect.size, effect.onset, effect.top, effect.ratio
    match effect.name:
        case "scapula_landmark_bias":
            R_scapula = R_scapula @ turned(size * effect.direction)
        case "clavicle_axial_estimate":  # too little axial rotation, increasingly so late in the motion
            R_clavicle = R_clavicle @ turned(np.array([-size * late(elevation, onset, top), 0.0, 0.0]))
        case "skin_artefact":  # grows slowly to 90 deg, fast above; mostly too little upward rotation
            creep = 0.3 * min(elevation, 90.0) / 90.0 + 0.7 * late(elevation, 85.0, max(top, 120.0), 1.3)
            R_scapula = R_scapula @ turned(size * creep * effect.direction)
        case "thorax_extension":  # in abduction the trunk also leans sideways
            axis = np.array([1.0, 0.0, 0.0 if motion else 0.2 + 0.2 * ratio])
            frame = turned(size * ramp(elevation, onset, 1.05 * top) * axis / np.linalg.norm(axis)) @ frame
    return R_clavicle, R_scapula, frame


def unit(vector: Array) -> Array:
    """Scale a vector to length 1."""
    return vector / np.linalg.norm(vector)


def world_direction(name: str, rng: np.random.Generator) -> Array:
    """Draw the direction of an effect in this world, before subjects differ."""
    lean = rng.normal(size=3)
    match name:
        case "ac_translation":  # front-to-back in the clavicle frame
            mean = np.array([0.0, 0.0, rng.choice([-1.0, 1.0])])
        case "sc_translation":  # up, backward, a little toward the midline
            mean = np.array([-0.3, 0.8, 0.5])
        case "thorax_tilt":  # the rib cage leans forward or backward
            mean = np.array([1.0, 0.0, 0.25])
        case "scapula_landmark_bias":  # any direction, in the proportions of the rotation between AC and AA frames
            mean, lean = unit(lean * np.array([11.6, 12.4, 6.1])), 0.0 * lean
        case "skin_artefact":  # upward rotation lost (-z), with some tipping and protraction
            mean = np.array([0.35, -0.25, -1.0])
        case _:
            return unit(lean)
    return unit(mean + 0.2 * lean)
