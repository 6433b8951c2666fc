"""The objective of the adaptation, E = D + w mean(J_p), and its variants (thesis Eq. 6.3-6.5).

The thesis leaves open whether D is a mean of squares, their root or, as Eq. 6.3 is printed, a mean of lengths; whether
points and postures are summed or averaged; and the units. An objective variant fixes all of these choices. Every
variant has the optimum of some sum_i u_i d_i^2 [mm^2] + W mean(J_p) [deg^2] over the thorax points: the variant only
changes u and W.

One variant is not from the thesis: with ``landmarks`` E = D + v L + w mean(J_p), where L = mean((d(TS) - const1)^2,
(d(AI) - const2)^2) over the measured positions of TS and AI in the postures of E. There d is the signed distance to the
ellipsoid, and L has the units of D. AC and SC would add nothing: no constraint keeps them near the ellipsoid.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from motions.arrays import Array, xp
from motions.errors import InputError

WEIGHT = 10.0
"""w of Eq. 6.5 (thesis 6.2.6)."""

MOST_WEIGHT = 1e5
"""Largest allowed w. Up to it every shipped subject can be adapted with every shipped set; beyond it rounding of w J
hides D. The best w on held-out motions is below 1000 (``adapt.trust.weight_choice``)."""


def mean_square_deg2(
    angles: Float[Array, " 6 *batch"], measured_angles: Float[Array, " 6 *batch"], weights: Float[Array, " 6 *batch"]
) -> Float[Array, " *batch"]:
    """Compute J_p in deg^2 (Eq. 6.1) from angles and measured angles in rad.

    ``weights``: 2 / m (180 / pi)^2 for each of the m measured angles, 0 for the others.
    """
    return 0.5 * xp.sum(weights * (angles - measured_angles) ** 2, axis=0)


KINK_MM = 0.01
"""Distance below which a length |d| is rounded off to sqrt(d^2 + KINK^2). No thorax point is known as accurately, and E
becomes differentiable at the optimum of an ellipsoid that passes through some points."""

_NOTHING = 1e-12
"""Smallest mean under a root, mm^2 or deg^2. Smaller means are set to it: the root is not differentiable at 0."""


@dataclass(frozen=True)
class AtOptimum:
    """Terms of E of a batch of problems."""

    distance_mm: Float[np.ndarray, "points problems"]
    point_weights: Float[np.ndarray, "points problems"]
    """Weights 1/n for each of n thorax points, 0 for padding."""
    mean_j_deg2: Float[np.ndarray, " problems"]
    postures: Int[np.ndarray, " problems"]
    L_mm2: Float[np.ndarray, " problems"]
    """L of the measured TS and AI; NaN where none was measured or L does not count."""

    @property
    def D_mm2(self) -> Float[np.ndarray, " problems"]:
        """D, the mean squared distance of the points."""
        return np.sum(self.point_weights * self.distance_mm**2, axis=0)

    @property
    def points(self) -> Int[np.ndarray, " problems"]:
        """Number of thorax points that count."""
        return np.sum(self.point_weights > 0.0, axis=0)


@dataclass(frozen=True)
class ObjectiveVariant:
    """Units of D and J in E, the power of the distances in E, and the choice of sums or means."""

    distance_per_mm: float = 1.0
    angle_per_deg: float = 1.0
    form: Literal["squares", "roots", "lengths"] = "squares"
    """Form of D and J: mean squares; roots of mean squares; or, for ``lengths``, D a mean of lengths |d| and J a mean
    square."""
    sum_points: bool = False
    """True where D is the sum over the points instead of their mean."""
    sum_postures: bool = False
    """True where the J_p are summed instead of averaged."""
    landmarks: float = 0.0
    """Weight v of L; allowed only with the default values of all other fields."""

    def equivalent(
        self, w: float, at: AtOptimum
    ) -> tuple[Float[np.ndarray, "points problems"], Float[np.ndarray, " problems"]]:
        """Compute u (with sum 1) and W of the equivalent E = sum u d^2 [mm^2] + W mean(J) [deg^2].

        With roots W depends on D and J themselves, d(sqrt D + w sqrt J) = (dD + w sqrt(D / J) dJ) / (2 sqrt D); with
        lengths u depends on the distances, d|d| = d(d^2) / (2 |d|) (iteratively reweighted least squares).
        """
        points, postures = self._counts(at)
        share = w * self.angle_per_deg**2 / self.distance_per_mm**2 * postures / points
        if self.form == "lengths":
            u = at.point_weights / (2.0 * _length_mm(at.distance_mm))
            return u / u.sum(axis=0), share * self.distance_per_mm / u.sum(axis=0)
        if self.form == "roots":
            ratio = np.maximum(at.D_mm2, _NOTHING) / np.maximum(at.mean_j_deg2, _NOTHING)
            return at.point_weights, np.sqrt(w * share * ratio)
        return at.point_weights, share

    def value(self, w: float, at: AtOptimum) -> Float[np.ndarray, " problems"]:
        """Compute E in the units of the variant."""
        points, postures = self._counts(at)
        power = _length_mm(at.distance_mm) if self.form == "lengths" else at.distance_mm**2
        unit = self.distance_per_mm if self.form == "lengths" else self.distance_per_mm**2
        D = unit * points * np.sum(at.point_weights * power, axis=0)
        D = D + self.landmarks * np.nan_to_num(at.L_mm2)
        J = self.angle_per_deg**2 * postures * at.mean_j_deg2
        return np.sqrt(D) + w * np.sqrt(J) if self.form == "roots" else D + w * J

    def _counts(self, at: AtOptimum):
        """Return the factors of the means of D and J."""
        return np.where(self.sum_points, at.points, 1.0), np.where(self.sum_postures, at.postures, 1.0)


def _length_mm(distance_mm):
    """Compute |d|, rounded off at 0."""
    return np.sqrt(distance_mm**2 + KINK_MM**2)


OBJECTIVES = {
    "mm2_deg2": ObjectiveVariant(),
    "cm2_deg2": ObjectiveVariant(0.1),
    "cm2_rad2": ObjectiveVariant(0.1, np.pi / 180.0),
    "rms_cm_rad": ObjectiveVariant(0.1, np.pi / 180.0, "roots"),
    "rms_mm_deg": ObjectiveVariant(form="roots"),
    "mm_deg2": ObjectiveVariant(form="lengths"),
    "cm_deg2": ObjectiveVariant(0.1, form="lengths"),
    "sum_mm2_deg2": ObjectiveVariant(sum_points=True),
    "sum_cm2_deg2": ObjectiveVariant(0.1, sum_points=True),
    "sum_mm_deg2": ObjectiveVariant(form="lengths", sum_points=True),
    "sum_mm2_sum_deg2": ObjectiveVariant(sum_points=True, sum_postures=True),
    "mm2_sum_deg2": ObjectiveVariant(sum_postures=True),
    "mm2_deg2_landmarks": ObjectiveVariant(landmarks=1.0),
}
"""Objective variants by name; ``mm2_deg2`` is the default. docs/research/thesis.md compares the variants that the
thesis leaves open."""

DEFAULT_OBJECTIVE = "mm2_deg2"


def check_objective(objective: str, place: str = "objective") -> None:
    """Raise an InputError that names the place where this is no name of ``OBJECTIVES``."""
    if objective not in tuple(OBJECTIVES):  # a tuple, because the value may be unhashable
        raise InputError(place, None, f"unknown variant '{objective}'", f"Use one of {', '.join(OBJECTIVES)}")


def _is_number(value: ArrayLike) -> bool:
    return not np.ndim(value) and np.asarray(value).dtype.kind in "fiu"


def check_weight(weight: float, place: str = "weight") -> None:
    """Check that w is a number above 0, at most ``MOST_WEIGHT``; raise an InputError that names the place if not."""
    if not _is_number(weight):
        raise InputError(place, None, f"w is {weight!r}", f"Give one number, as {WEIGHT:g}")
    if weight == 0.0:
        cause = "with w = 0 the measured angles have no part in E, and nothing is adapted to them"
        raise InputError(place, None, cause, "Give a positive number, as 10, or use girdle fit (fit_postures)")
    if not 0.0 < weight <= MOST_WEIGHT:
        remedy = (
            f"Give a number between 0 and {MOST_WEIGHT:g}, as {WEIGHT:g}: beyond it the thorax points no longer count"
        )
        raise InputError(place, None, f"w of E = D + w mean(J) is {weight:g}", remedy)


def down_weighted(weight: float, thorax_downweighting: float, place: str = "thorax_downweighting") -> float:
    """Return the w with which prior thorax points, another person's, count 1/k: k w, because D / k + w mean(J) has its
    minimum where D + k w mean(J) has it.

    Raise an InputError that names the place where k is no number from 1, or where k w exceeds ``MOST_WEIGHT``.
    """
    if not _is_number(thorax_downweighting) or not 1.0 <= thorax_downweighting <= MOST_WEIGHT / weight:
        remedy = f"Give a number from 1 to {MOST_WEIGHT / weight:g}, as 30: the prior thorax points count a thirtieth"
        raise InputError(place, None, f"the down-weighting of thorax points is {thorax_downweighting}", remedy)
    return weight * thorax_downweighting
