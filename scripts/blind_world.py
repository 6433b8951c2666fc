"""Simulated subjects with a hidden effect: a world of its own, to test the diagnosis on.

Nothing here is shared with the effect library or the fits: rotations, distances, closed chain, courses over elevation
and the effects themselves are written anew, in NumPy alone, and a parameter set is read as plain data. A world is a
motion table, which the diagnosis may see, and the truth, which is opened after. Every number of both is simulated.

Frames and signs are those of the motion files: right shoulder, thorax frame x lateral, y up, z backward, origin IJ; a
bone's orientation is R = Ry(y) Rz(z) Rx(x). Lengths are mm; angles are deg in names that end in `_deg`, else rad.

    python scripts/blind_world.py sc_translation --model models/R2.toml --out blind.csv --truth blind.json
"""

import argparse
import json
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ANGLES = ("clavicle_y_deg", "clavicle_z_deg", "clavicle_x_deg", "scapula_y_deg", "scapula_z_deg", "scapula_x_deg")
LANDMARKS = ("SC", "AC", "TS", "AI")
PLANES_DEG = {"abduction": 0.0, "scapular_plane": 30.0, "forward_flexion": 90.0}
"""Motions and the plane of the humerus: 0 abduction, 90 forward flexion."""
ELEVATIONS_DEG = (0.0, 25.0, 50.0, 75.0, 100.0, 125.0, 150.0)
FULL_ELEVATION_DEG = 150.0
"""Where an elevation-dependent effect reaches its amplitude."""
REST_DEG = np.array([-28.57, 11.68, 7.48, 32.05, 10.67, -10.32])
REST_SD_DEG = np.array([5.0, 4.0, 4.0, 5.0, 4.0, 4.5])
SLOPE_SD = 0.12
PARAMETERS = ("M_y_mm", "M_z_mm", "A_x_mm", "A_y_mm", "A_z_mm", "conoid_length_mm")
PARAMETER_SD_MM = np.array([15.0, 5.0, 3.0, 15.0, 8.0, 1.5])
AMPLITUDE_SPREAD = 0.25
LANDMARK_NOISE_MM = 2.0
CLOSED_MM = 1e-9
"""A chain is closed below this; double precision leaves about 1e-13 mm."""
MAX_MOVE_DEG = 40.0
"""A subject whose wished-for posture lies further from the closed chain in any angle is no plausible one."""
ATTEMPTS = 40
"""Draws of one subject before its open postures are dropped."""
DEG = np.pi / 180.0
SUBJECT_STREAM, EFFECT_STREAM, NOISE_STREAM, LANDMARK_STREAM = 1, 2, 3, 4
"""Streams of random numbers: worlds of one seed share subjects and noise, whatever their effect."""


# Rotations ----------------------------------------------------------------------------------------------------------


