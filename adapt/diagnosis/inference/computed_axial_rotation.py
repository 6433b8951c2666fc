"""Is the clavicle's axial rotation measured, or computed from the other five angles?

Landmarks give the clavicle no third axis, and many laboratories compute its axial rotation: as the turn that moves the
SC and AC joints least from rest, the AC joint alone (van der Helm & Pronk 1995), or by a regression. By whatever rule
and from whatever rest, it is then a function of the angles in the file, their noise included; a measured rotation has
noise of its own.

Third differences along the motions take what is smooth away (``fit.noise``), and with D for them

    D c = D p(a) + e,   p a polynomial of second order in the other five angles a, the same for all subjects

e has the variance s^2 of what is the rotation's own in c. In its place each of the other five has s_j^2 beside the
other four. That c has noise of its own, at least a third of the least of theirs, is rejected at 1 % by

    F = s^2 / (s_min^2 / 9),   p-value P(F(k n, k n_min) <= F)

n: rows less coefficients; k = 0.36, for differences that overlap. A rotation that is the same in all postures is
computed too. What cannot be seen: a rule that was applied to angles without noise or smoothed, where the file has
others; a rotation that got noise afterwards; a course with corners put into the other angles afterwards, where it is
rougher than their noise; fewer postures than some 30 (the polynomial has 20 coefficients).
It may differ from the bone's rotation by a constant alone, so no gap shows that it is an estimate.
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
"""Of a measured rotation, of the least noise of the other angles: pins have 0.9 to 2.5 of it. Of the rules above 0.01
to 0.1 is left, for they are no polynomials."""

_ERROR = 0.01
"""How often a rotation with as little noise as that is taken for a computed one."""


class _LeftOver(NamedTuple):
    variance: float
    freedom: int


def is_its_zero(cause: str, known: Collection[str]) -> bool:
    """Tell whether a cause comes with a computed rotation that is ``known``.

    It begins at a rest of its own: the clavicle's frame is turned by as much in every posture.
    """
    return cause == _TURNED and ESTIMATE in known


def axial_is_computed(shoulders: Shoulders) -> bool:
    """Tell whether the axial rotation is a function of the other five angles in the noise, all subjects together."""
    measured = np.asarray(shoulders.measured.all(axis=0))
    known = (rows[measured[rows]] for rows in shoulders.sequences())
    sequences = [rows for rows in known if len(rows) > ORDER]
    if not sequences:
        return False
    others = np.delete(shoulders.angles, AXIAL, axis=0)
    axial = _left_over(shoulders.angles[AXIAL], others, sequences)
    each = [_left_over(one, np.delete(others, k, axis=0), sequences) for k, one in enumerate(others)]
    noisy = [one for one in each if one.freedom > 0 and one.variance > 0.0]
    return bool(axial.freedom > 0 and noisy) and _p_value(axial, min(noisy)) < _ERROR


def _p_value(axial: _LeftOver, least: _LeftOver) -> float:
    from scipy.special import fdtr  # loads slowly: not for every command

    ratio = axial.variance / (_LEAST_NOISE**2 * least.variance)
    return float(fdtr(INDEPENDENT * axial.freedom, INDEPENDENT * least.freedom, ratio))


def _left_over(
    angle: Float[np.ndarray, " rows"],
    others: Float[np.ndarray, "others rows"],
    sequences: Sequence[Int[np.ndarray, " own"]],
) -> _LeftOver:
    """What third differences of an angle have that is no polynomial in the others: its variance, rad^2."""
    terms = _polynomial(others)
    A = np.concatenate([np.diff(terms[:, rows], ORDER, axis=1).T for rows in sequences])
    b = np.concatenate([np.diff(angle[rows], ORDER) for rows in sequences])
    solution, _, rank, _ = np.linalg.lstsq(A, b)
    freedom = len(b) - int(rank)
    return _LeftOver(float(np.sum((b - A @ solution) ** 2)) / max(1, freedom), freedom)


def _polynomial(angles: Float[np.ndarray, "n rows"]) -> Float[np.ndarray, "terms rows"]:
    """All terms of first and second order, about the mean."""
    away = angles - angles.mean(axis=1, keepdims=True)
    first, second = np.triu_indices(len(away))
    return np.concatenate([away, away[first] * away[second]])
