"""What no cause explains: a Gaussian process along the motions, of each shoulder and of all shoulders together.

In each of the three constraints, y of the rows r and r' has the covariance

    noise^2 [r = r'] + own(r, r') [same shoulder] + common(r, r')
    own    = of_motion^2     near_motion + of_shoulder^2 near
    common = common_motion^2 near_motion + common^2      near

near = (1 + d) exp(-d), d = sqrt(3) |elevation - elevation'| / length: a course that may bend anywhere, without corners
(Matern 3/2: Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, eq. 4.17). One that is smoother still
takes the least difference between neighbours for evidence: a tenth of a degree of noise then changes half the names.
near_motion is 0 between kinds of motion; where elevation hardly changes along a motion, the number of the posture
stands beside it. So what is unexplained says little more in a further posture of a motion, or in a further shoulder,
where it is alike there.

So too of every coordinate of a measured landmark (``fit.position_rows``), and of every measured angle about what the
landmarks show, which have besides their noise

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
    own_turn_deg: float
    """SD of a measured angle about what its landmarks show, along the motions of a shoulder, beside its noise."""
    common_turn_deg: float
    """What all shoulders have in common of it."""
    people: float
    """Scale of how persons differ in where landmarks are in their bones (``models.person.own_bones``)."""

    @property
    def smooth_deg2(self) -> float:
        """Variance of y that is smooth along the motions."""
        return self.of_motion_deg**2 + self.of_shoulder_deg**2 + self.common_motion_deg**2 + self.common_deg**2

    def only(self, names: Sequence[str]) -> "Discrepancy":
        """Keep some numbers; the others are 0."""
        return self._replace(**{name: 0.0 for name in self._fields if name not in names})


TYPICAL = Discrepancy(1.0, 0.5, 0.5, 0.5, 0.5, 40.0, 0.3, 1.0, 0.5, 0.5, 0.5, 1.0)
"""Before any data: the medians of log-normal priors."""

LOG_SD = np.array([0.5, 1.4, 1.4, 1.4, 1.4, 0.5, 1.0, 1.0, 1.0, 1.4, 1.4, 0.7])
"""SDs of their logarithms: a factor of 4, of 2.7 between shoulders, and of 1.6 for the length and the noise: that of
measured angles is between half a degree (bone pins) and two (palpation). With less the modes of measured motions lie in
long, narrow ridges, and where the steps end depends on where they begin."""

_COMMON = ("common_motion_deg", "common_deg", "common_mm", "common_turn_deg")
_OWN = ("of_motion_deg", "of_shoulder_deg", "own_mm", "own_turn_deg")

NOTHING_OF: Mapping[str, tuple[str, ...]] = MappingProxyType({"noise": _COMMON + _OWN, "own": _COMMON, "common": ()})
"""What may be left beside the causes, and what there is then none of: noise alone; what shoulders do each in its own
way, as own bones let them; and what all do alike."""

OF_POSITIONS = ("own_mm", "common_mm", "own_turn_deg", "common_turn_deg", "people")
"""What is of positions alone."""

_STEP_DEG = 5.0
"""Between the points that carry what shoulders have in common."""

_LEAST_VARIANCE = 1e-2
"""Of a curve that shoulders have in common, of the largest, at the typical length. Without those below it, 1 % of the
common variance is lost, 5 % at a length of 22 deg."""

_LEAST_OF_FEW = 5e-2
"""So too for positions, of which every coordinate and every angle has curves: 8 % is lost."""

_NOTHING = 1e-12
"""Of the largest variance: rounding."""


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
    """Makes y of every shoulder white, with what shoulders have in common as curves of SD 1 beside it.

    Each constraint is white by itself, or all three together: all rows of one, then of the next."""

    rows: tuple[Int[np.ndarray, " own"], ...]
    """Of each shoulder."""
    inverse_root: tuple[Float[np.ndarray, "m m"], ...]
    """L^-1 of the covariance L L' of what is its own."""
    curves: tuple[Float[np.ndarray, "m curves"], ...]
    """L^-1 times what each curve adds to its rows."""
    log_determinants: Float[np.ndarray, " subjects"]
    """Of each L L', of three constraints."""

    def without(self, known: Sequence[Float[np.ndarray, "3*own 3*own"]]) -> "Whitening":
        """Take what is known of each shoulder from its covariance: its constraints are then white together."""
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
    """Factor the covariance of all rows, or of those that are seen, beside ``common_curves``."""
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
    """Give the curves, of SD 1, that y has in common in all shoulders."""
    return _curves(shoulders, _common, discrepancy, _LEAST_VARIANCE)


def own_position_curves(
    shoulders: Shoulders, own: Int[np.ndarray, " own"], length_deg: float
) -> Float[np.ndarray, "own curves"]:
    """Give the curves, of SD 1, that a coordinate of a landmark and a measured angle have in one shoulder."""
    typical, covariance = (np.mean(_alike(shoulders, own, one), axis=0) for one in (TYPICAL.length_deg, length_deg))
    values, vectors = _largest(covariance, typical, _LEAST_VARIANCE)
    return vectors * np.sqrt(values)


def common_position_curves(shoulders: Shoulders, length_deg: float) -> Float[np.ndarray, "rows curves"]:
    """Give those that they have in common in all shoulders, along the elevation."""
    at = TYPICAL._replace(length_deg=length_deg)
    return _curves(shoulders, lambda one, other, at: _near(one[0], other[0], at.length_deg), at, _LEAST_OF_FEW)


def _alike(
    shoulders: Shoulders, own: Int[np.ndarray, " own"], length_deg: float
) -> tuple[Float[np.ndarray, "own own"], Float[np.ndarray, "own own"]]:
    """Compute near and near_motion of rows of one shoulder."""
    elevation, along = shoulders.course_deg[:, own]
    near = _near(elevation, elevation, length_deg)
    of_motion = near * _near(along, along, length_deg) * _same(shoulders.motion[own], shoulders.motion[own])
    return near, of_motion


def _curves(
    shoulders: Shoulders, common: Callable, discrepancy: Discrepancy, least: float
) -> Float[np.ndarray, "rows curves"]:
    """Give curves whose sum, with independent factors of SD 1, has the common covariance, by way of points between
    which it is interpolated; without those of less than ``least`` of the largest variance."""
    elevation, along = shoulders.course_deg
    every = np.stack([elevation, along, shoulders.motion])
    points = np.unique(np.round(every / [[_STEP_DEG], [_STEP_DEG], [1.0]]), axis=1) * [[_STEP_DEG], [_STEP_DEG], [1.0]]
    typical, covariance = (common(points, points, one) for one in (TYPICAL, discrepancy))
    values, vectors = _largest(covariance, typical, least)
    return common(every, points, discrepancy) @ vectors / np.sqrt(values)


def _largest(
    covariance: Float[np.ndarray, "n n"], typical: Float[np.ndarray, "n n"], least: float
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "n k"]]:
    """Find as many of the largest eigenvalues of a covariance, and its eigenvectors, as the typical one has of at least
    that part of its largest: their number does not jump where the length changes, so that the evidence is smooth."""
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
