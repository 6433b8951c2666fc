"""A second simulated world to test the diagnosis on, by another author than the first (``scripts/blind_world``).

Written without sight of effect library, fits or the first world: only the parameter sets (plain data), the conventions
and the one-line descriptions of the effects are shared, so that what the others of this project take for granted is not
taken for granted here. Each world is a folder with motions.csv (what the laboratory saw) and truth.json.

    python scripts/other_world.py out/worlds --condition ten
    python scripts/check_elsewhere.py out/worlds --out out/elsewhere
"""

import csv
import json
import tomllib
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

ANGLES = ["clavicle_y", "clavicle_z", "clavicle_x", "scapula_y", "scapula_z", "scapula_x"]
LANDMARKS = ["SC", "AC", "TS", "AI"]
MODELS = ["R2", "R4", "R6", "breteler_dissection"]
MODELS_FOLDER = Path(__file__).parents[1] / "models"
CONDITIONS = ["ten", "three", "landmarks", "half", "one", "mixed"]
MOTIONS = ["abduction", "flexion"]
MOTION = np.repeat([0, 1], 7)  # of each posture of a subject

# Typical size of an effect at its largest within the range of motion: mm, deg, or a fraction (`girdle effects`).
SIZES = {
    "scapulothoracic_gap": (5.0, 10.0),
    "conoid_strain": (2.0, 4.0),
    "ac_translation": (3.0, 6.0),
    "sc_translation": (3.0, 8.0),
    "thorax_tilt": (5.0, 10.0),
    "thorax_asymmetry": (5.0, 10.0),
    "thorax_shape": (0.2, 0.4),  # as a superquadric exponent; a bulge of 20 mm a unit here, see Girdle.bulge_mm
    "clavicle_length": (0.06, 0.10),
    "scapula_size": (0.06, 0.10),
    "scapula_landmark_bias": (4.0, 12.0),
    "clavicle_axial_estimate": (10.0, 25.0),
    "skin_artefact": (6.0, 13.0),
    "thorax_extension": (6.0, 13.0),
}
OUTSIDE_SIZES = {
    "outside_wrong_sequence": (1.0, 1.0),  # scapula angles decomposed Z-Y'-X'' instead of Y-Z'-X''
    "outside_time_shift": (26.0, 38.0),  # deg of elevation by which the clavicle's recording runs late
    "outside_sensor_slip": (9.0, 15.0),  # deg, the scapula's sensor slips once, somewhere within each recording
    "outside_breathing": (8.0, 13.0),  # mm, postures held at different depths of breath
    "outside_palpation_blunders": (12.0, 18.0),  # deg, now and then a bone is palpated altogether wrong
    "outside_magnetic_distortion": (9.0, 14.0),  # deg, field warped by a steel table: turns with the sensor's place
    "outside_digitiser_gain": (0.30, 0.45),  # worn potentiometers: two angles read too large about their middle
    "outside_swapped_motion": (1.0, 1.0),  # the clavicle's two recordings were exchanged
    "outside_outlier_subject": (20.0, 30.0),  # deg, in two subjects of ten the clavicle's sensor works loose
}
ONE_SIDED = {"conoid_strain", "clavicle_axial_estimate", "skin_artefact", "thorax_extension"}
PAIRS = [
    ("skin_artefact", "clavicle_length"),
    ("scapulothoracic_gap", "sc_translation"),
    ("conoid_strain", "thorax_extension"),
    ("scapula_landmark_bias", "clavicle_axial_estimate"),
]

# Mean six angles (deg, in the order of ANGLES) at 20 deg and at 145 deg of elevation, after published bone-pin means,
# and how each gets there: the exponent of its course, below 1 early, above 1 late.
COURSES = {
    "abduction": ([-25, 10, 4, 36, 10, -10], [-45, 24, 24, 34, 45, 0], [1.2, 1.1, 1.3, 1.0, 1.0, 1.3]),
    "flexion": ([-19, 9, 3, 42, 9, -10], [-33, 20, 22, 43, 42, 1], [1.9, 1.2, 1.5, 1.0, 1.15, 1.2]),
}
# Clavicle y, z and scapula z are the free coordinates and keep to their course; the other three give way to the chain.
FOLLOW_DEG = np.array([1.5, 1.5, 3.0, 3.0, 1.5, 3.0])
STRAY_DEG = np.array([15.0, 15.0, 30.0, 20.0, 15.0, 20.0])  # farther from the wish than this is no real posture
OFFSET_DEG = np.array([4.5, 3.0, 4.0, 4.0, 4.5, 3.0])
REAL_DEG = np.array([[-58, -4, -20, 12, -7, -25], [-5, 38, 62, 65, 60, 16]])  # what real shoulders stay within
WANDER_DEG = np.array([1.3, 0.9, 1.2, 1.2, 1.5, 0.9])


