"""People and their motion: a wished-for course that gives way to the closed chain."""

from dataclasses import replace

import numpy as np

from scripts.research.named_causes.synthetic_b.chain import Array, Girdle, close_chain
from scripts.research.named_causes.synthetic_b.effects import Effect, bend_geometry

MOTIONS = ["abduction", "flexion"]
MOTION = np.repeat([0, 1], 7)  # index of the motion of each posture of a subject
# Mean six angles (deg, in the order of ANGLES) at 20 deg and at 145 deg of elevation, after published bone-pin means,
# and the exponent of each angle's course: below 1 most of the change is early, above 1 late.
COURSES = {
    "abduction": ([-25, 10, 4, 36, 10, -10], [-45, 24, 24, 34, 45, 0], [1.2, 1.1, 1.3, 1.0, 1.0, 1.3]),
    "flexion": ([-19, 9, 3, 42, 9, -10], [-33, 20, 22, 43, 42, 1], [1.9, 1.2, 1.5, 1.0, 1.15, 1.2]),
}
OFFSET_DEG = np.array([4.5, 3.0, 4.0, 4.0, 4.5, 3.0])
REAL_DEG = np.array([[-58, -4, -20, 12, -7, -25], [-5, 38, 62, 65, 60, 16]])  # range of real shoulders
WANDER_DEG = np.array([1.3, 0.9, 1.2, 1.2, 1.5, 0.9])


def draw_person(cadaver: Girdle, spread: float, rng: np.random.Generator) -> Girdle:
    """Draw a person: another chest and another conoid length with the cadaver's bones.

    All semi-axes of the chest vary together in part. A longer rib cage has a lower centre, because its top stays at the
    jugular notch.
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
    """Draw the course that a person would follow if the chain allowed it: mean, own offset and range, slow wander."""
    low, high, power = (np.array(part, dtype=float) for part in COURSES[motion])
    x = np.clip((elevation - 20.0) / 125.0, 0.0, 1.1)[:, None]
    wander, walk = np.zeros(6), []
    for _ in elevation:
        wander = 0.6 * wander + 0.8 * rng.normal(size=6) * WANDER_DEG
        walk.append(wander)
    return low + offset + gain * (high - low) * x**power + np.array(walk)


def posture_girdle(person: Girdle, effects: list[Effect], elevation: float, breath: float) -> Girdle:
    """Return the person's girdle in one posture with all active effects."""
    for effect in effects:
        person = bend_geometry(person, effect, elevation, breath)
    return person


def move(
    person: Girdle, effects: list[Effect], elevation: Array, breath: Array, rng: np.random.Generator
) -> Array | None:
    """Simulate six true angles per posture (deg); None where the chain does not close or the course breaks."""
    offset, gain = OFFSET_DEG * rng.normal(size=6), float(np.clip(rng.normal(1.0, 0.12), 0.75, 1.25))
    middles = [draw_wishes(name, np.array([80.0]), offset, gain, rng)[0] for name in MOTIONS]
    habits = [habit for middle in middles if (habit := close_chain(middle, middle, person)) is not None]
    if len(habits) < len(middles):
        return None
    offset = offset + np.mean(habits, axis=0) - np.mean(middles, axis=0)  # the person's own bones shift the stance
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