def rotation_from_cardan(q: Array) -> Array:
    """Ry(q0) Rz(q1) Rx(q2) of angles (n, 3) in rad, as (n, 3, 3)."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(q).T, np.cos(q).T
    rows = (
        (ca * cb, sa * sc - ca * sb * cc, ca * sb * sc + sa * cc),
        (sb, cb * cc, -cb * sc),
        (-sa * cb, sa * sb * cc + ca * sc, ca * cc - sa * sb * sc),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def cardan_from_rotation(R: Array) -> Array:
    """Angles (n, 3) in rad of R = Ry Rz Rx, the middle one within +-pi/2."""
    a = np.arctan2(-R[:, 2, 0], R[:, 0, 0])
    b = np.arcsin(np.clip(R[:, 1, 0], -1.0, 1.0))
    return np.stack([a, b, np.arctan2(-R[:, 1, 2], R[:, 1, 1])], -1)


def cardan_axes(q: Array, R: Array) -> Array:
    """Axes (n, 3 axes, 3) about which the three angles turn a bone, in the thorax frame."""
    zero = np.zeros(len(q))
    first = np.stack([zero, zero + 1.0, zero], -1)
    second = np.stack([np.sin(q[:, 0]), zero, np.cos(q[:, 0])], -1)
    return np.stack([first, second, R[:, :, 0]], 1)


def rotation_from_vector(v: Array) -> Array:
    """Rotation (n, 3, 3) about v (n, 3) by |v| rad (Rodrigues)."""
    angle = np.linalg.norm(v, axis=-1)[:, None, None]
    x, y, z = v.T
    o = np.zeros(len(v))
    K = np.stack([np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], -2)
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / 2.0 / np.pi) ** 2 * (K @ K)


def vector_from_rotation(R: Array) -> Array:
    """Rotation vector (n, 3) in rad of R (n, 3, 3), for angles well below pi."""
    skew = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], -1)
    angle = np.arctan2(np.linalg.norm(skew, axis=-1), 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    return skew / np.sinc(angle / np.pi)[:, None]


def apply(R: Array, v: Array) -> Array:
    """R v, row by row."""
    return np.einsum("nij,nj->ni", R, v)


# Distance to the thorax ---------------------------------------------------------------------------------------------


def ellipsoid_foot(point: Array, semi: Array) -> Array:
    """Closest point (n, 3) of the ellipsoid |x / semi| = 1 to `point`, both about its centre, mm.

    The foot is semi^2 x / (semi^2 + t); t is the largest root of a function that falls and is convex from a start at
    its left, so that Newton's steps approach it from one side.
    """
    square = semi**2
    t = np.max(semi * np.abs(point) - square, axis=-1)
    for _ in range(100):
        ratio = semi * point / (square + t[:, None])
        value = np.sum(ratio**2, axis=-1) - 1.0
        step = 0.5 * value / np.sum(ratio**2 / (square + t[:, None]), axis=-1)
        t = t + step
        if np.all(np.abs(step) <= 1e-14 * np.max(square)):
            break
    return square * point / (square + t[:, None])


def superquadric_foot(point: Array, semi: Array, exponent: Array) -> Array:
    """Closest point (n, 3) of sum |x / semi|^p = 1 to `point`, mm: Newton on y - x + m grad F(y) = 0, F(y) = 1.

    The second derivative of F is diagonal, so a step is written out. It starts at the ellipsoid's foot, radially moved
    onto the surface, and each step is again moved onto the surface. Where that does not settle (deep inside, at the
    ridges of a small exponent) the answer is NaN, and the posture counts as open.
    """
    p, late = exponent[:, None], np.ones(len(point), dtype=bool)

    def onto(y: Array) -> Array:
        return y / np.sum(np.abs(y / semi) ** p, axis=-1, keepdims=True) ** (1.0 / p)

    def slope(y: Array) -> Array:
        return p / semi * np.sign(y) * np.abs(y / semi) ** (p - 1.0)

    y = onto(ellipsoid_foot(point, semi))
    for _ in range(60):
        g = slope(y)
        m = np.sum((point - y) * g, axis=-1, keepdims=True) / np.sum(g * g, axis=-1, keepdims=True)
        bend = p * (p - 1.0) / semi**2 * np.maximum(np.abs(y / semi), 1e-6) ** (p - 2.0)
        D = np.maximum(1.0 + m * bend, 0.2)
        r = y - point + m * g
        dm = -np.sum(g * r / D, axis=-1, keepdims=True) / np.sum(g * g / D, axis=-1, keepdims=True)
        step = -(r + g * dm) / D
        step *= np.minimum(1.0, 20.0 / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-30))
        y = onto(y + step)
        late = np.max(np.abs(step), axis=-1) > 1e-10
        if not late.any():
            break
    return np.where(late[:, None], np.nan, y)


def surface_distance(point: Array, semi: Array, exponent: Array) -> tuple[Array, Array]:
    """Signed Euclidean distance (n,) in mm, outside positive, and its gradient, the unit outward normal (n, 3)."""
    foot = ellipsoid_foot(point, semi)
    bent = exponent != 2.0
    if bent.any():
        foot[bent] = superquadric_foot(point[bent], semi[bent], exponent[bent])
    normal = np.sign(foot) * np.abs(foot / semi) ** (exponent[:, None] - 1.0) / semi
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.sum((point - foot) * normal, axis=-1), normal


# The closed chain ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Chain:
    """Geometry of n postures, each with its own numbers, mm; the first axis of every array is the posture."""

    centre: Array
    semi: Array
    exponent: Array
    R_thorax_surface: Array
    sc: Array
    length: Array
    ac_shift: Array
    """Of the AC centre, in the clavicle frame."""
    clavicle_conoid: Array
    ts: Array
    ai: Array
    scapula_conoid: Array
    targets: Array
    """Distance of TS, distance of AI, length of the conoid (n, 3)."""

    def rows(self, keep: NDArray[np.bool_]) -> "Chain":
        """The chain of some of the postures."""
        return Chain(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})

    def points(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """SC, AC, TS, AI (n, 3) in the thorax frame, mm, at angles q (n, 6) in rad."""
        R_C, R_S = rotation_from_cardan(q[:, :3]), rotation_from_cardan(q[:, 3:])
        ac = self.sc + apply(R_C, self.clavicle_end())
        return self.sc, ac, ac + apply(R_S, self.ts), ac + apply(R_S, self.ai)

    def clavicle_end(self) -> Array:
        """AC in the clavicle frame (n, 3)."""
        return self.ac_shift + self.length[:, None] * np.array([1.0, 0.0, 0.0])

    def gap(self, q: Array) -> tuple[Array, Array]:
        """How far A1-A3 are from closed (n, 3) in mm, and the derivative (n, 3, 6) in mm/rad, at q (n, 6) in rad."""
        R_C, R_S = rotation_from_cardan(q[:, :3]), rotation_from_cardan(q[:, 3:])
        axes_C, axes_S = cardan_axes(q[:, :3], R_C), cardan_axes(q[:, 3:], R_S)
        end = apply(R_C, self.clavicle_end())
        ac = self.sc + end
        gap, slope = [], []
        for arm in (apply(R_S, self.ts), apply(R_S, self.ai)):
            local = apply(np.swapaxes(self.R_thorax_surface, 1, 2), ac + arm - self.centre)
            distance, normal = surface_distance(local, self.semi, self.exponent)
            n = apply(self.R_thorax_surface, normal)[:, None]
            gap.append(distance)
            slope.append(_turn(n, axes_C, end, axes_S, arm))
        arm, root = apply(R_S, self.scapula_conoid), apply(R_C, self.clavicle_conoid)
        conoid = end + arm - root
        length = np.linalg.norm(conoid, axis=-1)
        gap.append(length)
        slope.append(_turn((conoid / length[:, None])[:, None], axes_C, end - root, axes_S, arm))
        return np.stack(gap, -1) - self.targets, np.stack(slope, 1)

    def close(self, wish: Array) -> tuple[Array, Array]:
        """The closed posture near `wish` (n, 6) in rad by damped least-norm Gauss-Newton steps, and its gap in mm."""
        q = wish.copy()
        gap, G = self.gap(q)
        for _ in range(60):
            going = np.max(np.abs(gap), axis=-1) > 1e-12
            if not going.any():
                break
            g, Gg = gap[going], G[going]
            size = np.linalg.norm(g, axis=-1)[:, None, None]
            GG = Gg @ np.swapaxes(Gg, 1, 2) + 5.0 * np.minimum(size, 10.0) * np.eye(3)
            step = np.einsum("nij,ni->nj", Gg, np.linalg.solve(GG, g[:, :, None])[:, :, 0])
            step *= np.minimum(1.0, 0.25 / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-30))
            q[going] -= step
            gap[going], G[going] = self.rows(going).gap(q[going])
        return q, gap


def _turn(n: Array, axes_C: Array, arm_C: Array, axes_S: Array, arm_S: Array) -> Array:
    """Derivative (n, 6) along n of a point that hangs on clavicle arm and scapula arm."""
    by_C = np.sum(n * np.cross(axes_C, arm_C[:, None]), axis=-1)
    return np.concatenate([by_C, np.sum(n * np.cross(axes_S, arm_S[:, None]), axis=-1)], -1)


def read_chain(path: str | Path, n: int) -> tuple[str, Chain]:
    """Name and geometry of a parameter set (TOML), the same in all n postures."""
    data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    thorax, clavicle, scapula, constraint = (data[k] for k in ("thorax", "clavicle", "scapula", "constraint"))
    targets = [constraint[k] for k in ("ts_distance_mm", "ai_distance_mm", "conoid_length_mm")]

    def tile(value: Any) -> Array:
        return np.tile(np.asarray(value, dtype=np.float64), (n,) + (1,) * np.ndim(value))

    chain = Chain(
        centre=tile(thorax["centre_mm"]),
        semi=tile(thorax["semi_axes_mm"]),
        exponent=np.full(n, 2.0),
        R_thorax_surface=tile(np.eye(3)),
        sc=tile(clavicle["sc_mm"]),
        length=np.full(n, float(clavicle["length_mm"])),
        ac_shift=np.zeros((n, 3)),
        clavicle_conoid=tile(clavicle["conoid_mm"]),
        ts=tile(scapula["ts_mm"]),
        ai=tile(scapula["ai_mm"]),
        scapula_conoid=tile(scapula["conoid_mm"]),
        targets=tile(targets),
    )
    return data["name"], chain


# Subjects and their motions -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Postures:
    """Which posture is whose: n postures of all subjects, in the order of the table."""

    subjects: int
    motions: tuple[str, ...]
    subject: Index
    motion: Index
    number: Index
    """1, 2, ... within a motion."""
    session: Array
    """Place in the subject's session, 0 the first posture, 1 the last."""
    elevation_deg: Array
    plane_deg: Array