@dataclass(frozen=True)
class Girdle:
    """One shoulder girdle at one instant: every length that closes the chain (mm)."""

    centre: Array
    axes: Array
    tilt: Array  # columns: the ellipsoid's axes in the thorax frame
    bulge_mm: float  # how far the rib cage stands out over the ellipsoid, at most
    bulge_azimuth: float  # rad, from lateral toward backward: where the ribs turn
    sc: Array
    length: float
    clavicle_conoid: Array
    ac_shift: Array  # of the acromion from the clavicle's end, clavicle frame
    ts: Array
    ai: Array
    scapula_conoid: Array
    ts_distance: float
    ai_distance: float
    conoid_length: float


@dataclass(frozen=True)
class Effect:
    """One effect in one subject. `direction` is a unit vector whose meaning belongs to the effect."""

    name: str
    size: float
    direction: Array
    onset: float  # deg of elevation
    top: float  # deg, the subject's largest elevation: there the effect has its full size
    ratio: float  # between 0 and 1, an inner proportion of the effect


@dataclass(frozen=True)
class Case:
    """How a world is measured."""

    model: str
    seed: int
    subjects: int = 10
    noise_deg: float = 1.5
    scale: float = 1.0
    mixed: bool = False
    landmark_noise_mm: float | None = None


@dataclass(frozen=True)
class World:
    """What the subjects of a case have in common."""

    cadaver: Girdle
    spread: float
    last: float  # deg, the largest elevation
    typical: dict[str, float]
    directions: dict[str, Array]
    signs: Array
    outliers: set[int]


@dataclass(frozen=True)
class Mover:
    """One subject, how it moved and what is true of it."""

    person: Girdle
    effects: list[Effect]
    elevation: Array
    breath: Array
    true: Array  # six angles a posture, deg
    redraws: int


def load_girdle(path: Path) -> Girdle:
    """Read a parameter set; the cadaver itself, without any effect."""
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    thorax, clavicle, scapula, constraint = (data[key] for key in ("thorax", "clavicle", "scapula", "constraint"))
    return Girdle(
        centre=np.array(thorax["centre_mm"]),
        axes=np.array(thorax["semi_axes_mm"]),
        tilt=np.eye(3),
        bulge_mm=0.0,
        bulge_azimuth=0.9,
        sc=np.array(clavicle["sc_mm"]),
        length=clavicle["length_mm"],
        clavicle_conoid=np.array(clavicle["conoid_mm"]),
        ac_shift=np.zeros(3),
        ts=np.array(scapula["ts_mm"]),
        ai=np.array(scapula["ai_mm"]),
        scapula_conoid=np.array(scapula["conoid_mm"]),
        ts_distance=constraint["ts_distance_mm"],
        ai_distance=constraint["ai_distance_mm"],
        conoid_length=constraint["conoid_length_mm"],
    )


# ---- the closed chain ------------------------------------------------------------------------------------------------


