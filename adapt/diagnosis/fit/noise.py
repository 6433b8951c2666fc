"""The measurement noise, from the residual degrees of freedom that neither the girdle nor any smooth effect takes up.

Six angles leave three numbers a posture. A subject's adapted parameters and a parabola over elevation in each motion
and constraint take some of them up; so does what all subjects have in common at an elevation of a motion, which is no
noise. The rest is noise, whatever effect is at work. Landmark noise comes from SC, which hardly moves in the thorax
frame. A subject that scatters far more than the others would have its noise taken for theirs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.discrepancy_columns import SMOOTH, discrepancy_columns
from adapt.diagnosis.fit.linear_model import LinearisedFit
from adapt.diagnosis.fit.map_fit import fit_hypotheses
from adapt.diagnosis.fit.measurement_noise import Noise, NoiseEstimate
from adapt.diagnosis.fit.observations import Observed
from models.effects import Effect
from models.girdle import CONSTRAINTS, Girdle

ASSUMED = Noise(angle_deg=1.5, landmark_mm=2.0)
"""Where neither the data nor the user say: one palpated posture has 2-3 deg, the mean of repeats less."""

FEWEST_DEGREES = 12
"""Of freedom, below which an estimate (20 % uncertain there) is none."""

LEAST = Noise(angle_deg=0.1, landmark_mm=0.1)
"""Noise below this is rounding of the files, not measurement."""

_NOISY, _SURELY, _ORDINARY_DEG = 2.0, 4.0, 3.0
"""A subject is noisy whose SD is more than so many times the median of all, so many standard deviations of an estimate
above it, and more than any palpated posture has. The bone-pin shoulders scatter by 0.4 to 0.8 deg, the two group means
beside them by 0.1 and 1.6: subjects differ, which is no fault."""

_MOST_NOISY = 1.0 / 3.0
"""Share of the subjects up to which the noisy ones are exceptions."""

_BIN_DEG = 15.0
"""Postures of one motion within this much elevation are the same posture in all subjects."""

_SC_TERMS = 3
"""Of the smooth course that SC may have over elevation: a parabola."""

_RANK = 1e-6
"""Singular values below this share of the largest are columns that say nothing new."""

_ANGLES = 6


def estimate_noise(
    girdle: Girdle, effects: tuple[Effect, ...], data: Observed, given_deg: float | None = None
) -> NoiseEstimate:
    """Estimate the noise: the SD of the angles, given, estimated (without noisy subjects) or assumed, and that of the
    landmarks, estimated or assumed."""
    landmark_mm = _landmark_noise_mm(data)
    if given_deg is not None:
        return NoiseEstimate(Noise(given_deg, landmark_mm), np.inf, "given")
    angles_only = replace(data, values=data.values[:_ANGLES], measured=data.measured[:_ANGLES])
    fitted = fit_hypotheses(girdle, effects, [()], angles_only, ASSUMED)[0]
    everyone = _outside_own_columns(fitted, angles_only)
    noisy_deg = _noisy_deg(everyone)
    squares, freedom = _unexplained([one for s, one in enumerate(everyone) if s not in noisy_deg])
    if freedom < FEWEST_DEGREES:
        return NoiseEstimate(Noise(ASSUMED.angle_deg, landmark_mm), float(FEWEST_DEGREES), "assumed")
    angle_deg = max(LEAST.angle_deg, ASSUMED.angle_deg * float(np.sqrt(squares / freedom)))
    return NoiseEstimate(Noise(angle_deg, landmark_mm), float(freedom), "estimated", noisy_deg)


class _OutsideOwnColumns(NamedTuple):
    """One subject along the directions that its own columns do not span, orthonormal ones."""

    left: Float[np.ndarray, " directions"]
    """Of y."""
    common: Float[np.ndarray, "directions columns"]
    """Of the columns that subjects have in common."""


def _noisy_deg(everyone: Sequence[_OutsideOwnColumns]) -> dict[int, float]:
    """The subjects that scatter far more than the others, and their SD; none where they are too many to be exceptions.

    A mean square of n degrees of freedom is distributed as the cube of a normal variable (Wilson and Hilferty 1931).
    """
    each = np.array([_unexplained([one]) for one in everyone])
    squares, freedom = np.where(each[:, 1] > 0, each.T, np.nan)
    if np.isnan(squares).all():
        return {}
    variance = squares / freedom
    by_chance = (1.0 - 2.0 / (9.0 * freedom) + _SURELY * np.sqrt(2.0 / (9.0 * freedom))) ** 3
    limit = np.nanmedian(variance) * np.maximum(_NOISY**2, by_chance)
    noisy = np.flatnonzero(variance > np.maximum(limit, (_ORDINARY_DEG / ASSUMED.angle_deg) ** 2))
    if len(noisy) > _MOST_NOISY * len(variance):
        return {}
    return {int(s): ASSUMED.angle_deg * float(np.sqrt(variance[s])) for s in noisy}


def _outside_own_columns(fitted: LinearisedFit, data: Observed) -> list[_OutsideOwnColumns]:
    """Of every subject; its postures that have all their angles."""
    own = np.concatenate([fitted.X, discrepancy_columns(fitted, data, SMOOTH)], axis=2)
    common = _posture_columns(fitted, data)
    complete = np.repeat(data.counted & data.measured.all(axis=0), len(CONSTRAINTS), axis=0).T
    bases = [_complement(columns[real]).T for columns, real in zip(own, complete, strict=True)]
    return [
        _OutsideOwnColumns(basis @ y[real], basis @ shared[real])
        for basis, y, shared, real in zip(bases, fitted.y, common, complete, strict=True)
    ]


def _unexplained(subjects: Sequence[_OutsideOwnColumns]) -> tuple[float, int]:
    """The sum of squares of what these subjects have not in common either, and its degrees of freedom; one subject has
    nothing in common with others."""
    left = np.concatenate([one.left for one in subjects])
    if len(subjects) == 1 or not len(left):
        return float((left**2).sum()), len(left)
    free = _complement(np.concatenate([one.common for one in subjects]))
    return float(((free.T @ left) ** 2).sum()), free.shape[1]


def _posture_columns(fitted: LinearisedFit, data: Observed) -> Float[np.ndarray, "subjects residuals more"]:
    """One column for each constraint at each elevation of each motion."""
    where = np.round(data.elevation_deg / _BIN_DEG) + 1000.0 * data.motion
    chosen = where.T[..., None] == np.unique(where[data.counted])
    columns = fitted.root[..., : len(CONSTRAINTS), None] * chosen[:, :, None, None]
    return columns.reshape(*fitted.y.shape, -1)


def _complement(columns: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n free"]:
    """Orthonormal basis of what the columns do not span."""
    U, S, _ = np.linalg.svd(columns, full_matrices=True)
    return U[:, int((_RANK * S.max(initial=0.0) < S).sum()) :]


def _landmark_noise_mm(data: Observed) -> float:
    """RMS of SC beyond a parabola over elevation in each subject and motion."""
    squares, freedom = 0.0, 0
    for subject in range(data.counted.shape[1]):
        for motion in range(len(data.motions)):
            chosen = data.counted[:, subject] & (data.motion[:, subject] == motion)
            for value, known in zip(data.values[_ANGLES:][:3], data.measured[_ANGLES:][:3], strict=True):
                at = chosen & known[:, subject]
                terms = np.polynomial.legendre.legvander(data.elevation_deg[at, subject] / 90.0, _SC_TERMS - 1)
                free = _complement(terms) if at.any() else np.zeros((0, 0))
                squares += float(((free.T @ value[at, subject]) ** 2).sum())
                freedom += free.shape[1]
    if freedom < FEWEST_DEGREES:
        return ASSUMED.landmark_mm
    return max(LEAST.landmark_mm, float(np.sqrt(squares / freedom)))
