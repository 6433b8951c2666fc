"""Where the gap between measured and simulated orientations lies, and how much of it is noise.

Only counted postures and measured angles take part. ``dataclasses.asdict`` turns every result into plain JSON types.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.observed import Observed
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
"""'left': on the thorax side of the bone's rotation, R_measured = L R_simulated; 'right': on its bone side."""

Vector = tuple[float, float, float]


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
    """What share of the squared gap rotations T = sum |v|^2 is what, clipped and normalised as :func:`shares` says."""

    postures: int
    """Bone orientations with all three angles measured."""
    rms_deg: float
    """sqrt(T / postures)."""
    noise: float
    constant: float
    systematic: float
    left_over: float
    side: Side
    """The form whose constant explains more; left where both explain the same."""
    left_explains: float
    right_explains: float
    """sum_s n_s |c_s|^2 / T of the constants c_s of each form, not corrected for noise. They are the same where the
    bone does not turn over the postures: the side then is not told."""


@dataclass(frozen=True)
class Constant:
    """Mean over subjects of a bone's constant rotation vector (x, y, z), and its SD over them (None: one subject).

    In thorax axes on the left side, in bone axes on the right one.
    """

    side: Side
    mean_deg: Vector
    sd_deg: Vector | None


@dataclass(frozen=True)
class ThoraxSide:
    """Whether the bones agree on a thorax-side (left) constant: an error of the thorax frame turns both alike."""

    clavicle_deg: float
    scapula_deg: float
    """Lengths of the mean left vectors."""
    angle_deg: float | None
    """Between them; None where one is zero."""


@dataclass(frozen=True)
class Shares:
    """See :func:`shares`. A bone that was never measured in all three angles is in none of it."""

    all: Parts | None
    bones: dict[str, Parts]
    constants: dict[str, Constant]
    thorax_side: ThoraxSide | None


@dataclass(frozen=True)
class Spread:
    """Statistics over postures; SD with n - 1 (None: one posture)."""

    postures: int
    mean_mm: float
    sd_mm: float | None
    min_mm: float
    max_mm: float


@dataclass(frozen=True)
class ConstraintResidual:
    """One of A1-A3 at the measured angles. ``slope`` is over elevation, pooled within subject and motion:
    90 sum (e - mean e) (a - mean a) / sum (e - mean e)^2; None where the elevations do not spread."""

    overall: Spread
    motions: dict[str, Spread]
    slope_mm_per_90deg: float | None


def cells(gap: Gap) -> list[Cell]:
    """Every angle x motion x elevation bin that was measured, the largest share of the explainable gap first."""
    angle, motion, low_deg, _, difference, noise = _values(gap)
    keys, group = np.unique(np.stack([angle, motion, low_deg]), axis=1, return_inverse=True)
    excess = np.maximum(0.0, np.bincount(group, difference**2 - noise))
    share = excess / excess.sum() if excess.any() else excess
    found = []
    for k, (a, m, low) in enumerate(keys.T):
        at = group == k
        name = ANGLES[int(a)]
        found.append(
            Cell(
                angle=name,
                bone=name.split("_")[0],
                motion=gap.data.motions[int(m)],
                elevation_low_deg=float(low),
                elevation_high_deg=float(low + BIN_DEG),
                postures=int(at.sum()),
                mean_difference_deg=float(difference[at].mean()),
                mean_absolute_deg=float(np.abs(difference[at]).mean()),
                noise_deg=float(np.sqrt(2.0 / np.pi * noise[at].mean())),
                share=float(share[k]),
            )
        )
    return sorted(found, key=lambda cell: -cell.share)


