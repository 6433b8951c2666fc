"""Worlds as files: motions.csv, the laboratory's data, and truth.json.

In worlds with a discrepancy beside the causes, without_causes.csv has the data of the same people, with the same
discrepancy and noise, without any active cause: the gap of its motions is the gap that no cause explains.
"""

import csv
import json
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from scripts.research.named_causes.synthetic_b.chain import (
    Array,
    Girdle,
    cardan,
    cardan_angles,
    close_chain,
    load_girdle,
    points_of,
)
from scripts.research.named_causes.synthetic_b.effects import (
    ONE_SIDED,
    SIZES,
    Effect,
    bend_frames,
    unit,
    world_direction,
)
from scripts.research.named_causes.synthetic_b.mistakes import OUTSIDE_SIZES, laboratory_mistake
from scripts.research.named_causes.synthetic_b.people import MOTION, MOTIONS, draw_person, move, posture_girdle
from scripts.research.named_causes.synthetic_b.strengths import strengths

ANGLES = ["clavicle_y", "clavicle_z", "clavicle_x", "scapula_y", "scapula_z", "scapula_x"]
LANDMARKS = ["SC", "AC", "TS", "AI"]
MODELS = ["R2", "R4", "R6", "breteler_dissection"]
MODELS_FOLDER = Path(__file__).parents[4] / "models" / "sets"
Condition = Literal["ten", "three", "landmarks", "half", "one", "mixed", "several"]
COURSE_LENGTH = 40.0  # correlation length of the discrepancy, deg of elevation
DISCREPANCY_DEG = 0.7
SEVERAL = (1, 2, 3, 4)
WORLDS_OF_SEVERAL = 4  # worlds for each number of causes in SEVERAL
PAIRS = [
    ("skin_artefact", "clavicle_length"),
    ("scapulothoracic_gap", "sc_translation"),
    ("conoid_strain", "thorax_extension"),
    ("scapula_landmark_bias", "clavicle_axial_estimate"),
]


@dataclass(frozen=True)
class Case:
    """Settings of the measurement of a world."""

    model: str
    seed: int
    subjects: int = 10
    noise_deg: float = 1.5
    scale: float = 1.0
    mixed: bool = False
    landmark_noise_mm: float | None = None
    discrepancy_deg: float = 0.0  # SD of a smooth deviation of each angle over each motion that no cause explains


@dataclass(frozen=True)
class World:
    """Properties that the subjects of a case have in common."""

    cadaver: Girdle
    spread: float
    last: float  # deg, the largest elevation
    typical: dict[str, float]
    directions: dict[str, Array]
    signs: Array
    outliers: set[int]


@dataclass(frozen=True)
class Mover:
    """One subject, its motion and the truth about it."""

    person: Girdle
    effects: list[Effect]
    elevation: Array
    breath: Array
    true: Array  # six angles per posture, deg
    redraws: int


