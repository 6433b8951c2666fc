"""What the gap's rotations are made of: noise, a constant in each subject, a course over elevation, and the rest.

Rotations, not angles: only postures with all three angles of a bone take part.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.location.gap_location import SAME_ELEVATION_DEG, AngleGaps, groups_of_postures
from motions.rotations import DEG, compose, rotation_from_cardan, vector_from_rotation
from motions.table import BONES

_TERMS = 4
"""Of a systematic course over elevation: a cubic."""

_FREE = 2
"""Postures of a motion beyond the terms of its course: with fewer, any course would pass through the gap."""

_ROUNDING_DEG = 1e-9
"""A gap, or a mean gap, below it is none and has no direction: angles in double precision are rounded by 1e-14."""

_RANK = 1e-6
"""Singular value, as a fraction of the largest, below which elevations do not tell a term of the course."""

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")
"""'left': on the thorax side of the bone's rotation, R_measured = L R_simulated; 'right': on its bone side."""


@dataclass(frozen=True)
class GapFractions:
    """What fraction of the squared gap rotations T = sum |v|^2 is what, over some bone orientations.

    See :func:`variance_fractions`. ``left_explains`` and ``right_explains`` are sum_s n_s |c_s|^2 / T of either form's
    constants, not corrected for noise; ``side`` is the larger (left where equal). They differ only if the bone turns:
    else there is no telling the side.
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
class ConstantRotation:
    """Mean over subjects of a bone's constant rotation vector, and its SD over them (None: one subject).

    x, y, z in thorax axes if the side is left, in bone axes if right. ``thorax_side_deg`` is the length of the mean
    left vector, whichever the side.
    """

    side: Side
    mean_deg: list[float]
    sd_deg: list[float] | None
    thorax_side_deg: float


@dataclass(frozen=True)
class VarianceFractions:
    """What :func:`variance_fractions` finds. A bone that was never measured in all three angles is in none of it.

    ``thorax_sides_apart_deg`` is the angle between the bones' mean left vectors (None where one is zero or missing): an
    error of the thorax frame turns both bones alike, so that angle is small and their lengths are the same.
    """

    all: GapFractions | None
    bones: dict[str, GapFractions]
    constants: dict[str, ConstantRotation]
    thorax_sides_apart_deg: float | None


def variance_fractions(gaps: AngleGaps) -> VarianceFractions:
    """Split the gap into noise, constant per subject, systematic with elevation, and left over; rotations, not angles.

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
    turns = {bone: _turns(gaps, angles) for bone, angles in BONES.items()}
    turns = {bone: turn for bone, turn in turns.items() if len(turn.subject)}
    squares = {bone: _squares(turn) for bone, turn in turns.items()}
    return VarianceFractions(
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


def _turns(gaps: AngleGaps, angles: slice) -> _Turns:
    used = gaps.data.measured[angles].all(axis=0)
    both = (np.where(used, x[angles], 0.0) for x in (gaps.data.angles, gaps.simulated))
    measured, simulated = map(rotation_from_cardan, both)
    back = np.swapaxes(simulated, 0, 1)
    v = DEG * np.stack([vector_from_rotation(R) for R in (compose(measured, back), compose(back, measured))])
    return _Turns(
        vectors_deg=np.swapaxes(v[:, :, used], 1, 2),
        subject=np.nonzero(used)[1],
        motion=gaps.data.motion[used],
        elevation_deg=gaps.data.elevation_deg[used],
        noise_deg2=gaps.noise_deg2[angles][:, used],
    )


def _squares(turns: _Turns) -> Float[np.ndarray, " 7"]:
    """n; T; 3 n s2; sum_s n_s |c_s|^2 left and right; what is explained less chance: constant, systematic. deg^2."""
    v, chance, explained = turns.vectors_deg[turns.side], 3.0 * turns.noise_deg2.mean(), turns.explained_deg2
    _, subject, n = np.unique(turns.subject, return_inverse=True, return_counts=True)
    w = v - turns.constants_deg[turns.side, subject]
    systematic = 0.0
    for at in groups_of_postures(turns.subject, turns.motion):
        course = _course(turns.elevation_deg[at])
        freedom = course.shape[1] - len(at) / n[subject[at[0]]] if course.size else 0.0
        systematic += ((course.T @ w[at]) ** 2).sum() - chance * freedom
    constant = explained.max() - chance * len(n)
    return np.array([len(v), (v**2).sum(), chance * len(v), *explained, constant, systematic])


def _course(elevation_deg: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n terms"]:
    """Orthonormal columns that span the cubic, or as many of its terms as the postures allow."""
    f = (elevation_deg - elevation_deg.mean()) / max(float(np.ptp(elevation_deg)), SAME_ELEVATION_DEG)
    terms = max(0, min(_TERMS, len(f) - _FREE))
    columns, size, _ = np.linalg.svd(f[:, None] ** np.arange(terms), full_matrices=False)
    return columns[:, size > _RANK * size.max(initial=0.0)]


def _parts(squares: Float[np.ndarray, " 7"]) -> GapFractions:
    n, total, noise, left, right, constant, systematic = squares.tolist()
    none = total <= n * _ROUNDING_DEG**2
    scale = 0.0 if none else 1.0 / total
    parts = np.array([1.0 if none else min(1.0, noise * scale), constant * scale, systematic * scale]).clip(0.0)
    fractions = np.append(parts, max(0.0, 1.0 - parts.sum())) / max(1.0, parts.sum())
    explains = {"left_explains": min(1.0, left * scale), "right_explains": min(1.0, right * scale)}
    return GapFractions(int(n), (total / n) ** 0.5, *map(float, fractions), side=SIDES[int(right > left)], **explains)


def _constant(turns: _Turns) -> ConstantRotation:
    c = turns.constants_deg
    sd = c[turns.side].std(axis=0, ddof=1).tolist() if c.shape[1] > 1 else None
    mean = c.mean(axis=1)
    return ConstantRotation(SIDES[turns.side], mean[turns.side].tolist(), sd, float(np.linalg.norm(mean[0])))


def _apart_deg(vectors: Sequence[Float[np.ndarray, " 3"]]) -> float | None:
    """The angle between two vectors."""
    if len(vectors) < len(BONES) or min(np.linalg.norm(v) for v in vectors) <= _ROUNDING_DEG:
        return None
    a, b = vectors
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