def lay_out(subjects: int, motions: Sequence[str], elevations_deg: Sequence[float]) -> Postures:
    """All postures: subjects x motions x elevations."""
    shape = (subjects, len(motions), len(elevations_deg))
    subject, motion, posture = (i.ravel() for i in np.indices(shape))
    order = motion * shape[2] + posture
    return Postures(
        subjects=subjects,
        motions=tuple(motions),
        subject=subject,
        motion=motion,
        number=posture + 1,
        session=order / max(shape[1] * shape[2] - 1, 1),
        elevation_deg=np.asarray(elevations_deg, dtype=np.float64)[posture],
        plane_deg=np.array([PLANES_DEG[m] for m in motions])[motion],
    )


@dataclass(frozen=True)
class Subjects:
    """What makes a subject: s rows."""

    parameter_mm: Array
    """Offsets of PARAMETERS from the parameter set (s, 6)."""
    rest_deg: Array
    slope: Array
    """Factors on the ten slopes of the rhythm (s, 10)."""
    axial_deg: Array
    """Axial rotation of the clavicle between hanging and 120 deg (s,)."""


def draw_subject(seed: int, number: int, attempt: int) -> Subjects:
    """One subject (s = 1); the same whatever the effect."""
    rng = np.random.default_rng([seed, SUBJECT_STREAM, number, attempt])

    def bell(n: int) -> Array:
        return np.clip(rng.standard_normal((1, n)), -2.2, 2.2)

    return Subjects(
        parameter_mm=PARAMETER_SD_MM * bell(6),
        rest_deg=REST_DEG + REST_SD_DEG * bell(6),
        slope=1.0 + SLOPE_SD * bell(10),
        axial_deg=rng.uniform(25.0, 35.0, 1),
    )


def join(parts: Sequence[Subjects]) -> Subjects:
    """Subjects one below the other."""
    names = ("parameter_mm", "rest_deg", "slope", "axial_deg")
    return Subjects(**{k: np.concatenate([getattr(p, k) for p in parts]) for k in names})


def rhythm_deg(people: Subjects, postures: Postures) -> Array:
    """Wished-for angles (n, 6) in deg: the regressions of de Groot & Brand 2001, the axial rotation on its own course.

    The plane of elevation fades in over the first 30 deg: a hanging arm has none.
    """
    s, Hz = postures.subject, postures.elevation_deg
    Hy = postures.plane_deg * -np.expm1(-((Hz / 15.0) ** 2))
    rest, k = people.rest_deg[s].T, people.slope[s].T
    bent = np.expm1(-1.5 * (Hz / 120.0) ** 1.5) / np.expm1(-1.5)
    columns = (
        -4.983 + 0.120 * k[0] * Hy - 0.242 * k[1] * Hz + 0.851 * rest[0],
        3.917 - 0.046 * k[2] * Hy + 0.123 * k[3] * Hz + 0.493 * rest[1],
        rest[2] + people.axial_deg[s] * bent,
        -1.203 + 0.140 * k[4] * Hy - 0.049 * k[5] * Hz + 0.901 * rest[3],
        3.095 - 0.079 * k[6] * Hy + 0.396 * k[7] * Hz + 0.414 * rest[4],
        0.659 - 0.028 * k[8] * Hy + 0.184 * k[9] * Hz + 0.886 * rest[5],
    )
    return np.stack(columns, -1)


def with_parameters(chain: Chain, people: Subjects, postures: Postures) -> Chain:
    """The chain with each subject's own thorax and conoid, mm."""
    d = people.parameter_mm[postures.subject]
    centre, semi, targets = chain.centre.copy(), chain.semi.copy(), chain.targets.copy()
    centre[:, 1:] += d[:, :2]
    semi += d[:, 2:5]
    targets[:, 2] += d[:, 5]
    floor = 0.4 * chain.semi
    return replace(chain, centre=centre, semi=np.maximum(semi, floor), targets=targets)


# Courses over elevation ---------------------------------------------------------------------------------------------
# Each is 0 with the arm hanging and 1 at full elevation, of x = elevation / full elevation; none is a straight line.


def _between(raw: Callable[[Array], Array], x: Array) -> Array:
    low, high = raw(np.zeros_like(x)), raw(np.ones_like(x))
    return (raw(x) - low) / (high - low)


