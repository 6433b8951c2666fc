"""Model of the unexplained part: a Gaussian process along the motions, per shoulder and common to all shoulders.

In each of the three constraints, y of the rows r and r' has the covariance

    noise^2 [r = r'] + own(r, r') [same shoulder] + common(r, r')
    own    = of_motion^2     near_motion + of_shoulder^2 near
    common = common_motion^2 near_motion + common^2      near

The kernel near = (1 + d) exp(-d), ``d = sqrt(3) |elevation - elevation'| / length``, describes a curve that may bend
anywhere but has no corners (Matern 3/2: Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, eq. 4.17).
A smoother kernel takes the least difference between neighbours for evidence: a tenth of a degree of noise then changes
half the names. The kernel near_motion is 0 between kinds of motion; where elevation hardly changes along a motion, the
number of the posture is a second coordinate. Because unexplained parts are correlated, a further posture of a motion,
or a further shoulder with a similar unexplained part, adds little information.

Every coordinate of a measured landmark (``fit.positions.position_rows``), and every measured angle relative to the
landmarks, has beside its noise the covariance

    own^2 (near_motion + near) / 2 [same shoulder] + common^2 near,   own and common in mm and in degrees
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.shoulders import Shoulders
from models.girdle import CONSTRAINTS


class Discrepancy(NamedTuple):
    """Hyperparameters of the linear model: SDs of y and of positions, correlation length along a motion, and spread of
    amplitudes and of bones between persons."""

    noise_deg: float
    of_motion_deg: float
    of_shoulder_deg: float
    common_motion_deg: float
    common_deg: float
    length_deg: float
    between_shoulders: float
    """SD of the subject-level amplitudes about their mean, relative to their prior SD."""
    own_mm: float
    """SD of a landmark coordinate about its place in the bone, along the motions of a shoulder."""
    common_mm: float
    """SD of the part of a landmark coordinate that all shoulders have in common."""
    own_turn_deg: float
    """SD of a measured angle relative to its landmarks, along the motions of a shoulder, beside the noise."""
    common_turn_deg: float
    """SD of the part of a measured angle, relative to its landmarks, that all shoulders have in common."""
    people: float
    """Scale of the differences between persons in landmark places in the bones (``models.person.own_bones``)."""

    @property
    def smooth_deg2(self) -> float:
        """Variance of the part of y that is smooth along the motions."""
        return self.of_motion_deg**2 + self.of_shoulder_deg**2 + self.common_motion_deg**2 + self.common_deg**2

    def only(self, names: Sequence[str]) -> "Discrepancy":
        """Keep the named hyperparameters and set the others to 0."""
        return self._replace(**{name: 0.0 for name in self._fields if name not in names})


TYPICAL = Discrepancy(1.0, 0.5, 0.5, 0.5, 0.5, 40.0, 0.3, 1.0, 0.5, 0.5, 0.5, 1.0)
"""Typical hyperparameters: medians of the log-normal priors."""

LOG_SD = np.array([0.5, 1.4, 1.4, 1.4, 1.4, 0.5, 1.0, 1.0, 1.0, 1.4, 1.4, 0.7])
"""Prior SDs of the logarithms: a factor of 4; of 2.7 between shoulders and for landmark coordinates; of 2 for
``people``; and of 1.6 for the length and the noise, since the noise of measured angles is between half a degree (bone
pins) and two (palpation). With less noise the modes of measured motions lie in long, narrow ridges, and the end point
of a search depends on its starting point."""

_COMMON = ("common_motion_deg", "common_deg", "common_mm", "common_turn_deg")
_OWN = ("of_motion_deg", "of_shoulder_deg", "own_mm", "own_turn_deg")

NOTHING_OF: Mapping[str, tuple[str, ...]] = MappingProxyType({"noise": _COMMON + _OWN, "own": _COMMON, "common": ()})
"""Possible beliefs about the unexplained part, and the hyperparameters that are 0 in each: noise alone; noise and a
smooth part of each shoulder, as own bones allow; both of these and a smooth part that all shoulders have in common."""

OF_POSITIONS = ("own_mm", "common_mm", "own_turn_deg", "common_turn_deg", "people")
"""Hyperparameters of positions alone."""

_STEP_DEG = 5.0
"""Distance of the support points of the curves that shoulders have in common."""

_LEAST_VARIANCE = 1e-2
"""Smallest variance of a curve, relative to the largest, at the typical length. The common curves that are left out
hold 1 % of the common variance, 5 % at a length of 22 deg."""

_LEAST_OF_FEW = 5e-2
"""The same limit for the common curves of positions, larger because every coordinate and every angle has such curves:
8 % of the common variance is lost."""

_NOTHING = 1e-12
"""Share of the largest variance up to which a variance is rounding error."""


_UNKNOWN = 2
"""Number of listed causes that are together as improbable as one unlisted cause: an explanation by a pair of listed
causes comes first."""


class Belief(NamedTuple):
    """One belief about the unexplained part."""

    left: str
    """Key of ``NOTHING_OF``."""
    discrepancy: Discrepancy
    log_volume: float = 0.0
    """Logarithm of the integral over the hyperparameters, relative to the evidence at their mode."""


def log_weights(beliefs: Sequence[Belief], log_odds: float) -> Float[np.ndarray, " beliefs"]:
    """Compute the prior log probability of each belief, with its integral over the hyperparameters.

    A part that all shoulders have in common acts like an unlisted cause and has its prior probability; all beliefs with
    such a part share this probability. ``log_odds``: prior log odds of one listed cause.
    """
    count = sum(one.left == "common" for one in beliefs)
    of_common = _UNKNOWN * log_odds - np.log(max(1, count))
    weights = np.array([of_common if one.left == "common" else 0.0 for one in beliefs])
    return weights - np.logaddexp.reduce(weights) + [one.log_volume for one in beliefs]


@dataclass(frozen=True)
class Whitening:
    """Whitening of y of every shoulder, and the curves that shoulders have in common, with factors of SD 1.

    Each constraint is whitened by itself, or all three together: all rows of one constraint, then of the next.
    """

    rows: tuple[Int[np.ndarray, " own"], ...]
    """Row indices of each shoulder."""
    inverse_root: tuple[Float[np.ndarray, "m m"], ...]
    """L^-1 of the covariance L L' of each shoulder's own part."""
    curves: tuple[Float[np.ndarray, "m curves"], ...]
    """L^-1 times the common curves at the rows of each shoulder."""
    log_determinants: Float[np.ndarray, " subjects"]
    """Log determinant of L L' of each shoulder, over three constraints."""

    def without(self, known: Sequence[Float[np.ndarray, "3*own 3*own"]]) -> "Whitening":
        """Subtract the ``known`` covariance from that of each shoulder; its constraints are then whitened together."""
        every, roots, curves = np.eye(len(CONSTRAINTS)), [], []
        for inverse, of_shoulder, less in zip(self.inverse_root, self.curves, known, strict=True):
            root = np.linalg.inv(inverse)
            roots.append(np.linalg.cholesky(np.kron(every, root @ root.T) - less))
            curves.append(np.linalg.solve(roots[-1], np.kron(every, root @ of_shoulder)))
        log_determinants = np.array([2.0 * np.log(np.diag(root)).sum() for root in roots])
        return Whitening(self.rows, tuple(map(np.linalg.inv, roots)), tuple(curves), log_determinants)