def measure(mover: Mover, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the laboratory's noise-free data: six angles, and SC, AC, TS, AI (postures, 4, 3).

    TS and AI come from the scapula's sensor, so that they follow the scapula frame that the laboratory measures.
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
    """Draw a subject whose chain closes in all postures; other subjects are redrawn."""
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
    """Draw the common properties of the subjects of a case."""
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
    """Make one world; write the laboratory's data and the truth."""
    rng = np.random.default_rng([case.seed, zlib.crc32(f"{folder.parent.name}/{folder.name}".encode())])
    world, with_landmarks = draw_world(names, case, rng), case.landmark_noise_mm is not None
    rows, innocent, truths, by_subject = [], [], [], {}
    for number in range(case.subjects):
        subject, mover = f"simulated_{number + 1:02d}", draw_mover(world, number, rng)
        angles, places = measure(mover, rng)
        # without a discrepancy nothing is drawn for it, so that such worlds keep the random numbers of their seed
        courses = smooth_courses(mover.elevation, rng) if case.discrepancy_deg else 0.0
        unexplained = case.discrepancy_deg * courses + case.noise_deg * rng.normal(size=angles.shape)
        places = places + (case.landmark_noise_mm or 0.0) * rng.normal(size=places.shape)
        seen = [angles + unexplained, *([places.reshape(len(places), -1)] if with_landmarks else [])]
        rows += lines_of(subject, mover, np.hstack(seen))
        if case.discrepancy_deg:
            innocent += lines_of(subject, mover, measure(without_causes(mover), rng)[0] + unexplained)
        truths.append({"subject": subject, **truth_of(mover)})
        by_subject[subject] = by_posture(mover)
    columns = ["subject", "motion", "posture", "humerus_elevation_deg", *(f"{angle}_deg" for angle in ANGLES)]
    if with_landmarks:
        columns += [f"{landmark}_{axis}_mm" for landmark in LANDMARKS for axis in "xyz"]
    truth = {
        "label": "+".join(names) or "none",
        "simulated": True,
        **vars(case),
        "typical_size": world.typical,
        "subjects": truths,
        "strengths": by_subject,
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, lines in (("motions.csv", rows), ("without_causes.csv", innocent)):
        if lines:
            with (folder / name).open("w", newline="", encoding="utf-8") as handle:
                csv.writer(handle, lineterminator="\n").writerows([columns, *lines])
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


def lines_of(subject: str, mover: Mover, values: Array) -> list[list[object]]:
    """Format one line per posture, leaving out postures with an unknown number."""
    numbers = np.column_stack([mover.elevation, values])
    return [
        [subject, MOTIONS[MOTION[row]], row % 7 + 1, *(f"{value:.4f}" for value in numbers[row])]
        for row in np.flatnonzero(np.isfinite(numbers).all(axis=1))
    ]


def without_causes(mover: Mover) -> Mover:
    """Return the same subject without active causes.

    Each posture becomes the nearest one in which the person's own chain closes; NaN where there is none.
    """
    closed = [close_chain(posture, posture, mover.person) for posture in mover.true]
    return replace(mover, effects=[], true=np.array([np.full(6, np.nan) if one is None else one for one in closed]))


def smooth_courses(elevation: Array, rng: np.random.Generator) -> Array:
    """Draw six smooth courses over each motion (postures, 6), SD 1, with correlation length COURSE_LENGTH."""
    alike = np.exp(-0.5 * ((elevation[:, None] - elevation) / COURSE_LENGTH) ** 2) * (MOTION[:, None] == MOTION)
    return np.linalg.cholesky(alike + 1e-9 * np.eye(len(elevation))) @ rng.normal(size=(len(elevation), 6))


def truth_of(mover: Mover) -> dict[str, object]:
    """Collect the truth about a subject, for truth.json."""
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


def by_posture(mover: Mover) -> dict[str, dict[str, list[float]]]:
    """Compute the strength in every posture, by effect and direction, of the effects whose form allows it."""
    postures = list(zip(mover.elevation.tolist(), mover.breath.tolist(), MOTION.tolist(), strict=True))
    found = {}
    for effect in mover.effects:
        each = [strengths(mover.person, effect, *posture) for posture in postures]
        if each[0]:
            found[effect.name] = {direction: [one[direction] for one in each] for direction in each[0]}
    return found


def write_condition(condition: Condition, out: Path, seed: int, noise_deg: float) -> None:
    """Write all cases of one condition; the parameter sets alternate."""
    nones = {"ten": 4, "half": 0, "mixed": 0}.get(condition, 3)
    rng = np.random.default_rng([seed, zlib.crc32(condition.encode())])
    turn = int(rng.integers(len(MODELS)))
    cases: list[list[str]] = [[] for _ in range(nones)]
    if condition == "several":
        every = [count for count in SEVERAL for _ in range(WORLDS_OF_SEVERAL)]
        cases = [sorted(rng.permutation(list(SIZES))[:count].tolist()) for count in every] + cases
    else:
        cases = [[name] for name in SIZES] + cases
    if condition == "ten":
        cases += [*([name] for name in OUTSIDE_SIZES), *(list(pair) for pair in PAIRS)]
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
            discrepancy_deg=DISCREPANCY_DEG if condition == "several" else 0.0,
        )
        write_case(out / condition / f"{label}_{seen[label]}", names, case)
