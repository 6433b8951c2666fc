"""The objective of the adaptation, E = D + w mean(J_p), and the ways to read it (thesis Eq. 6.3-6.5).

The thesis leaves open whether D is a mean of squares, their root or, as Eq. 6.3 is printed, a mean of lengths; whether
points and postures are summed or averaged; and the units. A reading is a choice of all. Every reading has the optimum
of some sum_i u_i d_i^2 [mm^2] + W mean(J_p) [deg^2] over the thorax points: the reading only changes u and W.

One reading is not the thesis's: with ``landmarks`` E = D + v L + w mean(J_p), where L = mean((d(TS) - const1)^2,
(d(AI) - const2)^2) over the measured positions of TS and AI in the postures that E is made of, d their signed distance
to the ellipsoid and L in the units of D. AC and SC would add nothing: no constraint keeps them near the ellipsoid.
"""

from dataclasses import dataclass
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from models.adapted_parameters import ADAPTED, ELLIPSOID
from models.derivatives import Distance, distance, ellipsoid_curvature, ellipsoid_slope
from models.ellipsoid import closest_point_multiplier, signed_distance_mm
from models.girdle import Girdle
from motions.arrays import Array, xp
from motions.errors import InputError

WEIGHT = 10.0
"""w of Eq. 6.5 (thesis 6.2.6)."""

KINK_MM = 0.01
"""Below this the length of a distance is rounded off, |d| ~ sqrt(d^2 + KINK^2): no thorax point is known as well, and
an ellipsoid that passes through some points has an optimum with slopes."""

_NOTHING = 1e-12
"""mm^2 or deg^2, below which a mean under a root counts as this: the root has its kink at 0."""


@dataclass(frozen=True)
class AtOptimum:
    """What E is made of, of a batch of problems."""

    distance_mm: Float[np.ndarray, "points problems"]
    point_weights: Float[np.ndarray, "points problems"]
    """1/n for each of n thorax points, 0 for padding."""
    mean_j_deg2: Float[np.ndarray, " problems"]
    postures: Int[np.ndarray, " problems"]
    L_mm2: Float[np.ndarray, " problems"]
    """Of the measured TS and AI; NaN where none was measured, or they do not count."""

    @property
    def points(self) -> Int[np.ndarray, " problems"]:
        """How many points count."""
        return np.sum(self.point_weights > 0.0, axis=0)


@dataclass(frozen=True)
class Reading:
    """Units of D and J in E, what E takes of the distances, and whether it sums or averages."""

    distance_per_mm: float = 1.0
    angle_per_deg: float = 1.0
    form: Literal["squares", "roots", "lengths"] = "squares"
    """D is a mean of squares and J one; both under a root; D is a mean of lengths |d| and J as it is."""
    sum_points: bool = False
    """D is the sum over the points instead of their mean."""
    sum_postures: bool = False
    """J_p are summed instead of averaged."""
    landmarks: float = 0.0
    """v, the weight of L; only beside the default of everything else."""

    def equivalent(
        self, w: float, at: AtOptimum
    ) -> tuple[Float[np.ndarray, "points problems"], Float[np.ndarray, " problems"]]:
        """Compute u (of sum 1) and W of the equivalent E = sum u d^2 [mm^2] + W mean(J) [deg^2].

        With roots W depends on D and J themselves, d(sqrt D + w sqrt J) = (dD + w sqrt(D / J) dJ) / (2 sqrt D); with
        lengths u on the distances, d|d| = d(d^2) / (2 |d|) (iteratively reweighted least squares).
        """
        points, postures = self._counts(at)
        share = w * self.angle_per_deg**2 / self.distance_per_mm**2 * postures / points
        if self.form == "lengths":
            u = at.point_weights / (2.0 * _length_mm(at.distance_mm))
            return u / u.sum(axis=0), share * self.distance_per_mm / u.sum(axis=0)
        if self.form == "roots":
            D = np.sum(at.point_weights * at.distance_mm**2, axis=0)
            ratio = np.maximum(D, _NOTHING) / np.maximum(at.mean_j_deg2, _NOTHING)
            return at.point_weights, np.sqrt(w * share * ratio)
        return at.point_weights, share

    def value(self, w: float, at: AtOptimum) -> Float[np.ndarray, " problems"]:
        """Compute E in the units of the reading."""
        points, postures = self._counts(at)
        power = _length_mm(at.distance_mm) if self.form == "lengths" else at.distance_mm**2
        unit = self.distance_per_mm if self.form == "lengths" else self.distance_per_mm**2
        D = unit * points * np.sum(at.point_weights * power, axis=0)
        D = D + self.landmarks * np.nan_to_num(at.L_mm2)
        J = self.angle_per_deg**2 * postures * at.mean_j_deg2
        return np.sqrt(D) + w * np.sqrt(J) if self.form == "roots" else D + w * J

    def _counts(self, at: AtOptimum):
        """Factors of the means of D and J."""
        return np.where(self.sum_points, at.points, 1.0), np.where(self.sum_postures, at.postures, 1.0)