def cardan(degrees: Array) -> Array:
    """Rotation matrices Ry(a) Rz(b) Rx(c) of angles (..., 3)."""
    a, b, c = np.moveaxis(np.radians(degrees), -1, 0)
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    rows = [
        [ca * cb, sa * sc - ca * sb * cc, sa * cc + ca * sb * sc],
        [sb, cb * cc, -cb * sc],
        [-sa * cb, ca * sc + sa * sb * cc, ca * cc - sa * sb * sc],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def cardan_angles(matrix: Array) -> Array:
    """Angles (deg) of Ry(a) Rz(b) Rx(c)."""
    a = np.arctan2(-matrix[..., 2, 0], matrix[..., 0, 0])
    b = np.arcsin(np.clip(matrix[..., 1, 0], -1.0, 1.0))
    c = np.arctan2(-matrix[..., 1, 2], matrix[..., 1, 1])
    return np.degrees(np.stack([a, b, c], axis=-1))


def surface_distance(points: Array, girdle: Girdle) -> Array:
    """Signed distance (outside positive) of points (..., 3) to the rib cage.

    The foot on the ellipsoid is a^2 p / (a^2 + t); its equation in t is convex and falling, so that Newton from the
    lower bound goes straight to the root. A rib cage that stands out from the ellipsoid makes the distance smaller.
    """
    p = (points - girdle.centre) @ girdle.tilt
    a2 = girdle.axes**2
    t = np.max(girdle.axes * np.abs(p) - a2, axis=-1)
    for _ in range(60):
        q = a2 * p**2 / (a2 + t[..., None]) ** 2
        step = (q.sum(-1) - 1.0) / (2.0 * (q / (a2 + t[..., None])).sum(-1))
        t = t + step
        if np.max(np.abs(step)) < 1e-9:
            break
    foot = a2 * p / (a2 + t[..., None])
    distance = np.sign(t) * np.linalg.norm(p - foot, axis=-1)
    return distance - girdle.bulge_mm * bulge(foot / girdle.axes, girdle.bulge_azimuth)


def bulge(unit: Array, azimuth: float) -> Array:
    """Relief of a real rib cage on the unit sphere: out at the angle of the ribs, in at the spine and at the top."""
    around = np.arctan2(unit[..., 2], unit[..., 0])
    rib_angle = np.exp(-(((around - azimuth) / 0.35) ** 2))
    spine = np.exp(-(((around - 1.6) / 0.35) ** 2))
    upper = 1.0 / (1.0 + np.exp(-(unit[..., 1] - 0.45) / 0.12))
    return rib_angle - 0.8 * spine - 0.7 * upper


def points_of(degrees: Array, girdle: Girdle) -> dict[str, Array]:
    """Where the landmarks and the two conoid attachments are, thorax frame."""
    R_clavicle, R_scapula = cardan(degrees[..., :3]), cardan(degrees[..., 3:])
    ac = girdle.sc + R_clavicle @ (np.array([girdle.length, 0.0, 0.0]) + girdle.ac_shift)
    return {
        "SC": np.broadcast_to(girdle.sc, ac.shape),
        "AC": ac,
        "TS": ac + R_scapula @ girdle.ts,
        "AI": ac + R_scapula @ girdle.ai,
        "conoid_clavicle": girdle.sc + R_clavicle @ girdle.clavicle_conoid,
        "conoid_scapula": ac + R_scapula @ girdle.scapula_conoid,
    }


def chain(degrees: Array, girdle: Girdle) -> Array:
    """The three constraint residuals (mm): TS distance, AI distance, conoid length."""
    at = points_of(degrees, girdle)
    conoid = np.linalg.norm(at["conoid_scapula"] - at["conoid_clavicle"], axis=-1)
    distance = surface_distance(np.stack([at["TS"], at["AI"]]), girdle)
    wanted = [girdle.ts_distance, girdle.ai_distance, girdle.conoid_length]
    return np.stack([distance[0], distance[1], conoid], axis=-1) - wanted


def chain_slope(degrees: Array, girdle: Girdle) -> Array:
    """Central differences of the residuals, (3, 6), mm a degree."""
    h = 1e-4
    steps = h * np.eye(6)
    return ((chain(degrees + steps, girdle) - chain(degrees - steps, girdle)) / (2.0 * h)).T


def close_chain(wish: Array, start: Array, girdle: Girdle) -> Array | None:
    """The closed posture that keeps closest to the wished course, or None if the chain cannot be closed near it."""
    found = minimize(
        lambda q: float(np.sum(((q - wish) / FOLLOW_DEG) ** 2)),
        start,
        jac=lambda q: 2.0 * (q - wish) / FOLLOW_DEG**2,
        method="SLSQP",
        constraints={"type": "eq", "fun": lambda q: chain(q, girdle), "jac": lambda q: chain_slope(q, girdle)},
        options={"maxiter": 80, "ftol": 1e-5},
    )
    q, gap = found.x, chain(found.x, girdle)
    for _ in range(8):  # polish: SLSQP stops at some 1e-4 mm
        if np.max(np.abs(gap)) < 1e-9 or not np.all(np.abs(q - wish) < STRAY_DEG):
            break
        q = q - np.linalg.pinv(chain_slope(q, girdle)) @ gap
        gap = chain(q, girdle)
    return q if np.max(np.abs(gap)) < 1e-9 and np.all(np.abs(q - wish) < STRAY_DEG) else None


# ---- the effects -----------------------------------------------------------------------------------------------------


def ramp(elevation: float, onset: float, top: float) -> float:
    """Smooth rise from 0 at the onset to 1 at the top, flat at both ends."""
    x = float(np.clip((elevation - onset) / (top - onset), 0.0, 1.0))
    return x * x * (3.0 - 2.0 * x)


def late(elevation: float, onset: float, top: float, power: float = 1.8) -> float:
    """Nothing before the onset, then faster and faster to 1 at the top."""
    return float(np.clip((elevation - onset) / (top - onset), 0.0, None) ** power)


def early(elevation: float, top: float) -> float:
    """Most of the rise in the first part of the motion, 1 at the top."""
    return float((1.0 - np.exp(-elevation / 45.0)) / (1.0 - np.exp(-top / 45.0)))


def turned(axis_angle_deg: Array) -> Array:
    """Rotation matrix of an axis times an angle in degrees."""
    return Rotation.from_rotvec(axis_angle_deg, degrees=True).as_matrix()


def bend_geometry(girdle: Girdle, effect: Effect, elevation: float, breath: float) -> Girdle:
    """The girdle as the effect makes it at this elevation; effects on the measurement leave it alone."""
    size, onset, top, ratio = effect.size, effect.onset, effect.top, effect.ratio
    match effect.name:
        case "scapulothoracic_gap":  # muscle swells under the scapula and then no more; under TS less than under AI
            rise = size * ramp(elevation, onset, 0.8 * top)
            return replace(
                girdle,
                ts_distance=girdle.ts_distance + (0.3 + 0.5 * ratio) * rise,
                ai_distance=girdle.ai_distance + rise,
            )
        case "conoid_strain":  # taut only past the onset: soft toe, then straight
            soft = np.logaddexp(0.0, (elevation - onset - 15.0) / 12.0) / np.logaddexp(0.0, (top - onset - 15.0) / 12.0)
            return replace(girdle, conoid_length=girdle.conoid_length + size * float(soft))
        case "ac_translation":  # slides front-to-back early, rides up late
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
    """Clavicle, scapula and thorax frame as the laboratory takes them to be at this elevation."""
    size, onset, top, ratio = effect.size, effect.onset, effect.top, effect.ratio
    match effect.name:
        case "scapula_landmark_bias":
            R_scapula = R_scapula @ turned(size * effect.direction)
        case "clavicle_axial_estimate":  # too little axial rotation, and ever less of it late in the motion
            R_clavicle = R_clavicle @ turned(np.array([-size * late(elevation, onset, top), 0.0, 0.0]))
        case "skin_artefact":  # creeps to 90 deg, runs away above; mostly too little upward rotation
            creep = 0.3 * min(elevation, 90.0) / 90.0 + 0.7 * late(elevation, 85.0, max(top, 120.0), 1.3)
            R_scapula = R_scapula @ turned(size * creep * effect.direction)
        case "thorax_extension":  # in abduction the trunk also leans aside
            axis = np.array([1.0, 0.0, 0.0 if motion else 0.2 + 0.2 * ratio])
            frame = turned(size * ramp(elevation, onset, 1.05 * top) * axis / np.linalg.norm(axis)) @ frame
    return R_clavicle, R_scapula, frame


def laboratory_mistake(degrees: Array, effect: Effect, elevation: Array, rng: np.random.Generator) -> Array:
    """The six angles (postures, 6) after a mistake that needs the whole recording; others leave them alone."""
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


# ---- subjects and worlds ---------------------------------------------------------------------------------------------


def unit(vector: Array) -> Array:
    """The vector at length 1."""
    return vector / np.linalg.norm(vector)


def world_direction(name: str, rng: np.random.Generator) -> Array:
    """The direction that an effect has in this world, before subjects differ."""
    lean = rng.normal(size=3)
    match name:
        case "ac_translation":  # front-to-back in the clavicle frame
            mean = np.array([0.0, 0.0, rng.choice([-1.0, 1.0])])
        case "sc_translation":  # up, backward, a little toward the midline
            mean = np.array([-0.3, 0.8, 0.5])
        case "thorax_tilt":  # the rib cage leans forward or backward
            mean = np.array([1.0, 0.0, 0.25])
        case "scapula_landmark_bias":  # any, in the proportions found between AC and AA
            mean, lean = unit(lean * np.array([11.6, 12.4, 6.1])), 0.0 * lean
        case "skin_artefact":  # upward rotation lost (-z), with some tipping and protraction
            mean = np.array([0.35, -0.25, -1.0])
        case _:
            return unit(lean)
    return unit(mean + 0.2 * lean)


def draw_person(cadaver: Girdle, spread: float, rng: np.random.Generator) -> Girdle:
    """A person: another chest and another conoid on the cadaver's bones.

    A big chest is big all round; a longer rib cage has its centre lower, because its top stays at the jugular notch.
    """
    body, noise = rng.normal(), rng.normal(size=6)
    A_x, A_z = spread * (4.0 * body + 5.0 * noise[0]), spread * (4.5 * body + 5.5 * noise[1])
    A_y = spread * (6.0 * body + 16.0 * noise[2])
    M_y, M_z = spread * 11.0 * noise[3] - 0.6 * A_y, spread * 5.0 * noise[4] + 0.3 * A_z
    conoid = float(np.clip(spread * 1.1 * noise[5], -1.5, 2.5))
    return replace(
        cadaver,
        centre=cadaver.centre + np.clip([0.0, M_y, M_z], -60.0, 60.0),
        axes=cadaver.axes + np.clip([A_x, A_y, A_z], [-20.0, -60.0, -20.0], [20.0, 60.0, 20.0]),
        conoid_length=cadaver.conoid_length + conoid,
    )


def draw_wishes(motion: str, elevation: Array, offset: Array, gain: float, rng: np.random.Generator) -> Array:
    """The course a person would follow if the chain let them: mean course, own offset and range, and a slow wander."""
    low, high, power = (np.array(part, dtype=float) for part in COURSES[motion])
    x = np.clip((elevation - 20.0) / 125.0, 0.0, 1.1)[:, None]
    wander, walk = np.zeros(6), []
    for _ in elevation:
        wander = 0.6 * wander + 0.8 * rng.normal(size=6) * WANDER_DEG
        walk.append(wander)
    return low + offset + gain * (high - low) * x**power + np.array(walk)


def posture_girdle(person: Girdle, effects: list[Effect], elevation: float, breath: float) -> Girdle:
    """The person's girdle at one posture, all effects at work."""
    for effect in effects:
        person = bend_geometry(person, effect, elevation, breath)
    return person


def move(
    person: Girdle, effects: list[Effect], elevation: Array, breath: Array, rng: np.random.Generator
) -> Array | None:
    """Six true angles a posture (deg); None where the chain does not close or the course breaks."""
    offset, gain = OFFSET_DEG * rng.normal(size=6), float(np.clip(rng.normal(1.0, 0.12), 0.75, 1.25))
    middles = [draw_wishes(name, np.array([80.0]), offset, gain, rng)[0] for name in MOTIONS]
    habits = [habit for middle in middles if (habit := close_chain(middle, middle, person)) is not None]
    if len(habits) < len(middles):
        return None
    offset = offset + np.mean(habits, axis=0) - np.mean(middles, axis=0)  # one stands as one's own bones want it
    true = np.empty((len(elevation), 6))
    for number, name in enumerate(MOTIONS):
        rows = np.flatnonzero(number == MOTION)
        wishes = draw_wishes(name, elevation[rows], offset, gain, rng)
        q = wishes[0]
        for row, wish in zip(rows, wishes, strict=True):
            girdle = posture_girdle(person, effects, float(elevation[row]), float(breath[row]))
            found = close_chain(wish, q, girdle)
            if found is None:
                found = close_chain(wish, wish, girdle)
            if found is None:
                return None
            true[row] = q = found
        if np.max(np.abs(np.diff(true[rows], axis=0))) > 20.0:
            return None
    return true if np.all((true > REAL_DEG[0]) & (true < REAL_DEG[1])) else None


def measure(mover: Mover, rng: np.random.Generator) -> tuple[Array, Array]:
    """What the laboratory would write without noise: six angles, and SC, AC, TS, AI (postures, 4, 3).

    TS and AI are given by the scapula's sensor, so that they ride with the frame that the laboratory believes in.
    """
    true = mover.true
    angles, places = np.empty_like(true), np.empty((len(true), 4, 3))
    for row, e in enumerate(mover.elevation):
        girdle = posture_girdle(mover.person, mover.effects, float(e), float(mover.breath[row]))
        R_clavicle, R_scapula, frame = cardan(true[row, :3]), cardan(true[row, 3:]), np.eye(3)
        ac = points_of(true[row], girdle)["AC"]
        for effect in mover.effects:
            R_clavicle, R_scapula, frame = bend_frames(R_clavicle, R_scapula, frame, effect, float(e), int(MOTION[row]))
        angles[row] = np.concatenate([cardan_angles(frame @ R_clavicle), cardan_angles(frame @ R_scapula)])
        place = np.stack([girdle.sc, ac, ac + R_scapula @ girdle.ts, ac + R_scapula @ girdle.ai])
        places[row] = place @ frame.T
    for effect in mover.effects:
        angles = laboratory_mistake(angles, effect, mover.elevation, rng)
    return angles, places


def draw_mover(world: World, number: int, rng: np.random.Generator) -> Mover:
    """A subject whose bones close at all postures: of some people's they do not, then another is asked."""
    names = [name for name in world.typical if name != "outside_outlier_subject" or number in world.outliers]
    for redraws in range(60):
        person = draw_person(world.cadaver, world.spread, rng)
        top = world.last + rng.normal(0.0, 3.0)
        elevation = np.concatenate([np.linspace(20.0, top, 7) + rng.normal(0.0, 1.2, 7) for _ in MOTIONS])
        breath = rng.uniform(-1.0, 1.0, 14)
        effects = [
            Effect(
                name=name,
                size=world.typical[name] * world.signs[number] * float(np.clip(rng.normal(1.0, 0.25), 0.5, 1.5)),
                direction=unit(world.directions[name] + 0.12 * rng.normal(size=3)),
                onset=float(np.clip(rng.normal(45.0, 7.0), 25.0, 65.0)),
                top=float(elevation.max()),
                ratio=rng.random(),
            )
            for name in names
        ]
        true = move(person, effects, elevation, breath, rng)
        if true is not None:
            return Mover(person, effects, elevation, breath, true, redraws)
    raise RuntimeError(f"no closed chain for subject {number + 1} in 60 draws")


def draw_world(names: list[str], case: Case, rng: np.random.Generator) -> World:
    """The world of a case, before its subjects."""
    spread, last = rng.uniform(0.8, 1.2), rng.uniform(132.0, 148.0)
    typical, directions = {}, {}
    for name in names:
        sign = 1.0 if name in ONE_SIDED or name.startswith("outside_") else rng.choice([-1.0, 1.0])
        typical[name] = case.scale * sign * rng.uniform(*(SIZES | OUTSIDE_SIZES)[name])
        directions[name] = world_direction(name, rng)
    half_each = [1.0, -1.0] * ((case.subjects + 1) // 2)
    signs = rng.permutation(half_each)[: case.subjects] if case.mixed else np.ones(case.subjects)
    outliers = set(rng.permutation(case.subjects)[: max(1, case.subjects // 5)].tolist())
    cadaver = load_girdle(MODELS_FOLDER / f"{case.model}.toml")
    return World(cadaver, spread, last, typical, directions, signs, outliers)


def write_case(folder: Path, names: list[str], case: Case) -> None:
    """Make one world and write what was seen and what is true."""
    rng = np.random.default_rng([case.seed, zlib.crc32(f"{folder.parent.name}/{folder.name}".encode())])
    world, with_landmarks = draw_world(names, case, rng), case.landmark_noise_mm is not None
    rows, truths = [], []
    for number in range(case.subjects):
        subject, mover = f"simulated_{number + 1:02d}", draw_mover(world, number, rng)
        angles, places = measure(mover, rng)
        angles = angles + case.noise_deg * rng.normal(size=angles.shape)
        places = places + (case.landmark_noise_mm or 0.0) * rng.normal(size=places.shape)
        for row in range(len(angles)):
            values = [mover.elevation[row], *angles[row], *(places[row].ravel() if with_landmarks else [])]
            rows.append([subject, MOTIONS[MOTION[row]], row % 7 + 1, *(f"{value:.4f}" for value in values)])
        truths.append({"subject": subject, **truth_of(mover)})
    columns = ["subject", "motion", "posture", "humerus_elevation_deg", *(f"{angle}_deg" for angle in ANGLES)]
    if with_landmarks:
        columns += [f"{landmark}_{axis}_mm" for landmark in LANDMARKS for axis in "xyz"]
    truth = {
        "label": "+".join(names) or "none",
        "simulated": True,
        **vars(case),
        "typical_size": world.typical,
        "subjects": truths,
    }
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "motions.csv").open("w", newline="", encoding="utf-8") as handle:
        csv.writer(handle, lineterminator="\n").writerows([columns, *rows])
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


def truth_of(mover: Mover) -> dict[str, object]:
    """What is behind a subject's postures, for truth.json."""
    person = mover.person
    return {
        "redraws": mover.redraws,
        "M_y_mm": person.centre[1],
        "M_z_mm": person.centre[2],
        **dict(zip(["A_x_mm", "A_y_mm", "A_z_mm"], person.axes.tolist(), strict=True)),
        "conoid_length_mm": person.conoid_length,
        "elevation_deg": mover.elevation.tolist(),
        "effects": [{**vars(effect), "direction": effect.direction.tolist()} for effect in mover.effects],
        "breath": mover.breath.tolist(),
        "true_angles_deg": mover.true.tolist(),
    }


def write_condition(condition: str, out: Path, seed: int, noise_deg: float) -> None:
    """All cases of one condition; parameter sets take turns."""
    nones = {"ten": 4, "half": 0, "mixed": 0}.get(condition, 3)
    cases: list[list[str]] = [*([name] for name in SIZES), *([] for _ in range(nones))]
    if condition == "ten":
        cases += [*([name] for name in OUTSIDE_SIZES), *(list(pair) for pair in PAIRS)]
    turn = int(np.random.default_rng([seed, zlib.crc32(condition.encode())]).integers(len(MODELS)))
    seen: dict[str, int] = {}
    for number, names in enumerate(cases):
        label = "+".join(names) or "none"
        seen[label] = seen.get(label, -1) + 1
        case = Case(
            model=MODELS[(number + turn) % len(MODELS)],
            seed=seed,
            subjects={"one": 1, "three": 3, "landmarks": 3}.get(condition, 10),
            noise_deg=noise_deg,
            scale=0.5 if condition == "half" else 1.0,
            mixed=condition == "mixed",
            landmark_noise_mm=2.0 if condition == "landmarks" else None,
        )
        write_case(out / condition / f"{label}_{seen[label]}", names, case)


def main(
    out: Annotated[Path, typer.Argument(help="Folder of the worlds: OUT/CONDITION/NAME.", file_okay=False)],
    condition: Annotated[list[str], typer.Option(help=f"One of {', '.join(CONDITIONS)}; repeatable.")] = ["ten"],  # noqa: B006
    seed: Annotated[int, typer.Option(help="The same seed gives the same worlds.")] = 1,
    noise_deg: Annotated[float, typer.Option(min=0.0, help="SD of an angle.")] = 1.5,
) -> None:
    """Make simulated worlds with hidden effects, for scripts/check_elsewhere.py."""
    for one in condition:
        if one not in CONDITIONS:
            raise typer.BadParameter(f"{one!r} is none of {', '.join(CONDITIONS)}")
        write_condition(one, out, seed, noise_deg)
        print(f"{out / one}: done")


if __name__ == "__main__":
    typer.run(main)
