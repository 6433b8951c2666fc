"""What no cause explains: a Gaussian process along the motions, of each shoulder and of all shoulders together.

In each of the three constraints, y of the rows r and r' has the covariance

    noise^2 [r = r'] + own(r, r') [same shoulder] + common(r, r')
    own    = of_motion^2     near_motion + of_shoulder^2 near
    common = common_motion^2 near_motion + common^2      near

near = (1 + d) exp(-d), d = sqrt(3) |elevation - elevation'| / length: a course that may bend anywhere, without corners
(Matern 3/2: Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, eq. 4.17). One that is smoother still
takes the least difference between neighbours for evidence: a tenth of a degree of noise then changes half the names.
near_motion is 0 between kinds of motion; where elevation hardly changes along a motion, the number of the posture
stands beside it. So what is left over says little more in a further posture of a motion, or in a further shoulder,
where it is alike there.

So too of every coordinate of a measured landmark (``fit.position_rows``), which has besides its noise, mm,

    own_mm^2 (near_motion + near) / 2 [same shoulder] + common_mm^2 near
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
    """SDs of y in degrees, how far along a motion it is alike, and how far shoulders are in what a cause does."""

    noise_deg: float
    of_motion_deg: float
    of_shoulder_deg: float
    common_motion_deg: float
    common_deg: float
    length_deg: float
    between_shoulders: float
    """SD of the amplitudes of a shoulder about their mean, of their prior SD."""
    own_mm: float
    """SD of a coordinate of a landmark about its place in its bone, along the motions of a shoulder."""
    common_mm: float
    """What all shoulders have in common of it."""
    people: float
    """Scale of how persons differ in where landmarks are in their bones (``models.person.own_bones``)."""

    @property
    def smooth_deg2(self) -> float:
        """Variance of y that is smooth along the motions."""
        return self.of_motion_deg**2 + self.of_shoulder_deg**2 + self.common_motion_deg**2 + self.common_deg**2

    @property
    def between_per_deg(self) -> float:
        """What an adaptation with sizes of its own may have of the prior SD for each degree of the noise
        (``models.effects.amplitudes.PersonalSize``)."""
        return self.between_shoulders / self.noise_deg


TYPICAL = Discrepancy(1.0, 0.5, 0.5, 0.5, 0.5, 40.0, 0.3, 1.0, 0.5, 1.0)
"""Before any data: the medians of log-normal priors."""

LOG_SD = np.array([0.5, 1.4, 1.4, 1.4, 1.4, 0.5, 1.0, 1.0, 1.0, 0.7])
"""SDs of their logarithms: a factor of 4, of 2.7 between shoulders, and of 1.6 for the length and the noise: that of
measured angles is between half a degree (bone pins) and two (palpation). With less the modes of measured motions lie in
long, narrow valleys, and where the steps end depends on where they begin."""

_COMMON, _OWN = ("common_motion_deg", "common_deg", "common_mm"), ("of_motion_deg", "of_shoulder_deg", "own_mm")

NOTHING_OF: Mapping[str, tuple[str, ...]] = MappingProxyType({"noise": _COMMON + _OWN, "own": _COMMON, "common": ()})
"""What may be left beside the causes, and what there is then none of: noise alone; what shoulders do each in its own
way, as bones of their own let them; and what all do alike."""

OF_POSITIONS = 3
"""So many of these, the last, are of positions."""

_STEP_DEG = 5.0
"""Between the points that carry what shoulders have in common."""

_LEAST_VARIANCE = 1e-2
"""Of a curve that shoulders have in common, of the largest. Without those below it, 2 % of the common variance is lost,
3 % at worst (measured and simulated motions, length 22 to 40 deg)."""

_LEAST_OF_FEW = 5e-2
"""So too for positions, whose coordinates have three to five curves each: 5 % of the common variance is lost."""


_UNKNOWN = 2
"""A cause that is not in the list is as improbable as two that are: an explanation by a pair of them comes first."""


class Belief(NamedTuple):
    """About what no cause explains."""

    left: str
    """Of ``NOTHING_OF``."""
    discrepancy: Discrepancy


def log_weights(beliefs: Sequence[Belief], log_odds: float) -> Float[np.ndarray, " beliefs"]:
    """Compute how probable each is before any data: what all do alike, by whichever estimate, acts like a cause that is
    not in the list; ``log_odds`` are those of one that is."""
    count = sum(one.left == "common" for one in beliefs)
    of_common = _UNKNOWN * log_odds - np.log(max(1, count))
    weights = np.array([of_common if one.left == "common" else 0.0 for one in beliefs])
    return weights - np.logaddexp.reduce(weights)


@dataclass(frozen=True)
class Whitening:
    """Makes y of every shoulder white, with what shoulders have in common as curves of SD 1 beside it."""

    rows: tuple[Int[np.ndarray, " own"], ...]
    """Of each shoulder."""
    inverse_root: tuple[Float[np.ndarray, "own own"], ...]
    """L^-1 of the covariance L L' of what is its own."""
    curves: tuple[Float[np.ndarray, "own curves"], ...]
    """L^-1 times what each curve adds to its rows."""
    log_determinants: Float[np.ndarray, " subjects"]
    """Of each L L', of three constraints."""