def profile(gap: Gap) -> Profile:
    """The mean absolute difference by angle, bone, motion, elevation bin and subject."""
    angle, motion, low_deg, subject, difference, noise = _values(gap)

    def levels(names: Sequence[str], number: np.ndarray) -> dict[str, Level]:
        chosen = {name: number == k for k, name in enumerate(names)}
        return {
            name: Level(float(np.abs(difference[at]).mean()), float(np.sqrt(2.0 / np.pi * noise[at]).mean()))
            for name, at in chosen.items()
            if at.any()
        }

    lows, bins = np.unique(low_deg, return_inverse=True)
    return Profile(
        angle=levels(ANGLES, angle),
        bone=levels(BONES, angle // 3),
        motion=levels(gap.data.motions, motion),
        elevation=levels([f"{low:.0f}-{low + BIN_DEG:.0f}" for low in lows], bins),
        subject=levels(gap.data.subjects, subject),
    )


def _values(gap: Gap) -> tuple[np.ndarray, ...]:
    """Of each angle that takes part: its number, motion, bin (low end, deg), subject, difference (deg), noise (deg^2)."""
    angle, posture, subject = np.nonzero(gap.used)
    at = (angle, posture, subject)
    low_deg = np.floor(gap.data.elevation_deg[posture, subject] / BIN_DEG) * BIN_DEG
    difference_deg = np.asarray((gap.simulated[at] - gap.data.values[at]) * DEG)
    return angle, gap.data.motion[posture, subject], low_deg, subject, difference_deg, gap.noise_deg2[at]


@dataclass(frozen=True)
class _Turns:
    """The n gap rotations of one bone: vectors in degrees, (n, 3), in both forms."""

    vectors: dict[Side, Float[np.ndarray, "n 3"]]
    subject: Int[np.ndarray, " n"]
    motion: Int[np.ndarray, " n"]
    elevation_deg: Float[np.ndarray, " n"]
    variance_deg2: float
    """Noise variance of each component: the mean noise_deg2 of the bone's angles, as the axes of the Cardan angles
    are unit vectors and thus E |v|^2 = sum of the three E difference^2."""

    def constants(self, side: Side) -> Float[np.ndarray, "subjects 3"]:
        """c_s of the subjects that the bone was measured in."""
        return np.stack([self.vectors[side][self.subject == s].mean(axis=0) for s in np.unique(self.subject)])

    def constant_squares(self, side: Side) -> float:
        """sum_s n_s |c_s|^2."""
        _, n = np.unique(self.subject, return_counts=True)
        return float(n @ (self.constants(side) ** 2).sum(axis=1))

    @property
    def side(self) -> Side:
        return "left" if self.constant_squares("left") >= self.constant_squares("right") else "right"


@dataclass(frozen=True)
class _Squares:
    """Sums over the gap rotations of a bone, deg^2; those of several bones are added. Explained ones less chance."""

    postures: int
    total: float
    noise: float
    left: float
    right: float
    constant: float
    systematic: float


def shares(gap: Gap) -> Shares:
    """The gap as noise, constant per subject, systematic with elevation, and left over; rotations, not angles.

    In every posture with the three angles of a bone, v is the rotation vector from simulated to measured:
    log(R_measured R_simulated') on the left (thorax axes), log(R_simulated' R_measured) on the right (bone axes); its
    length is the same. With n vectors of S subjects, T = sum |v|^2 and s2 = mean noise_deg2 of the bone:

    noise      = min(1, 3 n s2 / T)
    constant   = (sum_s n_s |c_s|^2 - 3 S s2) / T,  c_s the mean v of subject s, in the form that explains more
    systematic = (sum |P w|^2 - 3 d s2) / T,  w = v - c_s in that form, P the projection on a cubic in elevation a
                 motion of a subject, d = sum over them (terms) - sum_s (postures of s in them) / n_s
    left over  = 1 - noise - constant - systematic

    each clipped at 0, then divided by their sum. A motion with fewer than six postures has a lower degree, so that two
    residual degrees of freedom stay; with fewer than three it is skipped. For all, the sums of both bones are added,
    each bone in its own form. Where there is no gap at all, all of it is noise.
    """
    turns = {bone: t for k, bone in enumerate(BONES) if (t := _turns(gap, slice(3 * k, 3 * k + 3))) is not None}
    squares = {bone: _squares(t) for bone, t in turns.items()}
    pooled = _Squares(*(sum(getattr(s, f.name) for s in squares.values()) for f in fields(_Squares)))
    return Shares(
        all=_parts(pooled) if turns else None,
        bones={bone: _parts(s) for bone, s in squares.items()},
        constants={bone: _constant(t) for bone, t in turns.items()},
        thorax_side=_thorax_side(*(turns[bone] for bone in BONES)) if len(turns) == len(BONES) else None,
    )


def _turns(gap: Gap, angles: slice) -> _Turns | None:
    used = gap.used[angles].all(axis=0)
    if not used.any():
        return None
    measured, simulated = (
        np.asarray(rotation_from_cardan(np.where(used, x[angles], 0.0))) for x in (gap.data.values, gap.simulated)
    )
    transposed = np.swapaxes(simulated, 0, 1)
    both: dict[Side, np.ndarray] = {
        "left": _vector_deg(np.asarray(compose(measured, transposed))),
        "right": _vector_deg(np.asarray(compose(transposed, measured))),
    }
    return _Turns(
        vectors={side: v[:, used].T for side, v in both.items()},
        subject=np.nonzero(used)[1],
        motion=gap.data.motion[used],
        elevation_deg=gap.data.elevation_deg[used],
        variance_deg2=float(gap.noise_deg2[angles][:, used].mean()),
    )


def _vector_deg(R: Float[np.ndarray, " 3 3 *batch"]) -> Float[np.ndarray, " 3 *batch"]:
    """log(R) for less than half a turn."""
    sines = np.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = np.sqrt((sines**2).sum(axis=0))
    return sines * np.asarray(mean_angle(R) * DEG) / np.where(length > 0.0, length, 1.0)


def _squares(turns: _Turns) -> _Squares:
    v, s2, side = turns.vectors[turns.side], turns.variance_deg2, turns.side
    subjects, index, n = np.unique(turns.subject, return_inverse=True, return_counts=True)
    w = v - turns.constants(side)[index]
    systematic = 0.0
    for at in _groups(turns.subject, turns.motion):
        course = _course(turns.elevation_deg[at])
        by_chance = course.shape[1] - (len(at) / n[index[at[0]]] if course.size else 0.0)
        systematic += float(((course.T @ w[at]) ** 2).sum()) - 3.0 * s2 * by_chance
    left, right = turns.constant_squares("left"), turns.constant_squares("right")
    return _Squares(
        postures=len(v),
        total=float((v**2).sum()),
        noise=3.0 * len(v) * s2,
        left=left,
        right=right,
        constant=max(left, right) - 3.0 * len(subjects) * s2,
        systematic=systematic,
    )


def _groups(subject: Int[np.ndarray, " n"], motion: Int[np.ndarray, " n"]) -> Iterator[Int[np.ndarray, " group"]]:
    """The postures of each motion of each subject."""
    _, group = np.unique(np.stack([subject, motion]), axis=1, return_inverse=True)
    return (np.flatnonzero(group == k) for k in np.unique(group))


def _course(elevation_deg: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n terms"]:
    """Orthonormal columns that span the cubic, or as many of its terms as the postures allow."""
    f = (elevation_deg - elevation_deg.mean()) / max(float(np.ptp(elevation_deg)), _SAME_ELEVATION_DEG)
    terms = max(0, min(_TERMS, len(f) - _FREE))
    columns, size, _ = np.linalg.svd(f[:, None] ** np.arange(terms), full_matrices=False)
    return columns[:, size > _RANK * size.max(initial=0.0)]


def _parts(squares: _Squares) -> Parts:
    total = squares.total
    shares = np.array([1.0, 0.0, 0.0, 0.0])
    none = total <= squares.postures * _ROUNDING_DEG**2
    if not none:
        noise, constant, systematic = np.array([squares.noise, squares.constant, squares.systematic]) / total
        parts = np.array([min(1.0, noise), constant, systematic, 0.0]).clip(0.0)
        parts[3] = max(0.0, 1.0 - parts.sum())
        shares = parts / parts.sum()
    return Parts(
        squares.postures,
        float(np.sqrt(total / squares.postures)),
        *map(float, shares),
        side="left" if squares.left >= squares.right else "right",
        left_explains=0.0 if none else squares.left / total,
        right_explains=0.0 if none else squares.right / total,
    )


def _constant(turns: _Turns) -> Constant:
    c = turns.constants(turns.side)
    return Constant(turns.side, _xyz(c.mean(axis=0)), _xyz(c.std(axis=0, ddof=1)) if len(c) > 1 else None)


def _xyz(vector: Float[np.ndarray, " 3"]) -> Vector:
    x, y, z = vector.tolist()
    return x, y, z


def _thorax_side(clavicle: _Turns, scapula: _Turns) -> ThoraxSide:
    a, b = (turns.constants("left").mean(axis=0) for turns in (clavicle, scapula))
    lengths = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b) * DEG
    return ThoraxSide(*lengths, float(angle) if min(lengths) > _ROUNDING_DEG else None)


def constraint_residuals_mm(
    data: Observed, residuals_mm: Float[np.ndarray, "3 postures subjects"]
) -> dict[str, ConstraintResidual]:
    """A1-A3 (mm) at the measured angles, over the counted postures with all six angles; empty if there are none."""
    used = data.measured[:6].all(axis=0) & data.counted
    if not used.any():
        return {}
    motion, subject, elevation = data.motion[used], np.nonzero(used)[1], data.elevation_deg[used]
    groups = list(_groups(subject, motion))
    found = {}
    for name, a in zip(CONSTRAINTS, residuals_mm[:, used], strict=True):
        e_within, a_within = (np.concatenate([x[at] - x[at].mean() for at in groups]) for x in (elevation, a))
        spreads = float(np.sqrt((e_within**2).mean())) > _SAME_ELEVATION_DEG
        found[name] = ConstraintResidual(
            overall=_spread(a),
            motions={data.motions[m]: _spread(a[motion == m]) for m in np.unique(motion)},
            slope_mm_per_90deg=float(90.0 * (e_within @ a_within) / (e_within @ e_within)) if spreads else None,
        )
    return found


def _spread(a: Float[np.ndarray, " n"]) -> Spread:
    sd = float(a.std(ddof=1)) if len(a) > 1 else None
    return Spread(len(a), float(a.mean()), sd, float(a.min()), float(a.max()))
