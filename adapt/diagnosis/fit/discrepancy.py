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
"""

from dataclasses import dataclass
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

    @property
    def between_per_deg(self) -> float:
        """What an adaptation with sizes of its own may have of the prior SD for each degree of the noise
        (``models.effects.amplitudes.PersonalSize``)."""
        return self.between_shoulders / self.noise_deg


TYPICAL = Discrepancy(1.0, 0.5, 0.5, 0.5, 0.5, 40.0, 0.3)
"""Before any data: the medians of log-normal priors."""

LOG_SD = np.array([0.5, 1.4, 1.4, 1.4, 1.4, 0.5, 1.0])
"""SDs of their logarithms: a factor of 4, of 2.7 between shoulders, and of 1.6 for the length and the noise: that of
measured angles is between half a degree (bone pins) and two (palpation). With less the modes of measured motions lie in
long, narrow valleys, and where the steps end depends on where they begin."""

_STEP_DEG = 5.0
"""Between the points that carry what shoulders have in common."""

_LEAST_VARIANCE = 1e-2
"""Of a curve that shoulders have in common, of the largest. Without those below it, 2 % of the common variance is lost,
3 % at worst (measured and simulated motions, length 22 to 40 deg)."""


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
    elevation, along = shoulders.course_deg
    length = discrepancy.length_deg
    curves = _curves(shoulders, discrepancy)
    rows, roots, common, log_determinants = [], [], [], []
    for subject in range(len(shoulders.subjects)):
        own = shoulders.rows_of(subject)
        own = own[seen[own]]
        near = _near(elevation[own], elevation[own], length)
        of_motion = near * _near(along[own], along[own], length) * _same(shoulders.motion[own], shoulders.motion[own])
        covariance = discrepancy.of_motion_deg**2 * of_motion + discrepancy.of_shoulder_deg**2 * near
        root = np.linalg.cholesky(covariance + discrepancy.noise_deg**2 * np.eye(len(own)))
        inverse = np.linalg.inv(root)
        rows.append(own)
        roots.append(inverse)
        common.append(inverse @ curves[own])
        log_determinants.append(2.0 * len(CONSTRAINTS) * np.log(np.diag(root)).sum())
    return Whitening(tuple(rows), tuple(roots), tuple(common), np.array(log_determinants))


def _curves(shoulders: Shoulders, discrepancy: Discrepancy) -> Float[np.ndarray, "rows curves"]:
    """Give curves whose sum, with independent factors of SD 1, has the common covariance, by way of points between
    which it is interpolated."""
    elevation, along = shoulders.course_deg
    every = np.stack([elevation, along, shoulders.motion])
    points = np.unique(np.round(every / [[_STEP_DEG], [_STEP_DEG], [1.0]]), axis=1) * [[_STEP_DEG], [_STEP_DEG], [1.0]]
    values, vectors = np.linalg.eigh(_common(points, points, discrepancy))
    kept = values > _LEAST_VARIANCE * values.max()
    return _common(every, points, discrepancy) @ vectors[:, kept] / np.sqrt(values[kept])


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
