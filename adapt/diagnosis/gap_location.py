"""Where the gap between measured and simulated orientations lies, and how much of it is noise.

Only counted postures and measured angles take part. ``dataclasses.asdict`` turns every result into plain JSON types.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from adapt.diagnosis.fit.observations import Observed
from models.girdle import CONSTRAINTS
from motions.rotations import DEG, compose, mean_angle, rotation_from_cardan
from motions.table import ANGLES

BONES = ("clavicle", "scapula")

BIN_DEG = 30.0
"""Width of an elevation bin; a bin holds low <= elevation < high."""

_TERMS = 4
"""Of a systematic course over elevation: a cubic."""

_FREE = 2
"""Postures of a motion beyond the terms of its course: with fewer, any course would pass through the gap."""

_ROUNDING_DEG = 1e-9
"""A gap, or a mean gap, below it is none and has no direction: angles in double precision are rounded by 1e-14."""

_SAME_ELEVATION_DEG = 1.0
"""Elevations of a motion that spread less (peak to peak, or rms) say nothing of a course over elevation."""

_RANK = 1e-6
"""Singular value, as a share of the largest, below which elevations do not tell a term of the course."""

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")
"""'left': on the thorax side of the bone's rotation, R_measured = L R_simulated; 'right': on its bone side."""


@dataclass(frozen=True)
class Gap:
    """Measured angles, the model's closest ones and what noise would leave; finite where counted and measured."""

    data: Observed
    simulated: Float[np.ndarray, "6 postures subjects"]
    """The model's closest angles, rad."""
    noise_deg2: Float[np.ndarray, "6 postures subjects"]
    """Expected squared difference that measurement noise alone would leave in each angle."""

    @property
    def used(self) -> Bool[np.ndarray, "6 postures subjects"]:
        """The angles that take part."""
        return self.data.measured[:6] & self.data.counted


@dataclass(frozen=True)
class Cell:
    """The gap of one angle in one motion and elevation bin. ``difference`` is simulated less measured, as in fits.csv.

    noise = sqrt(2/pi) sqrt(mean noise_deg2), the mean absolute difference of noise alone;
    share = max(0, sum(difference^2 - noise_deg2)), over the sum of the same over all cells (0 where that is 0).
    """

    angle: str
    bone: str
    motion: str
    elevation_low_deg: float
    elevation_high_deg: float
    postures: int
    mean_difference_deg: float
    mean_absolute_deg: float
    noise_deg: float
    share: float


@dataclass(frozen=True)
class Level:
    """Mean absolute difference of some angles, beside what noise alone would leave: mean of sqrt(2/pi noise_deg2)."""

    mean_absolute_deg: float
    noise_deg: float


@dataclass(frozen=True)
class Profile:
    """The gap by one thing at a time; what has no measured angle is left out. Bins are named 'low-high' in degrees."""

    angle: dict[str, Level]
    bone: dict[str, Level]
    motion: dict[str, Level]
    elevation: dict[str, Level]
    subject: dict[str, Level]


@dataclass(frozen=True)
class Parts:
    """What share of the squared gap rotations T = sum |v|^2 is what (:func:`shares`), over some bone orientations.

    ``left_explains`` and ``right_explains`` are sum_s n_s |c_s|^2 / T of either form's constants, not corrected for
    noise; ``side`` is the larger (left where equal). They differ only if the bone turns: else the side is not told.
    """

    orientations: int
    rms_deg: float
    noise: float
    constant: float
    systematic: float
    left_over: float
    side: Side
    left_explains: float
    right_explains: float


@dataclass(frozen=True)
class Constant:
    """Mean over subjects of a bone's constant rotation vector, and its SD over them (None: one subject).

    x, y, z in thorax axes if the side is left, in bone axes if right. ``thorax_side_deg`` is the length of the mean
    left vector, whichever the side.
    """

    side: Side
    mean_deg: list[float]
    sd_deg: list[float] | None
    thorax_side_deg: float