def whitening(
    shoulders: Shoulders, discrepancy: Discrepancy, seen: Bool[np.ndarray, " rows"] | None = None
) -> Whitening:
    """Factor the covariance of all rows, or of those that are seen."""
    seen = np.ones(len(shoulders.subject), bool) if seen is None else seen
    curves = _curves(shoulders, lambda one, other: _common(one, other, discrepancy), _LEAST_VARIANCE)
    rows, roots, common, log_determinants = [], [], [], []
    for subject in range(len(shoulders.subjects)):
        own = shoulders.rows_of(subject)
        own = own[seen[own]]
        near, of_motion = _alike(shoulders, own, discrepancy)
        covariance = discrepancy.of_motion_deg**2 * of_motion + discrepancy.of_shoulder_deg**2 * near
        root = np.linalg.cholesky(covariance + discrepancy.noise_deg**2 * np.eye(len(own)))
        inverse = np.linalg.inv(root)
        rows.append(own)
        roots.append(inverse)
        common.append(inverse @ curves[own])
        log_determinants.append(2.0 * len(CONSTRAINTS) * np.log(np.diag(root)).sum())
    return Whitening(tuple(rows), tuple(roots), tuple(common), np.array(log_determinants))


def position_whitening(
    shoulders: Shoulders,
    discrepancy: Discrepancy,
    own: Int[np.ndarray, " own"],
    variance_mm2: Float[np.ndarray, "own n"],
    measured: Bool[np.ndarray, "own n"],
) -> tuple[Float[np.ndarray, "n own own"], float]:
    """Factor the covariance L L' of each coordinate of one shoulder's rows, whose noise has ``variance_mm2``: L^-1, and
    the log determinant of all; a cell that was not measured is apart, with the variance 1."""
    near, of_motion = _alike(shoulders, own, discrepancy)
    smooth = discrepancy.own_mm**2 / 2.0 * (of_motion + near)
    known = measured.T
    covariance = np.where(known[:, :, None] & known[:, None, :], smooth, 0.0)
    covariance += np.where(known, variance_mm2.T, 1.0)[:, None] * np.eye(len(own))
    root = np.linalg.cholesky(covariance)
    log_determinant = 2.0 * float(np.log(np.einsum("nii->ni", root)).sum())
    return np.linalg.inv(root), log_determinant


def position_curves(shoulders: Shoulders, discrepancy: Discrepancy) -> Float[np.ndarray, "rows curves"]:
    """Give the curves that coordinates of landmarks have in common, along the elevation."""
    length = discrepancy.length_deg
    return discrepancy.common_mm * _curves(shoulders, lambda one, other: _near(one[0], other[0], length), _LEAST_OF_FEW)


def _alike(
    shoulders: Shoulders, own: Int[np.ndarray, " own"], discrepancy: Discrepancy
) -> tuple[Float[np.ndarray, "own own"], Float[np.ndarray, "own own"]]:
    """Compute near and near_motion of rows of one shoulder."""
    (elevation, along), length = shoulders.course_deg[:, own], discrepancy.length_deg
    near = _near(elevation, elevation, length)
    of_motion = near * _near(along, along, length) * _same(shoulders.motion[own], shoulders.motion[own])
    return near, of_motion


def _curves(shoulders: Shoulders, common: Callable, least: float) -> Float[np.ndarray, "rows curves"]:
    """Give curves whose sum, with independent factors of SD 1, has the common covariance, by way of points between
    which it is interpolated; without those of less than ``least`` of the largest variance."""
    elevation, along = shoulders.course_deg
    every = np.stack([elevation, along, shoulders.motion])
    points = np.unique(np.round(every / [[_STEP_DEG], [_STEP_DEG], [1.0]]), axis=1) * [[_STEP_DEG], [_STEP_DEG], [1.0]]
    values, vectors = np.linalg.eigh(common(points, points))
    kept = values > max(least * values.max(), 0.0)
    return common(every, points) @ vectors[:, kept] / np.sqrt(values[kept])


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
