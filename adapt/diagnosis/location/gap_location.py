"""Location of the gap between measured and simulated orientations, and the part of it that is noise.

Only measured angles of postures that are no padding are used. ``dataclasses.asdict`` turns every result into plain JSON
types.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.location.observations import Observed
from models.girdle import CONSTRAINTS
from motions.table import ANGLES, BONES

BIN_DEG = 30.0
"""Width of an elevation bin; a bin holds low <= elevation < high."""

_SAME_ELEVATION_DEG = 1.0
"""Root mean square spread of elevations, degrees, up to which no slope over elevation is computed."""


@dataclass(frozen=True)
class AngleGaps:
    """Measured angles, nearest angles of the model, and expected noise; finite where measured."""

    data: Observed
    simulated: Float[np.ndarray, "6 postures subjects"]
    """Nearest angles of the model, rad."""
    noise_deg2: Float[np.ndarray, "6 postures subjects"]
    """Expected squared difference of each angle from measurement noise alone."""


@dataclass(frozen=True)
class Cell:
    """Gap of one angle in one motion and elevation bin. ``difference`` is simulated less measured, as in fits.csv.

    noise = sqrt(2/pi) sqrt(mean noise_deg2), the mean absolute difference from noise alone;
    share = max(0, sum(difference^2 - noise_deg2)), over the sum of the same over all cells (0 where that sum is 0).
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
class GapLevel:
    """Mean absolute difference of some angles, and its expectation from noise alone: mean of sqrt(2/pi noise_deg2)."""

    mean_absolute_deg: float
    noise_deg: float


@dataclass(frozen=True)
class Profile:
    """Gap by angle, bone, motion, elevation bin and subject, without groups that have no measured angle. Names of bins
    are 'low-high' in degrees."""

    angle: dict[str, GapLevel]
    bone: dict[str, GapLevel]
    motion: dict[str, GapLevel]
    elevation: dict[str, GapLevel]
    subject: dict[str, GapLevel]


@dataclass(frozen=True)
class ConstraintResidual:
    """Residual of one of A1-A3 at the measured angles, in one motion or in all (motion None).

    The SD has n - 1 in its denominator; it is None for one posture. The slope of the residual a over elevation e is

        90 sum (e - mean e) (a - mean a) / sum (e - mean e)^2

    with means within subject and motion, and None where the elevations do not spread.
    """

    constraint: str
    motion: str | None
    postures: int
    mean_mm: float
    sd_mm: float | None
    min_mm: float
    max_mm: float
    slope_mm_per_90deg: float | None


def cells(gaps: AngleGaps) -> list[Cell]:
    """List every measured angle x motion x elevation bin, the largest share of the explainable gap first."""
    angle, motion, low_deg, _, difference, noise = _values(gaps)
    keys, group = np.unique(np.stack([angle, motion, low_deg]), axis=1, return_inverse=True)
    excess = np.bincount(group, difference**2 - noise).clip(0.0)
    share = excess / (excess.sum() or 1.0)

    def cell(k: int) -> Cell:
        at, name, low = group == k, ANGLES[int(keys[0, k])], float(keys[2, k])
        where = (name, name.split("_")[0], gaps.data.motions[int(keys[1, k])], low, low + BIN_DEG)
        means = (difference[at].mean(), np.abs(difference[at]).mean(), np.sqrt(2.0 / np.pi * noise[at].mean()))
        return Cell(*where, int(at.sum()), *map(float, means), share=float(share[k]))

    return sorted(map(cell, range(keys.shape[1])), key=lambda cell: -cell.share)


def profile(gaps: AngleGaps) -> Profile:
    """Average the absolute difference by angle, bone, motion, elevation bin and subject."""
    angle, motion, low_deg, subject, difference, noise = _values(gaps)
    absolute, alone = np.abs(difference), np.sqrt(2.0 / np.pi * noise)
    lows, bins = np.unique(low_deg, return_inverse=True)

    def levels(names: Iterable[str], number: np.ndarray) -> dict[str, GapLevel]:
        chosen = {name: number == k for k, name in enumerate(names)}
        return {
            n: GapLevel(float(absolute[at].mean()), float(alone[at].mean())) for n, at in chosen.items() if at.any()
        }

    return Profile(
        angle=levels(ANGLES, angle),
        bone=levels(BONES, angle // 3),
        motion=levels(gaps.data.motions, motion),
        elevation=levels([f"{low:.0f}-{low + BIN_DEG:.0f}" for low in lows], bins),
        subject=levels(gaps.data.subjects, subject),
    )


def _values(gaps: AngleGaps) -> tuple[np.ndarray, ...]:
    """List number, motion, bin (low end, deg), subject, difference (deg) and noise (deg^2) of each measured angle."""
    angle, posture, subject = at = np.nonzero(gaps.data.measured)
    low_deg = np.floor(gaps.data.elevation_deg[posture, subject] / BIN_DEG) * BIN_DEG
    difference_deg = np.rad2deg(gaps.simulated[at] - gaps.data.angles[at])
    return angle, gaps.data.motion[posture, subject], low_deg, subject, difference_deg, gaps.noise_deg2[at]


def _groups_of_postures(
    subject: Int[np.ndarray, " n"], motion: Int[np.ndarray, " n"]
) -> list[Int[np.ndarray, " group"]]:
    """Group the postures by subject and motion: one array of indices per motion of each subject."""
    _, group = np.unique(np.stack([subject, motion]), axis=1, return_inverse=True)
    return [np.flatnonzero(group == k) for k in np.unique(group)]


def constraint_residuals_mm(
    data: Observed, residuals_mm: Float[np.ndarray, "3 postures subjects"]
) -> list[ConstraintResidual]:
    """Summarise A1-A3 (mm) over the postures with all six angles measured: each constraint in all motions, then in each
    motion."""
    used = data.measured.all(axis=0)
    motion, subject = data.motion[used], np.nonzero(used)[1]
    elevation_deg = data.elevation_deg[used]
    chosen = {None: slice(None)} | {data.motions[k]: motion == k for k in np.unique(motion)}
    return [
        ConstraintResidual(
            constraint, name, *_spread(a[at], elevation_deg[at], _groups_of_postures(subject[at], motion[at]))
        )
        for constraint, a in zip(CONSTRAINTS, residuals_mm[:, used], strict=True)
        for name, at in chosen.items()
        if a.size
    ]


def _spread(a, elevation_deg, groups) -> tuple[int, float, float | None, float, float, float | None]:
    """Compute number, mean, SD, min, max of the residuals (mm), and their slope over elevation (mm per 90 deg)."""
    sd = float(a.std(ddof=1)) if len(a) > 1 else None
    e, within = (np.concatenate([x[at] - x[at].mean() for at in groups]) for x in (elevation_deg, a))
    slope = float(90.0 * (e @ within) / (e @ e)) if (e**2).mean() > _SAME_ELEVATION_DEG**2 else None
    return len(a), float(a.mean()), sd, float(a.min()), float(a.max()), slope