def whitening(
    shoulders: Shoulders,
    discrepancy: Discrepancy,
    curves: Float[np.ndarray, "rows curves"],
    seen: Bool[np.ndarray, " rows"] | None = None,
) -> Whitening:
    """Factor the covariance of all rows, or of those where ``seen`` is True; ``curves``: of ``common_curves``."""
    seen = np.ones(len(shoulders.subject), bool) if seen is None else seen
    rows, roots, common, log_determinants = [], [], [], []
    for subject in range(len(shoulders.subjects)):
        own = shoulders.rows_of(subject)
        own = own[seen[own]]
        near, of_motion = _alike(shoulders, own, discrepancy.length_deg)
        covariance = discrepancy.of_motion_deg**2 * of_motion + discrepancy.of_shoulder_deg**2 * near
        root = np.linalg.cholesky(covariance + discrepancy.noise_deg**2 * np.eye(len(own)))
        inverse = np.linalg.inv(root)
        rows.append(own)
        roots.append(inverse)
        common.append(inverse @ curves[own])
        log_determinants.append(2.0 * len(CONSTRAINTS) * np.log(np.diag(root)).sum())
    return Whitening(tuple(rows), tuple(roots), tuple(common), np.array(log_determinants))


def common_curves(shoulders: Shoulders, discrepancy: Discrepancy) -> Float[np.ndarray, "rows curves"]:
    """Compute the curves of y that all shoulders have in common, with factors of SD 1."""
    return _curves(shoulders, _common, discrepancy, _LEAST_VARIANCE)