def _length_mm(distance_mm):
    """|d|, rounded off at 0."""
    return np.sqrt(distance_mm**2 + KINK_MM**2)


READINGS = {
    "mm2_deg2": Reading(),
    "cm2_deg2": Reading(0.1),
    "cm2_rad2": Reading(0.1, np.pi / 180.0),
    "rms_cm_rad": Reading(0.1, np.pi / 180.0, "roots"),
    "rms_mm_deg": Reading(form="roots"),
    "mm_deg2": Reading(form="lengths"),
    "cm_deg2": Reading(0.1, form="lengths"),
    "sum_mm2_deg2": Reading(sum_points=True),
    "sum_cm2_deg2": Reading(0.1, sum_points=True),
    "sum_mm_deg2": Reading(form="lengths", sum_points=True),
    "sum_mm2_sum_deg2": Reading(sum_points=True, sum_postures=True),
    "mm2_sum_deg2": Reading(sum_postures=True),
    "mm2_deg2_landmarks": Reading(landmarks=1.0),
}
"""The readings by name; ``mm2_deg2`` is the default (docs/thesis.md compares those that the thesis leaves open)."""

DEFAULT_READING = "mm2_deg2"


def thorax_distance_mm2(
    girdle: Girdle,
    points_mm: Float[Array, " 3 points *batch"],
    point_weights: Float[Array, " points *batch"],
    levels_mm: Float[Array, " points *batch"] | float = 0.0,
) -> Float[Array, " *batch"]:
    """Compute D, the mean squared distance of the thorax points to the ellipsoid, mm^2.

    ``point_weights`` sum to 1 over the points: 1/n each, 0 for padding. ``levels_mm``: where a point should be, if not
    on the surface.
    """
    spread = girdle.over_postures()
    distance = signed_distance_mm(points_mm, spread.centre_mm, spread.semi_axes_mm)
    return xp.sum(point_weights * (distance - levels_mm) ** 2, axis=0)


