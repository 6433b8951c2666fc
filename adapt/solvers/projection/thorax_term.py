"""D of many problems at once, with its gradient and the Gauss-Newton matrix for its curvature, on the engine."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.engine.axes import along, stacked
from adapt.engine.kernel import Kernel
from adapt.solvers.newton.postures import GIRDLE
from adapt.solvers.newton.subject import point_distance, point_multiplier
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle

_N = len(ADAPTED)

_CHUNK = 4096
"""Number of problems per chunk of an XLA program."""


ThoraxTerms = tuple[
    Float[np.ndarray, " problems"], Float[np.ndarray, "adapted problems"], Float[np.ndarray, "adapted adapted problems"]
]
"""D of every problem, mm^2, and its terms in the gradient and the matrix of the quadratic model in theta."""


class Thorax(NamedTuple):
    """Points on the thorax of every problem, or other points with nominal distances (levels) to the ellipsoid, mm."""

    girdle: Girdle
    points_mm: Float[np.ndarray, "3 points problems"]
    point_weights: Float[np.ndarray, "points problems"]
    levels_mm: Float[np.ndarray, "points problems"]

    def __call__(self, theta_mm: Float[np.ndarray, "adapted problems"]) -> ThoraxTerms:
        """Compute D of every problem at theta, with its slopes."""
        D, gradient, matrix = thorax_kernel(*self, theta_mm)
        return D, gradient, matrix.reshape(_N, _N, -1)


def _terms(girdle: Girdle, points_mm, point_weights, levels_mm, theta):
    """Compute sum u (d - level)^2, its gradient, and 2 sum u d' d'^T, of one problem."""

    def of_point(point, weight, level):
        off, slope, _ = point_distance(girdle, theta, point, level, point_multiplier(girdle, theta, point))
        slope = [*slope, 0.0 * off]
        weighted = [2.0 * weight * x for x in slope]
        return (weight * off**2, [off * x for x in weighted], [x * y for x in weighted for y in slope]), (), ()

    (D, gradient, matrix), *_ = along(point_weights).reduced(of_point, points_mm, point_weights, levels_mm)
    return D, stacked(gradient), stacked(matrix)


thorax_kernel = Kernel(
    "thorax",
    _terms,
    (GIRDLE, "3 points", "points", "points", f"{_N}"),
    ("", f"{_N}", f"{_N * _N}"),
    _CHUNK,
)
