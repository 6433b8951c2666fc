"""An ellipsoid for each posture (thesis, chapter 7): the least change that lets the chain take a measured posture.

The parameters theta + delta close the chain at a measured posture s, without any gap, where  g(s, theta + delta) = 0
(A1-A3). Three equations leave three of the six parameters free. The chosen change has the least |delta / SD|^2, with
the SDs between people. Newton steps on its optimality conditions, with T = dg/dtheta and V = T SD^2 T', are

    delta <- SD^2 T' V^-1 (T delta - g(s, theta + delta)),

with a fixed point where delta, in units of SD, is normal to the surface g = 0. Errors e of the angles alone, of SD
sigma, change closed postures by delta = -SD^2 T' V^-1 G e, with G = dg/ds: the mean square of delta / SD is sigma^2
times the sum of squares of the rows of SD T' V^-1 G, and the changes are as independent between postures as the errors.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from adapt.solvers import status
from models.adapted_parameters import ADAPTED_PARAMETERS, ELLIPSOID
from models.derivatives import chain, closest_point_multipliers
from models.girdle import Girdle
from motions.rotations import DEG

_MOST_STEPS = 300
"""Limit of steps. The error after a step, over the error before, is about the curvature of the distances times the
change: some tenth, for changes of a few SDs."""

_SHRINKS = 0.95
"""Largest ratio of the lengths of two successive steps. A larger ratio shows that the steps overshoot, and halves the
fraction that is taken from then on."""

_SHORTEST = 1.0 / 32.0
"""Smallest fraction of a step that is taken."""

_SETTLED_MM = 1e-9
"""Tolerance of the change of delta and of |g| at convergence."""

_LEAST_AXIS_MM = 1.0
"""Lower limit of semi-axes: where a step would lead below it, no nearby ellipsoid closes the chain in the posture."""


_FEWEST_ROWS = 5

_THIRD_DIFFERENCES = 20.0
"""Variance of third differences of independent numbers with variance 1: 1 + 9 + 9 + 1."""

_LENGTHS = np.array([one.is_length for one in ADAPTED_PARAMETERS])


@dataclass(frozen=True)
class EllipsoidChange:
    """Least change of the adapted parameters per posture, in the order of ``ADAPTED``."""

    change_mm: Float[np.ndarray, "adapted postures"]
    """Change delta; NaN where the status is not ``ok``."""
    in_sd: Float[np.ndarray, "adapted postures"]
    """Change delta / SD."""
    status: Shaped[np.ndarray, " postures"]

    @property
    def size_sd(self) -> Float[np.ndarray, " postures"]:
        """Size |delta / SD| of the change."""
        return np.sqrt((self.in_sd**2).sum(axis=0))


def least_change(
    girdle: Girdle, angles: Float[np.ndarray, "6 postures"], sd_mm: Float[np.ndarray, " adapted"]
) -> EllipsoidChange:
    """Find the least change of the adapted parameters that closes the chain in each posture (rad).

    ``girdle`` has one element per posture. The status is ``ok`` where the steps converged and the chain is closed, else
    ``not_converged``.
    """
    theta, scale = np.asarray(girdle.adapted_mm), sd_mm[:, None]
    lowest = np.where(_LENGTHS[:, None], _LEAST_AXIS_MM - theta, -np.inf)
    change, part, before = np.zeros_like(theta), np.ones(theta.shape[1]), np.full(theta.shape[1], np.inf)
    for _ in range(_MOST_STEPS):
        g, _, T = _linearised(girdle, angles, theta + change)
        TS = T * scale[None]
        wanted = np.einsum("ijp,jp->ip", T, change) - g
        step = scale * np.einsum("ijp,ip->jp", TS, _solve(np.einsum("ikp,jkp->ijp", TS, TS), wanted)) - change
        length = np.abs(step).max(axis=0)
        part = np.where(length > _SHRINKS * before, np.maximum(0.5 * part, _SHORTEST), part)
        change, before = np.maximum(change + part * step, lowest), length
        if (length <= _SETTLED_MM).all():
            break
    g, *_ = _linearised(girdle, angles, theta + change)
    good = (before <= _SETTLED_MM) & (np.abs(g) <= _SETTLED_MM).all(axis=0)
    change = np.where(good, change, np.nan)
    return EllipsoidChange(change, change / scale, np.where(good, status.OK, status.NOT_CONVERGED))


def foreseen_square_sd(
    girdle: Girdle, closed: Float[np.ndarray, "6 postures"], noise_deg: float, sd_mm: Float[np.ndarray, " adapted"]
) -> Float[np.ndarray, "adapted postures"]:
    """Compute the expected (delta / SD)^2 of closed postures (rad) measured with errors of SD ``noise_deg``."""
    _, G, T = _linearised(girdle, closed, np.asarray(girdle.adapted_mm))
    TS = T * sd_mm[None, :, None]
    by_error = np.einsum("ikp,iap->kap", TS, _solve(np.einsum("ikp,jkp->ijp", TS, TS), G))
    return (noise_deg / DEG) ** 2 * (by_error**2).sum(axis=1)


def _linearised(girdle: Girdle, angles, theta) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute A1-A3 at the angles and parameters of each posture, with Jacobians in angles and in parameters."""
    q, by_parameter, zero = list(angles), list(theta), np.zeros(angles.shape[1])
    at = chain(girdle, q, by_parameter, [zero] * 3, closest_point_multipliers(girdle, q, by_parameter))
    T = np.zeros((3, len(theta), len(zero)))
    T[:2, : len(ELLIPSOID)], T[2, len(ELLIPSOID) :] = np.array(at.T), -1.0
    return np.array(at.g), np.array([[np.broadcast_to(x, zero.shape) for x in row] for row in at.G]), T


def _solve(V: Float[np.ndarray, "3 3 postures"], b: Float[np.ndarray, "3 *columns postures"]) -> np.ndarray:
    columns = np.moveaxis(b, -1, 0)
    solved = np.linalg.solve(np.moveaxis(V, -1, 0), columns if b.ndim == 3 else columns[..., None])
    return np.moveaxis(solved if b.ndim == 3 else solved[..., 0], 0, -1)


def smooth_share(numbers: Float[np.ndarray, "numbers rows"], sequences: Iterable[Int[np.ndarray, " chosen"]]) -> float:
    """Compute the smooth share of the variance along sequences of rows: 1 - rough^2 / variance.

    The rough part is estimated from third differences. For independent numbers it is the whole variance, so that the
    smooth share is 0 except by chance; for a parabola it is 0, so that the smooth share is 1. Rows with NaN and
    sequences with fewer than five rows are left out; the share is NaN where no sequence is left.
    """
    rough, variance = 0.0, 0.0
    for rows in sequences:
        part = numbers[:, rows[np.isfinite(numbers[:, rows]).all(axis=0)]]
        if part.shape[1] >= _FEWEST_ROWS:
            rough += len(rows) * float((np.diff(part, 3, axis=1) ** 2).mean()) / _THIRD_DIFFERENCES
            variance += len(rows) * float(part.var(axis=1, ddof=1).mean())
    return 1.0 - rough / variance if variance > 0.0 else float("nan")