def _step(x: Array, start: Array, end: Array) -> Array:
    u = np.clip((x - start) / (end - start), 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


COURSES: dict[str, tuple[tuple[tuple[float, float], ...], Callable[[Array, Array], Array]]] = {
    "sigmoid": (((0.4, 0.65), (0.08, 0.15)), lambda x, k: _between(lambda u: np.tanh((u - k[0]) / (2.0 * k[1])), x)),
    "smoothstep": (((0.05, 0.2), (0.75, 0.95)), lambda x, k: _step(x, k[0], k[1])),
    "late": (((0.4, 0.55), (1.0, 1.25)), lambda x, k: _between(lambda u: _step(u, k[0], k[1]), x)),
    "power": (((1.3, 2.5),), lambda x, k: x ** k[0]),
    "cosine": (((0.9, 1.1),), lambda x, k: _between(lambda u: 1.0 - np.cos(np.pi * u * k[0]), x)),
    "saturating": (((0.18, 0.45),), lambda x, k: _between(lambda u: -np.exp(-u / k[0]), x)),
    "hinge": (((0.3, 0.5), (0.05, 0.1)), lambda x, k: _between(lambda u: np.logaddexp(0.0, (u - k[0]) / k[1]), x)),
    "wiggle": (((1.3, 1.8), (0.06, 0.12)), lambda x, k: x ** k[0] + k[1] * np.sin(2.0 * np.pi * x)),
}
"""Per course the ranges of its shape parameters, drawn once a world, and the course itself."""


@dataclass
class Draw:
    """What one hidden effect draws for a world; `notes` goes to the truth."""

    postures: Postures
    amplitude: Array
    """One a subject, in the effect's unit, size and sign included (s,)."""
    rng: np.random.Generator
    notes: dict[str, Any] = field(default_factory=dict)

    def constant(self) -> Array:
        """The amplitude at every posture (n,)."""
        return self.amplitude[self.postures.subject]

    def level(self, *courses: str) -> Array:
        """Amplitude times a course over elevation (n,): drawn once a world, bent a little by subject and motion."""
        s, postures = self.postures.subject, self.postures
        name = str(self.rng.choice(courses))
        ranges, course = COURSES[name]
        shape = np.array([self.rng.uniform(*r) for r in ranges])
        own = shape[:, None] * (1.0 + 0.07 * np.clip(self.rng.standard_normal((len(shape), postures.subjects)), -2, 2))
        offset = 0.03 * np.clip(self.rng.standard_normal(postures.subjects), -2.0, 2.0)
        by_motion = np.concatenate([[1.0], self.rng.uniform(0.85, 1.15, len(postures.motions) - 1)])
        f = course(postures.elevation_deg / FULL_ELEVATION_DEG, own[:, s])
        self.notes |= {"course": name, "shape": shape, "shape_by_subject": own.T, "offset_fraction": offset}
        self.notes |= {"factor_by_motion": dict(zip(postures.motions, by_motion.tolist(), strict=True))}
        return self.constant() * (offset[s] + (1.0 - offset[s]) * f) * by_motion[postures.motion]

    def direction(self, mean: Sequence[float], world_sd: float, subject_sd: float = 0.15) -> Array:
        """Unit vectors at every posture (n, 3): one direction near `mean` a world, each subject's near that."""
        common = np.asarray(mean) + world_sd * self.rng.standard_normal(3)
        common /= np.linalg.norm(common)
        own = common + subject_sd * self.rng.standard_normal((self.postures.subjects, 3))
        own /= np.linalg.norm(own, axis=-1, keepdims=True)
        self.notes |= {"direction": common, "direction_by_subject": own}
        return own[self.postures.subject]

    def pick(self, key: str, options: Sequence[Any]) -> Any:
        """One of the options, noted under `key`."""
        self.notes[key] = options[int(self.rng.integers(len(options)))]
        return self.notes[key]


@dataclass(frozen=True)
class Change:
    """What an effect changes: the chain, or the angles that are measured of it (n, 6) in rad, or neither."""

    chain: Callable[[Chain], Chain] = lambda chain: chain
    angles: Callable[[Array], Array] = lambda q: q
    moves_landmarks: str = ""
    """'' they stay on the true bones; 'scapula' TS and AI follow the measured scapula; 'all' turn with the frame."""
    turn: Array | None = None
    """For 'all': the rotation vector of the frame (n, 3) in rad."""


# The listed effects: the chain ---------------------------------------------------------------------------------------


def scapulothoracic_gap(w: Draw) -> Change:
    """AI leaves the thorax by the amplitude at full elevation, TS by a fraction of either sign, mm."""
    fraction = w.rng.uniform(-0.8, 0.8) + 0.1 * w.rng.standard_normal(w.postures.subjects)
    w.notes["ts_fraction_by_subject"] = fraction
    ai = w.level("power", "smoothstep")
    more = np.stack([fraction[w.postures.subject] * ai, ai, 0.0 * ai], -1)
    return Change(chain=lambda c: replace(c, targets=c.targets + more))


def conoid_strain(w: Draw) -> Change:
    """The conoid becomes longer by the amplitude at full elevation, never shorter, mm."""
    more = np.maximum(w.level("hinge", "late"), 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    return Change(chain=lambda c: replace(c, targets=c.targets + more))


def ac_translation(w: Draw) -> Change:
    """The AC centre moves in the clavicle frame, mostly forward or backward, mm."""
    shift = w.level("sigmoid", "wiggle")[:, None] * w.direction((0.0, 0.0, 1.0), 0.3)
    return Change(chain=lambda c: replace(c, ac_shift=c.ac_shift + shift))


def sc_translation(w: Draw) -> Change:
    """The SC centre moves in the thorax frame, in any direction, mm."""
    shift = w.level("saturating", "cosine")[:, None] * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(chain=lambda c: replace(c, sc=c.sc + shift))


def thorax_tilt(w: Draw) -> Change:
    """The axes of the thorax are turned, mostly about x, deg.

    The pivot lies 100 mm below IJ, where the scapula is, and the centre stays in the midline: a turn about the centre
    of a long thorax would push its wall 20 mm through the scapula.
    """
    R = rotation_from_vector(w.constant()[:, None] * DEG * w.direction((1.0, 0.0, 0.0), 0.35))

    def tilt(c: Chain) -> Chain:
        arm = c.centre.copy()
        arm[:, 1] += 100.0
        arm[:, [0, 2]] = 0.0
        centre = c.centre + apply(R, arm) - arm
        centre[:, 0] = c.centre[:, 0]
        return replace(c, centre=centre, R_thorax_surface=c.R_thorax_surface @ R)

    return Change(chain=tilt)


def thorax_asymmetry(w: Draw) -> Change:
    """The centre of the thorax lies beside the midline, mm."""
    shift = w.constant()[:, None] * np.array([1.0, 0.0, 0.0])
    return Change(chain=lambda c: replace(c, centre=c.centre + shift))


def thorax_shape(w: Draw) -> Change:
    """The thorax is a superquadric of exponent 2 + amplitude with the same semi-axes."""
    exponent = np.maximum(2.0 + w.constant(), 1.2)
    return Change(chain=lambda c: replace(c, exponent=exponent))


def clavicle_length(w: Draw) -> Change:
    """The shaft of the clavicle is longer or shorter, %; the conoid attachment nearly keeps its distance from AC.

    A clavicle scaled as a whole would pull its attachment so far from the scapula's that no conoid could reach.
    """
    share = w.rng.uniform(0.8, 1.0)
    w.notes["attachment_moves_by"] = share

    def lengthen(c: Chain) -> Chain:
        more = c.length * w.constant() / 100.0
        conoid = c.clavicle_conoid + share * more[:, None] * np.array([1.0, 0.0, 0.0])
        return replace(c, length=c.length + more, clavicle_conoid=conoid)

    return Change(chain=lengthen)


def scapula_size(w: Draw) -> Change:
    """The blade of the scapula is larger or smaller, %: its height nearly as its width, the coracoid by a share."""
    height = 1.0 + 0.15 * w.rng.standard_normal(w.postures.subjects)
    coracoid = w.rng.uniform(0.3, 0.7)
    w.notes |= {"height_share_by_subject": height, "coracoid_share": coracoid}
    share = np.ones((len(w.postures.subject), 3))
    share[:, 1] = height[w.postures.subject]
    more = w.constant()[:, None] / 100.0 * share
    return Change(
        chain=lambda c: replace(
            c,
            ts=c.ts * (1.0 + more),
            ai=c.ai * (1.0 + more),
            scapula_conoid=c.scapula_conoid * (1.0 + coracoid * more),
        )
    )


# The listed effects: the measurement ---------------------------------------------------------------------------------


def turned(q: Array, bone: int, vector: Array, left: bool = False) -> Array:
    """Angles q (n, 6) with bone 0 (clavicle) or 1 (scapula) turned by a vector (n, 3) in rad.

    The vector is in the bone's own frame or, left, in the thorax frame.
    """
    part = slice(3 * bone, 3 * bone + 3)
    R, E = rotation_from_cardan(q[:, part]), rotation_from_vector(vector)
    out = q.copy()
    out[:, part] = cardan_from_rotation(E @ R if left else R @ E)
    return out


def scapula_landmark_bias(w: Draw) -> Change:
    """The scapula's frame is turned in the scapula by a constant rotation about any axis, deg."""
    vector = w.constant()[:, None] * DEG * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(angles=lambda q: turned(q, 1, vector))


def clavicle_axial_estimate(w: Draw) -> Change:
    """The measured axial rotation of the clavicle stays behind the true one by the amplitude at full elevation, deg."""
    lag = w.level("saturating", "sigmoid", "power")[:, None] * DEG * np.eye(6)[2]
    return Change(angles=lambda q: q - lag)


def skin_artefact(w: Draw) -> Change:
    """The measured scapula stays behind on the way it really turns from its lowest posture, mostly above 90 deg, deg.

    Internal rotation takes a small part in it, lateral rotation and tipping the most.
    """
    level = w.level("late", "hinge")
    n = w.postures
    weight = np.array([1.0, 0.3, 1.0]) * np.exp(0.2 * w.rng.standard_normal((n.subjects, 3)))
    w.notes["weight_by_subject"] = weight
    group = n.subject * len(n.motions) + n.motion
    low = np.array([min(np.flatnonzero(group == g), key=lambda i: n.elevation_deg[i]) for g in group])
    top = np.array([max(np.flatnonzero(group == g), key=lambda i: n.elevation_deg[i]) for g in group])

    def lagging(q: Array) -> Array:
        R = rotation_from_cardan(q[:, 3:])
        way = vector_from_rotation(np.swapaxes(R[low], 1, 2) @ R[top]) * weight[n.subject]
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        return turned(q, 1, -DEG * level[:, None] * way)

    return Change(angles=lagging, moves_landmarks="scapula")


def thorax_extension(w: Draw) -> Change:
    """The trunk leans back by the amplitude at full elevation, mostly about x, and takes both bones along, deg."""
    vector = w.level("cosine", "late", "power")[:, None] * DEG * w.direction((1.0, 0.0, 0.0), 0.2, 0.1)
    return Change(
        angles=lambda q: turned(turned(q, 0, vector, left=True), 1, vector, left=True),
        moves_landmarks="all",
        turn=vector,
    )


# Effects outside the list --------------------------------------------------------------------------------------------


def outside_sign_flip(w: Draw) -> Change:
    """One angle has the wrong sign, about zero or about the subject's own mean; amplitude 1 is the whole flip."""
    column, about = w.pick(
        "flipped", [("scapula_x_deg", "zero"), ("scapula_x_deg", "mean"), ("clavicle_z_deg", "mean")]
    )
    j = ANGLES.index(column)

    def flip(q: Array) -> Array:
        out = q.copy()
        pivot = _subject_mean(q[:, j], w.postures) if about == "mean" else 0.0
        out[:, j] -= 2.0 * w.constant() * (q[:, j] - pivot)
        return out

    return Change(angles=flip)


def outside_mid_winging(w: Draw) -> Change:
    """The scapula wings in mid-range only: internal rotation and forward tipping, a bump of the amplitude, deg."""
    centre, width = w.rng.uniform(65.0, 85.0), w.rng.uniform(15.0, 24.0)
    own = centre + 5.0 * w.rng.standard_normal(w.postures.subjects)
    w.notes |= {"centre_deg_by_subject": own, "width_deg": width}
    bump = np.exp(-0.5 * ((w.postures.elevation_deg - own[w.postures.subject]) / width) ** 2)
    vector = (w.constant() * bump * DEG)[:, None] * w.direction((-0.5, 0.85, 0.0), 0.15)
    return Change(angles=lambda q: turned(q, 1, vector), moves_landmarks="scapula")


def outside_swapped_columns(w: Draw) -> Change:
    """Two columns have changed places; amplitude 1 is the whole swap, less mixes them."""
    pairs = [
        ("scapula_z_deg", "clavicle_z_deg"),
        ("clavicle_x_deg", "scapula_y_deg"),
    ]
    i, j = (ANGLES.index(column) for column in w.pick("swapped", pairs))

    def swap(q: Array) -> Array:
        out = q.copy()
        out[:, i] += w.constant() * (q[:, j] - q[:, i])
        out[:, j] += w.constant() * (q[:, i] - q[:, j])
        return out

    return Change(angles=swap)


def outside_hysteresis(w: Draw) -> Change:
    """One bone is turned one way in one motion and the other way in the next, most in mid-range, deg."""
    bone = w.pick("bone", ["clavicle", "scapula"])
    sign = np.where(w.postures.motion % 2 == 0, 1.0, -1.0)
    arc = 0.5 + 0.5 * np.sin(np.pi * w.postures.elevation_deg / 180.0)
    vector = (w.constant() * sign * arc * DEG)[:, None] * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(angles=lambda q: turned(q, ("clavicle", "scapula").index(bone), vector))


def outside_crosstalk(w: Draw) -> Change:
    """One angle leaks, squared, into another: amplitude at 20 deg from the source's mean, deg."""
    pairs = [
        ("clavicle_y_deg", "scapula_x_deg"),
        ("scapula_z_deg", "clavicle_z_deg"),
        ("clavicle_x_deg", "scapula_y_deg"),
    ]
    source, target = w.pick("from_to", pairs)
    i, j = ANGLES.index(source), ANGLES.index(target)

    def leak(q: Array) -> Array:
        out = q.copy()
        u = (q[:, i] - _subject_mean(q[:, i], w.postures)) / (20.0 * DEG)
        out[:, j] += w.constant() * DEG * 2.0 * u**2 / (1.0 + u**2)
        return out

    return Change(angles=leak)


def outside_step(w: Draw) -> Change:
    """A marker moves near 90 deg: one bone is turned by a constant rotation from there on, deg.

    Either it slips back with every motion, or it slips once, in the first, and stays for the session.
    """
    bone, mode = w.pick("bone", ["clavicle", "scapula"]), w.pick("slips", ["in every motion", "once"])
    at = 90.0 + 12.0 * w.rng.uniform(-1.0, 1.0, w.postures.subjects)
    w.notes["at_deg_by_subject"] = at
    after = w.postures.elevation_deg > at[w.postures.subject]
    if mode == "once":
        after |= w.postures.motion > 0
    vector = (w.constant() * after * DEG)[:, None] * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(angles=lambda q: turned(q, ("clavicle", "scapula").index(bone), vector))


def outside_drift(w: Draw) -> Change:
    """One angle drifts with the number of the posture, over all motions of the session, deg at the last."""
    j = ANGLES.index(w.pick("angle", ["clavicle_z_deg", "scapula_y_deg", "scapula_x_deg"]))
    power = w.rng.uniform(0.6, 1.8)
    w.notes["power"] = power
    more = (w.constant() * DEG * w.postures.session**power)[:, None] * np.eye(6)[j]
    return Change(angles=lambda q: q + more)


def outside_breathing(w: Draw) -> Change:
    """The thorax becomes deeper and shallower with the breath, which knows nothing of the arm: half the swing, mm."""
    turns, phase = w.rng.uniform(2.2, 4.4), w.rng.uniform(0.0, 2.0 * np.pi, w.postures.subjects)
    w.notes |= {"breaths_a_session": turns, "phase_rad_by_subject": phase}
    swing = w.constant() * np.sin(2.0 * np.pi * turns * w.postures.session + phase[w.postures.subject])
    more = swing[:, None] * np.array([0.3, 0.0, 1.0])
    return Change(chain=lambda c: replace(c, semi=c.semi + more))


def outside_gain(w: Draw) -> Change:
    """One angle is too large by a factor, as after a wrong calibration, %."""
    j = ANGLES.index(w.pick("angle", ["clavicle_y_deg", "clavicle_z_deg", "scapula_y_deg"]))
    factor = 1.0 + (w.constant() / 100.0)[:, None] * np.eye(6)[j]
    return Change(angles=lambda q: q * factor)


def _subject_mean(value: Array, postures: Postures) -> Array:
    """Each subject's mean of a value (n,), at each of its postures (n,)."""
    total = np.bincount(postures.subject, value, postures.subjects)
    return (total / np.bincount(postures.subject, minlength=postures.subjects))[postures.subject]


@dataclass(frozen=True)
class Effect:
    """How large an effect is at size 1, in which unit, and whether its sign is its nature's or drawn."""

    make: Callable[[Draw], Change]
    scale: float
    unit: str
    sign: str = "drawn"
    """'drawn' once a world; 'natural' positive; either is drawn per subject with mixed_sign; 'one-sided' never is."""
    spread: float = AMPLITUDE_SPREAD


EFFECTS: dict[str, Effect] = {
    "scapulothoracic_gap": Effect(scapulothoracic_gap, 7.5, "mm"),
    "conoid_strain": Effect(conoid_strain, 3.0, "mm", "one-sided"),
    "ac_translation": Effect(ac_translation, 4.5, "mm"),
    "sc_translation": Effect(sc_translation, 5.5, "mm"),
    "thorax_tilt": Effect(thorax_tilt, 7.5, "deg"),
    "thorax_asymmetry": Effect(thorax_asymmetry, 7.5, "mm"),
    "thorax_shape": Effect(thorax_shape, 0.3, "1"),
    "clavicle_length": Effect(clavicle_length, 8.0, "%"),
    "scapula_size": Effect(scapula_size, 8.0, "%"),
    "scapula_landmark_bias": Effect(scapula_landmark_bias, 8.0, "deg"),
    "clavicle_axial_estimate": Effect(clavicle_axial_estimate, 17.0, "deg", "natural"),
    "skin_artefact": Effect(skin_artefact, 9.5, "deg", "natural"),
    "thorax_extension": Effect(thorax_extension, 9.5, "deg", "natural"),
    "outside_sign_flip": Effect(outside_sign_flip, 1.0, "1", "one-sided", 0.0),
    "outside_mid_winging": Effect(outside_mid_winging, 12.0, "deg", "natural"),
    "outside_swapped_columns": Effect(outside_swapped_columns, 1.0, "1", "one-sided", 0.0),
    "outside_hysteresis": Effect(outside_hysteresis, 9.0, "deg"),
    "outside_crosstalk": Effect(outside_crosstalk, 10.0, "deg"),
    "outside_step": Effect(outside_step, 10.0, "deg"),
    "outside_drift": Effect(outside_drift, 13.0, "deg"),
    "outside_breathing": Effect(outside_breathing, 9.0, "mm"),
    "outside_gain": Effect(outside_gain, 35.0, "%", "one-sided"),
}
LABELS = ("none", *EFFECTS)
"""Every single label; two effects at once are 'a+b'."""


# The world ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class World:
    """Simulated subjects: the table for the diagnosis, the truth for afterwards, and arrays for checks, row by row."""

    table: pd.DataFrame
    truth: dict[str, Any]
    clean_deg: Array
    """Measured angles without noise (n, 6)."""
    true_deg: Array
    """The closed posture itself (n, 6)."""
    closure_mm: Array
    """A1-A3 of the true chain, effect included, at the true posture (n, 3)."""
    gap_mm: Array
    """A1-A3 of the subject's chain without the effect, at the measured angles without noise (n, 3)."""


def effects_of(label: str) -> list[str]:
    """The effects that a label names: none, one, or two joined by '+'."""
    names = [] if label == "none" else label.split("+")
    unknown = [name for name in names if name not in EFFECTS]
    if unknown or len(set(names)) != len(names):
        raise ValueError(f"no effect is called {label!r}. Take one of {', '.join(LABELS)}, or two joined by '+'")
    return names


def draw_effect(name: str, postures: Postures, size: float, seed: int, mixed_sign: bool) -> tuple[Change, Draw]:
    """Amplitudes and shapes of one effect; `size` scales the amplitudes and changes no other draw."""
    effect = EFFECTS[name]
    rng = np.random.default_rng([seed, EFFECT_STREAM, LABELS.index(name)])
    spread = np.maximum(1.0 + effect.spread * rng.standard_normal(postures.subjects), 0.3)
    world_sign, signs = rng.choice([-1.0, 1.0]), rng.choice([-1.0, 1.0], postures.subjects)
    if effect.sign == "one-sided":
        signs = np.ones(postures.subjects)
    elif not mixed_sign:
        signs = np.full(postures.subjects, world_sign if effect.sign == "drawn" else 1.0)
    draw = Draw(postures, size * effect.scale * spread * signs, rng)
    return effect.make(draw), draw


def make_world(
    label: str,
    model_toml_path: str | Path,
    subjects: int = 10,
    noise_deg: float = 1.5,
    size: float = 1.0,
    seed: int = 0,
    motions: Sequence[str] = ("abduction", "forward_flexion"),
    elevations: Sequence[float] = ELEVATIONS_DEG,
    mixed_sign: bool = False,
    landmarks: bool = False,
) -> World:
    """Simulated subjects with the effect `label` hidden in their motions.

    `noise_deg` is the SD on each angle, `size` a factor on the amplitudes (0 is no effect), `elevations` are of the
    humerus in deg, `mixed_sign` draws the effect's sign for each subject, `landmarks` adds columns in mm.
    """
    names = effects_of(label)
    if unknown := [m for m in motions if m not in PLANES_DEG]:
        raise ValueError(f"no motion is called {unknown[0]!r}. Take some of {', '.join(PLANES_DEG)}")
    if size < 0.0 or noise_deg < 0.0 or subjects < 1 or not len(motions) or not len(elevations):
        raise ValueError("sizes and noises are at least 0, and there is a subject, a motion and an elevation at least")
    postures = lay_out(subjects, motions, elevations)
    model, base = read_chain(model_toml_path, len(postures.subject))
    hidden = {name: draw_effect(name, postures, size, seed, mixed_sign) for name in names}
    changes = [change for change, _ in hidden.values()]

    people, own, chain, q, closure, open_ = close_subjects(base, postures, changes, seed)
    measured, points = measure(chain, q, changes)
    gap, _ = own.gap(measured)

    shape = (subjects, len(postures.subject) // subjects)
    noise = np.random.default_rng([seed, NOISE_STREAM]).standard_normal((*shape, 6)).reshape(-1, 6) * noise_deg
    columns: dict[str, Any] = {
        "subject": [f"simulated{s + 1:02d}" for s in postures.subject],
        "motion": [postures.motions[m] for m in postures.motion],
        "posture": postures.number,
        "humerus_elevation_deg": postures.elevation_deg,
    }
    columns |= dict(zip(ANGLES, (measured / DEG + noise).T, strict=True))
    if landmarks:
        shake = np.random.default_rng([seed, LANDMARK_STREAM]).standard_normal((4, len(q), 3)) * LANDMARK_NOISE_MM
        for name, point, more in zip(LANDMARKS, points, shake, strict=True):
            columns |= {f"{name}_{axis}_mm": (point + more)[:, k] for k, axis in enumerate("xyz")}
    table = pd.DataFrame(columns)
    keep = ~open_
    truth = tell(label, model, base, postures, people, hidden, size, noise_deg, seed, mixed_sign, open_)
    return World(
        table.drop(index=np.flatnonzero(open_)).reset_index(drop=True),
        truth,
        measured[keep] / DEG,
        q[keep] / DEG,
        closure[keep],
        gap[keep],
    )


def close_subjects(
    base: Chain, postures: Postures, changes: Sequence[Change], seed: int
) -> tuple[Subjects, Chain, Chain, Array, Array, NDArray[np.bool_]]:
    """Subjects whose chains close with the effects at work.

    Returned: the subjects, their chains without and with the effects, the closed postures (n, 6) in rad, their gap
    (n, 3) in mm, and which postures stayed open. A subject with an open or far-off posture is drawn anew, the others
    are kept.
    """
    drawn = [draw_subject(seed, s, 0) for s in range(postures.subjects)]
    n = len(postures.subject)
    q, gap, new = np.zeros((n, 6)), np.zeros((n, 3)), np.ones(n, dtype=bool)
    attempt = 0
    while True:
        people = join(drawn)
        own = chain = with_parameters(base, people, postures)
        for change in changes:
            chain = change.chain(chain)
        wish = rhythm_deg(people, postures) * DEG
        q[new], gap[new] = chain.rows(new).close(wish[new])
        far = np.max(np.abs(q - wish), axis=-1) > MAX_MOVE_DEG * DEG
        open_ = ~(np.max(np.abs(gap), axis=-1) < CLOSED_MM) | far
        attempt += 1
        if not open_.any() or attempt == ATTEMPTS:
            return people, own, chain, q, gap, open_
        again = np.unique(postures.subject[open_])
        new = np.isin(postures.subject, again)
        for s in again:
            drawn[s] = draw_subject(seed, int(s), attempt)


def measure(chain: Chain, q: Array, changes: Sequence[Change]) -> tuple[Array, list[Array]]:
    """Angles (n, 6) in rad and the points SC, AC, TS, AI (n, 3) in mm as a measurement without noise gives them."""
    measured = q
    points = list(chain.points(q))
    for change in changes:
        before, measured = measured, change.angles(measured)
        if change.moves_landmarks == "scapula":
            R_old, R_new = rotation_from_cardan(before[:, 3:]), rotation_from_cardan(measured[:, 3:])
            moved = R_new @ np.swapaxes(R_old, 1, 2)
            points[2:] = [points[1] + apply(moved, p - points[1]) for p in points[2:]]
        if change.moves_landmarks == "all" and change.turn is not None:
            E = rotation_from_vector(change.turn)
            points = [apply(E, p) for p in points]
    return measured, points


def tell(
    label: str,
    model: str,
    base: Chain,
    postures: Postures,
    people: Subjects,
    hidden: dict[str, tuple[Change, Draw]],
    size: float,
    noise_deg: float,
    seed: int,
    mixed_sign: bool,
    dropped: NDArray[np.bool_],
) -> dict[str, Any]:
    """The truth, ready for JSON."""
    ids = [f"simulated{s + 1:02d}" for s in range(postures.subjects)]
    start = np.concatenate([base.centre[0, 1:], base.semi[0], base.targets[0, 2:]])
    effects = {}
    for name, (_, draw) in hidden.items():
        effect = EFFECTS[name]
        effects[name] = {
            "definition": " ".join((effect.make.__doc__ or "").split()),
            "unit": effect.unit,
            "scale": effect.scale,
            "amplitude": dict(zip(ids, draw.amplitude.tolist(), strict=True)),
            "parameters": {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in draw.notes.items()},
        }
    return {
        "origin": "simulated",
        "label": label,
        "labels": list(hidden),
        "model": model,
        "size": size,
        "noise_deg": noise_deg,
        "seed": seed,
        "mixed_sign": mixed_sign,
        "full_elevation_deg": FULL_ELEVATION_DEG,
        "effects": effects,
        "subjects": {
            subject: {
                **dict(zip(PARAMETERS, (start + people.parameter_mm[s]).tolist(), strict=True)),
                "rest_deg": people.rest_deg[s].tolist(),
                "slope_factors": people.slope[s].tolist(),
                "axial_rotation_deg": float(people.axial_deg[s]),
            }
            for s, subject in enumerate(ids)
        },
        "dropped": [
            [ids[postures.subject[i]], postures.motions[postures.motion[i]], int(postures.number[i])]
            for i in np.flatnonzero(dropped)
        ],
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Write one simulated world: a motion file and, apart from it, the truth."""
    parser = argparse.ArgumentParser(description="Simulate subjects with a hidden effect, their truth apart.")
    parser.add_argument("label", help=f"{', '.join(LABELS)}; or two joined by '+'")
    parser.add_argument("--model", type=Path, required=True, help="parameter set, TOML")
    parser.add_argument("--out", type=Path, required=True, help="motion file, CSV")
    parser.add_argument("--truth", type=Path, required=True, help="truth, JSON")
    parser.add_argument("--subjects", type=int, default=10)
    parser.add_argument("--noise-deg", type=float, default=1.5, help="SD of the noise on each angle")
    parser.add_argument("--size", type=float, default=1.0, help="factor on the effect's amplitude")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--motions", nargs="+", choices=tuple(PLANES_DEG), default=["abduction", "forward_flexion"])
    parser.add_argument("--elevations", type=float, nargs="+", default=list(ELEVATIONS_DEG), help="of the humerus, deg")
    parser.add_argument("--mixed-sign", action="store_true", help="draw the effect's sign for each subject")
    parser.add_argument("--landmarks", action="store_true", help="add SC, AC, TS and AI in the thorax frame, mm")
    given = vars(parser.parse_args(arguments))
    out, truth, model = given.pop("out"), given.pop("truth"), given.pop("model")
    try:
        world = make_world(model_toml_path=model, **given)
    except (ValueError, OSError) as error:
        parser.error(str(error))
    world.table.to_csv(out, index=False, float_format="%.4f")
    truth.write_text(json.dumps(world.truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