def own_position_curves(
    shoulders: Shoulders, own: Int[np.ndarray, " own"], length_deg: float
) -> Float[np.ndarray, "own curves"]:
    """Compute the curves of a landmark coordinate or a measured angle in one shoulder, with factors of SD 1."""
    typical, covariance = (np.mean(_alike(shoulders, own, one), axis=0) for one in (TYPICAL.length_deg, length_deg))
    values, vectors = _largest(covariance, typical, _LEAST_VARIANCE)
    return vectors * np.sqrt(values)


def common_position_curves(shoulders: Shoulders, length_deg: float) -> Float[np.ndarray, "rows curves"]:
    """Compute the curves along the elevation that coordinates or angles of all shoulders have in common."""
    at = TYPICAL._replace(length_deg=length_deg)
    return _curves(shoulders, lambda one, other, at: _near(one[0], other[0], at.length_deg), at, _LEAST_OF_FEW)


def _alike(
    shoulders: Shoulders, own: Int[np.ndarray, " own"], length_deg: float
) -> tuple[Float[np.ndarray, "own own"], Float[np.ndarray, "own own"]]:
    """Compute the kernels near and near_motion of the rows of one shoulder."""
    elevation, along = shoulders.coordinates_deg[:, own]
    near = _near(elevation, elevation, length_deg)
    of_motion = near * _near(along, along, length_deg) * _same(shoulders.motion[own], shoulders.motion[own])
    return near, of_motion


def _curves(
    shoulders: Shoulders, common: Callable, discrepancy: Discrepancy, least: float
) -> Float[np.ndarray, "rows curves"]:
    """Compute curves whose sum, with independent factors of SD 1, has the common covariance.

    The covariance is interpolated between support points. Curves with less than ``least`` of the largest variance are
    left out.
    """
    elevation, along = shoulders.coordinates_deg
    every = np.stack([elevation, along, shoulders.motion])
    points = np.unique(np.round(every / [[_STEP_DEG], [_STEP_DEG], [1.0]]), axis=1) * [[_STEP_DEG], [_STEP_DEG], [1.0]]
    typical, covariance = (common(points, points, one) for one in (TYPICAL, discrepancy))
    values, vectors = _largest(covariance, typical, least)
    return common(every, points, discrepancy) @ vectors / np.sqrt(values)


def _largest(
    covariance: Float[np.ndarray, "n n"], typical: Float[np.ndarray, "n n"], least: float
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "n k"]]:
    """Find the largest eigenvalues of a covariance, and their eigenvectors.

    Their number is the number of eigenvalues of the ``typical`` covariance above ``least`` of its largest eigenvalue.
    The number therefore does not jump where the length changes, and the evidence is smooth.
    """
    count = int(np.count_nonzero((of_typical := np.linalg.eigvalsh(typical)) > least * of_typical[-1]))
    values, vectors = np.linalg.eigh(covariance)
    first = max(len(values) - count, int(np.count_nonzero(values <= _NOTHING * max(values[-1], _NOTHING))))
    return values[first:], vectors[:, first:]


def _common(
    one: Float[np.ndarray, "3 n"], other: Float[np.ndarray, "3 m"], discrepancy: Discrepancy
) -> Float[np.ndarray, "n m"]:
    near = _near(one[0], other[0], discrepancy.length_deg)
    of_motion = near * _near(one[1], other[1], discrepancy.length_deg) * _same(one[2], other[2])
    return discrepancy.common_motion_deg**2 * of_motion + discrepancy.common_deg**2 * near


def _near(one: Float[np.ndarray, " n"], other: Float[np.ndarray, " m"], length: float) -> Float[np.ndarray, "n m"]:
    d = np.sqrt(3.0) * np.abs(one[:, None] - other) / length
    return (1.0 + d) * np.exp(-d)


def _same(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return one[:, None] == other