@dataclass(frozen=True)
class Shares:
    """See :func:`shares`. A bone that was never measured in all three angles is in none of it.

    ``thorax_sides_apart_deg`` is the angle between the bones' mean left vectors (None where one is zero or missing): an
    error of the thorax frame turns both bones alike, so that angle is small and their lengths are the same.
    """

    all: Parts | None
    bones: dict[str, Parts]
    constants: dict[str, Constant]
    thorax_sides_apart_deg: float | None


@dataclass(frozen=True)
class ConstraintResidual:
    """One of A1-A3 at the measured angles, in one motion or (motion None) in all; SD with n - 1 (None: one posture).

    slope = 90 sum (e - mean e) (a - mean a) / sum (e - mean e)^2 over elevation e, means within subject and motion;
    None where the elevations do not spread.
    """

    constraint: str
    motion: str | None
    postures: int
    mean_mm: float
    sd_mm: float | None
    min_mm: float
    max_mm: float
    slope_mm_per_90deg: float | None


def cells(gap: Gap) -> list[Cell]:
    """Every angle x motion x elevation bin that was measured, the largest share of the explainable gap first."""
    angle, motion, low_deg, _, difference, noise = _values(gap)
    keys, group = np.unique(np.stack([angle, motion, low_deg]), axis=1, return_inverse=True)
    excess = np.bincount(group, difference**2 - noise).clip(0.0)
    share = excess / (excess.sum() or 1.0)

    def cell(k: int) -> Cell:
        at, name, low = group == k, ANGLES[int(keys[0, k])], float(keys[2, k])
        where = (name, name.split("_")[0], gap.data.motions[int(keys[1, k])], low, low + BIN_DEG)
        means = (difference[at].mean(), np.abs(difference[at]).mean(), np.sqrt(2.0 / np.pi * noise[at].mean()))
        return Cell(*where, int(at.sum()), *map(float, means), share=float(share[k]))

    return sorted(map(cell, range(keys.shape[1])), key=lambda cell: -cell.share)


