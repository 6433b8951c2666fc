"""Test whether the clavicle's axial rotation was measured, or computed from the other five angles.

Landmarks give the clavicle no third axis, and many laboratories compute its axial rotation: as the turn that moves the
SC and AC joints least from rest, or the AC joint alone (van der Helm & Pronk 1995), or by a regression. With any rule
and any rest, the computed rotation is a function of the angles in the file, including their noise; a measured rotation
has noise of its own.

Third differences D along the motions remove smooth changes (``fit.noise``), and for the axial rotation c

    D c = D p(a) + e,   p a polynomial of second order in the other five angles a, the same for all subjects

The variance s^2 of e is what c has of its own. Each of the other five angles has a variance s_j^2 in the same way,
given the other four. The hypothesis that c has noise of its own, with an SD of at least a third of the smallest s_j, is
rejected at 1 % by

    F = s^2 / (s_min^2 / 9),   p-value P(F(k n, k n_min) <= F)

n: rows less coefficients; k = 0.36, because the differences overlap. A rotation that is the same in all postures counts
as computed too. The test cannot detect a rule that was applied to noise-free or smoothed angles where the file has
other angles; a rotation that got noise afterwards; a computed rotation where a curve with corners, rougher than the
noise, was added to the other angles afterwards; or a computed rotation in fewer than some 30 postures (the polynomial
has 20 coefficients). A computed rotation may differ from the bone's rotation by a constant alone, so no gap shows that
it is an estimate.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.noise import INDEPENDENT, ORDER
from adapt.diagnosis.fit.shoulders import Shoulders
from motions.table import ANGLES

ESTIMATE = "clavicle_axial_estimate"

_TURNED = "clavicle_frame_bias"

AXIAL = ANGLES.index("clavicle_x")

_LEAST_NOISE = 1.0 / 3.0
"""Smallest SD of the noise of a measured rotation, relative to the least noisy other angle: bone pins have 0.9 to 2.5.
The rules above have 0.01 to 0.1, because they are no polynomials."""

_ERROR = 0.01
"""Significance level: frequency with which a rotation with this smallest noise is taken for a computed one."""


class _Unexplained(NamedTuple):
    variance: float
    freedom: int


def is_its_zero(cause: str, known: Collection[str]) -> bool:
    """Check whether a cause is a consequence of a computed rotation that is ``known``.

    A computed rotation starts at its own rest, so the clavicle's frame is turned by the same angle in every posture.
    """
    return cause == _TURNED and ESTIMATE in known


def axial_is_computed(shoulders: Shoulders) -> bool:
    """Check whether the axial rotation is a function of the other five angles in its noise too, over all subjects."""
    measured = np.asarray(shoulders.measured.all(axis=0))
    known = (rows[measured[rows]] for rows in shoulders.sequences())
    sequences = [rows for rows in known if len(rows) > ORDER]
    if not sequences:
        return False
    others = np.delete(shoulders.angles, AXIAL, axis=0)
    axial = _unexplained(shoulders.angles[AXIAL], others, sequences)
    each = [_unexplained(one, np.delete(others, k, axis=0), sequences) for k, one in enumerate(others)]
    noisy = [one for one in each if one.freedom > 0 and one.variance > 0.0]
    return bool(axial.freedom > 0 and noisy) and _p_value(axial, min(noisy)) < _ERROR


def _p_value(axial: _Unexplained, least: _Unexplained) -> float:
    from scipy.special import fdtr  # slow import that not every command needs

    ratio = axial.variance / (_LEAST_NOISE**2 * least.variance)
    return float(fdtr(INDEPENDENT * axial.freedom, INDEPENDENT * least.freedom, ratio))


def _unexplained(
    angle: Float[np.ndarray, " rows"],
    others: Float[np.ndarray, "others rows"],
    sequences: Sequence[Int[np.ndarray, " own"]],
) -> _Unexplained:
    """Compute the variance (rad^2) of third differences of an angle that no polynomial in the other angles explains."""
    terms = _polynomial(others)
    A = np.concatenate([np.diff(terms[:, rows], ORDER, axis=1).T for rows in sequences])
    b = np.concatenate([np.diff(angle[rows], ORDER) for rows in sequences])
    solution, _, rank, _ = np.linalg.lstsq(A, b)
    freedom = len(b) - int(rank)
    return _Unexplained(float(np.sum((b - A @ solution) ** 2)) / max(1, freedom), freedom)


def _polynomial(angles: Float[np.ndarray, "n rows"]) -> Float[np.ndarray, "terms rows"]:
    """Compute all terms of first and second order, about the mean."""
    away = angles - angles.mean(axis=1, keepdims=True)
    first, second = np.triu_indices(len(away))
    return np.concatenate([away, away[first] * away[second]])