class ThoraxPoints:
    """sum u (d - level)^2 as a function of the adapted parameters, with its derivatives by hand
    (``adapt.solvers.reference.subject.Thorax``): D of thorax points, whose level is 0, and L of measured landmarks."""

    def __init__(
        self,
        girdle: Girdle,
        points_mm: Float[Array, " 3 points *batch"],
        point_weights: Float[Array, " points *batch"],
        levels_mm: Float[Array, " points *batch"] | float = 0.0,
    ):
        self.girdle, self.points_mm, self.point_weights, self.levels_mm = girdle, points_mm, point_weights, levels_mm

    def value(self, theta):
        """Compute the sum, mm^2."""
        return thorax_distance_mm2(self.girdle.with_adapted(theta), self.points_mm, self.point_weights, self.levels_mm)

    def distances(self, theta) -> tuple[Distance, list[Array]]:
        """Compute how far every point is from its level, and its slopes in the parameters, the conoid's last."""
        at = self._at(theta)
        return at, [*ellipsoid_slope(at), 0.0 * at.d]

    def slope(self, theta):
        """Compute dD/dtheta, mm^2 a mm."""
        at, slope = self.distances(theta)
        return xp.stack([xp.sum(2.0 * self.point_weights * at.d * x, axis=0) for x in slope])

    def curvature(self, theta):
        """Compute d2D/dtheta2, mm^2 per mm^2."""
        at, slope = self.distances(theta)
        bent = ellipsoid_curvature(at)

        def entry(i, j):
            second = at.d * bent[max(i, j)][min(i, j)] if max(i, j) < len(ELLIPSOID) else 0.0
            return xp.sum(2.0 * self.point_weights * (slope[i] * slope[j] + second), axis=0)

        return xp.stack([xp.stack([entry(i, j) for j in range(len(ADAPTED))]) for i in range(len(ADAPTED))])

    def _at(self, theta) -> Distance:
        moved = self.girdle.with_adapted(theta).over_postures()
        p, a = xp.broadcast_arrays(self.points_mm - moved.centre_mm, moved.semi_axes_mm)
        at = distance(tuple(p), tuple(a), closest_point_multiplier(p, a))
        return at._replace(d=at.d - self.levels_mm)


def down_weighted(weight: float, thorax_downweighting: float, place: str = "thorax_downweighting") -> float:
    """Give w where the prior thorax points, another person's, count 1/k: k w, for D / k + w mean(J) has its minimum
    where D + k w mean(J) has it.

    InputError that names the place where k is no positive number.
    """
    if not 0.0 < thorax_downweighting < np.inf:
        remedy = "Give a positive number, as 30: the prior thorax points then count a thirtieth"
        raise InputError(place, None, f"the down-weighting of thorax points is {thorax_downweighting:g}", remedy)
    return weight * thorax_downweighting


_ON_THE_POINTS_MM2 = 1e-18
"""D of an ellipsoid that lies on its points, 1e-9 mm off them by the digits of their file: nothing is left to fit."""


def fitted_girdle(girdle: Girdle, points_mm: Float[np.ndarray, "3 points"]) -> Girdle:
    """Fit a girdle by :func:`geometric_fit`, as numpy; one whose ellipsoid lies on its points stays as it is."""
    point_weights = np.full(points_mm.shape[1], 1.0 / points_mm.shape[1])
    if thorax_distance_mm2(jax.tree.map(np.asarray, girdle), points_mm, point_weights) <= _ON_THE_POINTS_MM2:
        return girdle
    return jax.tree.map(np.asarray, jitted_geometric_fit(girdle, jnp.asarray(points_mm)))


def geometric_fit(girdle: Girdle, points_mm: Float[Array, " 3 points"]) -> Girdle:
    """Fit the girdle's ellipsoid to its thorax points, the closest one, min D (thesis 6.2.6, Table 6.6).

    Levenberg-Marquardt from the girdle's own ellipsoid over its adapted parameters. The thesis found it the best start
    of an adaptation. For the shipped sets, whose points lie on the published ellipsoid, it is that ellipsoid.
    """

    def distances(ellipsoid, _):
        moved = girdle.with_adapted(xp.append(ellipsoid, girdle.conoid_length_mm))
        return signed_distance_mm(points_mm, moved.centre_mm[:, None], moved.semi_axes_mm[:, None])

    import optimistix  # 0.2 s: not for every command

    solver = optimistix.LevenbergMarquardt(rtol=1e-10, atol=1e-10)
    start = girdle.adapted_mm[: len(ELLIPSOID)]
    solution = optimistix.least_squares(distances, solver, start, throw=False, max_steps=200)
    found = xp.where(solution.result == optimistix.RESULTS.successful, solution.value, start)
    return girdle.with_adapted(xp.append(found, girdle.conoid_length_mm))


jitted_geometric_fit = jax.jit(geometric_fit)