def profile(gap: Gap) -> Profile:
    """The mean absolute difference by angle, bone, motion, elevation bin and subject."""
    angle, motion, low_deg, subject, difference, noise = _values(gap)
    absolute, alone = np.abs(difference), np.sqrt(2.0 / np.pi * noise)
    lows, bins = np.unique(low_deg, return_inverse=True)

    def levels(names: Sequence[str], number: np.ndarray) -> dict[str, Level]:
        chosen = {name: number == k for k, name in enumerate(names)}
        return {n: Level(float(absolute[at].mean()), float(alone[at].mean())) for n, at in chosen.items() if at.any()}

    return Profile(
        angle=levels(ANGLES, angle),
        bone=levels(BONES, angle // 3),
        motion=levels(gap.data.motions, motion),
        elevation=levels([f"{low:.0f}-{low + BIN_DEG:.0f}" for low in lows], bins),
        subject=levels(gap.data.subjects, subject),
    )


def _values(gap: Gap) -> tuple[np.ndarray, ...]:
    """Of each angle in use: its number, motion, bin (low end, deg), subject, difference (deg) and noise (deg^2)."""
    angle, posture, subject = at = np.nonzero(gap.used)
    low_deg = np.floor(gap.data.elevation_deg[posture, subject] / BIN_DEG) * BIN_DEG
    difference_deg = np.rad2deg(gap.simulated[at] - gap.data.values[at])
    return angle, gap.data.motion[posture, subject], low_deg, subject, difference_deg, gap.noise_deg2[at]


def shares(gap: Gap) -> Shares:
    """The gap as noise, constant per subject, systematic with elevation, and left over; rotations, not angles.

    In every posture with the three angles of a bone, v is the rotation vector from simulated to measured:
    log(R_measured R_simulated') on the left (thorax axes), log(R_simulated' R_measured) on the right (bone axes); its
    length is the same. With n vectors of S subjects, T = sum |v|^2 and s2 = mean noise_deg2 of the bone:

    noise      = min(1, 3 n s2 / T)
    constant   = (sum_s n_s |c_s|^2 - 3 S s2) / T,  c_s the mean v of subject s, in the form that explains more
    systematic = (sum |P w|^2 - 3 d s2) / T,  w = v - c_s in that form, P the projection on a cubic in elevation a
                 motion of a subject, d = sum over these motions of (terms - their postures / n_s)
    left over  = 1 - noise - constant - systematic

    each clipped at 0, then divided by their sum. s2 is the variance of each component, as the axes of Cardan angles are
    unit vectors, so that E |v|^2 is the sum of three noise_deg2. A motion with fewer than six postures has a lower
    degree, so that two residual degrees of freedom stay; with fewer than three it is skipped. For all, the sums of both
    bones are added, each bone in its own form. Where there is no gap at all, all of it is noise.
    """
    turns = {bone: _turns(gap, slice(3 * k, 3 * k + 3)) for k, bone in enumerate(BONES)}
    turns = {bone: turn for bone, turn in turns.items() if len(turn.subject)}
    squares = {bone: _squares(turn) for bone, turn in turns.items()}
    return Shares(
        all=_parts(np.sum(list(squares.values()), axis=0)) if squares else None,
        bones={bone: _parts(each) for bone, each in squares.items()},
        constants={bone: _constant(turn) for bone, turn in turns.items()},
        thorax_sides_apart_deg=_apart_deg([turn.constants_deg[0].mean(axis=0) for turn in turns.values()]),
    )


@dataclass(frozen=True)
class _Turns:
    """The n gap rotations of one bone; the first axis is that of SIDES."""

    vectors_deg: Float[np.ndarray, "2 n 3"]
    subject: Int[np.ndarray, " n"]
    motion: Int[np.ndarray, " n"]
    elevation_deg: Float[np.ndarray, " n"]
    noise_deg2: Float[np.ndarray, "3 n"]

    @property
    def constants_deg(self) -> Float[np.ndarray, "2 subjects 3"]:
        """c_s of the subjects that the bone was measured in."""
        v, s = self.vectors_deg, self.subject
        return np.stack([v[:, s == subject].mean(axis=1) for subject in np.unique(s)], axis=1)

    @property
    def explained_deg2(self) -> Float[np.ndarray, " 2"]:
        """sum_s n_s |c_s|^2 of either form."""
        return (self.constants_deg**2).sum(axis=2) @ np.unique(self.subject, return_counts=True)[1]

    @property
    def side(self) -> int:
        """The form whose constant explains more."""
        return int(np.argmax(self.explained_deg2))


def _turns(gap: Gap, angles: slice) -> _Turns:
    used = gap.used[angles].all(axis=0)
    both = (jnp.where(used, x[angles], 0.0) for x in (gap.data.values, gap.simulated))
    measured, simulated = map(rotation_from_cardan, both)
    back = jnp.swapaxes(simulated, 0, 1)
    v = np.stack([_vector_deg(compose(measured, back)), _vector_deg(compose(back, measured))])
    return _Turns(
        vectors_deg=np.swapaxes(v[:, :, used], 1, 2),
        subject=np.nonzero(used)[1],
        motion=gap.data.motion[used],
        elevation_deg=gap.data.elevation_deg[used],
        noise_deg2=gap.noise_deg2[angles][:, used],
    )


def _vector_deg(R: Float[Array, " 3 3 *batch"]) -> Float[Array, " 3 *batch"]:
    """log(R) for less than half a turn."""
    sines = jnp.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = jnp.sqrt((sines**2).sum(axis=0))
    return sines * mean_angle(R) * DEG / jnp.where(length > 0.0, length, 1.0)


def _squares(turns: _Turns) -> Float[np.ndarray, " 7"]:
    """n; T; 3 n s2; sum_s n_s |c_s|^2 left and right; what is explained less chance: constant, systematic. deg^2."""
    v, chance, explained = turns.vectors_deg[turns.side], 3.0 * turns.noise_deg2.mean(), turns.explained_deg2
    _, subject, n = np.unique(turns.subject, return_inverse=True, return_counts=True)
    w = v - turns.constants_deg[turns.side, subject]
    systematic = 0.0
    for at in _groups(turns.subject, turns.motion):
        course = _course(turns.elevation_deg[at])
        freedom = course.shape[1] - len(at) / n[subject[at[0]]] if course.size else 0.0
        systematic += ((course.T @ w[at]) ** 2).sum() - chance * freedom
    constant = explained.max() - chance * len(n)
    return np.array([len(v), (v**2).sum(), chance * len(v), *explained, constant, systematic])


def _groups(subject: Int[np.ndarray, " n"], motion: Int[np.ndarray, " n"]) -> list[Int[np.ndarray, " group"]]:
    """The postures of each motion of each subject."""
    _, group = np.unique(np.stack([subject, motion]), axis=1, return_inverse=True)
    return [np.flatnonzero(group == k) for k in np.unique(group)]


def _course(elevation_deg: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n terms"]:
    """Orthonormal columns that span the cubic, or as many of its terms as the postures allow."""
    f = (elevation_deg - elevation_deg.mean()) / max(float(np.ptp(elevation_deg)), _SAME_ELEVATION_DEG)
    terms = max(0, min(_TERMS, len(f) - _FREE))
    columns, size, _ = np.linalg.svd(f[:, None] ** np.arange(terms), full_matrices=False)
    return columns[:, size > _RANK * size.max(initial=0.0)]


def _parts(squares: Float[np.ndarray, " 7"]) -> Parts:
    n, total, noise, left, right, constant, systematic = squares.tolist()
    none = total <= n * _ROUNDING_DEG**2
    scale = 0.0 if none else 1.0 / total
    parts = np.array([1.0 if none else min(1.0, noise * scale), constant * scale, systematic * scale]).clip(0.0)
    shares = np.append(parts, max(0.0, 1.0 - parts.sum())) / max(1.0, parts.sum())
    explains = {"left_explains": min(1.0, left * scale), "right_explains": min(1.0, right * scale)}
    return Parts(int(n), (total / n) ** 0.5, *map(float, shares), side=SIDES[int(right > left)], **explains)


def _constant(turns: _Turns) -> Constant:
    c = turns.constants_deg
    sd = c[turns.side].std(axis=0, ddof=1).tolist() if c.shape[1] > 1 else None
    mean = c.mean(axis=1)
    return Constant(SIDES[turns.side], mean[turns.side].tolist(), sd, float(np.linalg.norm(mean[0])))


def _apart_deg(vectors: Sequence[Float[np.ndarray, " 3"]]) -> float | None:
    """The angle between two vectors."""
    if len(vectors) < len(BONES) or min(np.linalg.norm(v) for v in vectors) <= _ROUNDING_DEG:
        return None
    a, b = vectors
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def constraint_residuals_mm(
    data: Observed, residuals_mm: Float[np.ndarray, "3 postures subjects"]
) -> list[ConstraintResidual]:
    """A1-A3 over the counted postures with all six angles measured: of each, all motions first, then one by one."""
    used = data.measured[:6].all(axis=0) & data.counted
    motion, subject = data.motion[used], np.nonzero(used)[1]
    chosen = {None: slice(None)} | {data.motions[k]: motion == k for k in np.unique(motion)}
    return [
        ConstraintResidual(name, of, *_spread(a[at], data.elevation_deg[used][at], _groups(subject[at], motion[at])))
        for name, a in zip(CONSTRAINTS, residuals_mm[:, used], strict=True)
        for of, at in chosen.items()
        if a.size
    ]


def _spread(a, elevation_deg, groups) -> tuple[int, float, float | None, float, float, float | None]:
    """Number, mean, SD, min, max of the residuals (mm), and their slope over elevation (mm per 90 deg)."""
    sd = float(a.std(ddof=1)) if len(a) > 1 else None
    e, within = (np.concatenate([x[at] - x[at].mean() for at in groups]) for x in (elevation_deg, a))
    slope = float(90.0 * (e @ within) / (e @ e)) if (e**2).mean() > _SAME_ELEVATION_DEG**2 else None
    return len(a), float(a.mean()), sd, float(a.min()), float(a.max()), slope
