"""Profile likelihood intervals: how far a parameter may go before E, everything else adapted anew, says no.

The profile E_k(v) is the least E with parameter k held at v. By the curvature it rises by (v - theta_k)^2 /
(2 (H^-1)_kk); an interval of +-1.96 SD is where it has risen by  1/2 (1.96 SD_k)^2 / (H^-1)_kk.  Where E is no
parabola the true profile reaches that rise elsewhere, and a bound may come first: then the interval ends there, open.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from adapt import status
from adapt.adaptation import Adapted, Lanes, adapted_from, lanes_at
from adapt.objective import WEIGHT
from adapt.trust.uncertainty import NORMAL_95, Uncertainty, reduced_inverse

_ROUNDS = 6
"""Evaluations of each end after that at the bound: the root of a nearly linear function, to a per cent or so."""


@dataclass(frozen=True)
class Profile:
    """Ends of the 95 % intervals of L lanes, mm, lower then upper; NaN for a parameter at its bound."""

    ends_mm: Float[np.ndarray, "2 6 lanes"]
    open: Bool[np.ndarray, "2 6 lanes"]
    """The bound came first."""


def profile_intervals(data: Lanes, adapted: Adapted, found: Uncertainty, weight: float = WEIGHT) -> Profile:
    """The intervals of every lane and free parameter, all at once."""
    lanes = adapted.theta_mm.shape[-1]
    H = found.curvature.of_points + found.curvature.of_motion
    width = np.einsum("kkl->kl", reduced_inverse(H, found.free))
    side, parameter, lane = (x.ravel() for x in np.meshgrid([0, 1], range(6), range(lanes), indexing="ij"))
    use = found.free[parameter, lane] & np.isfinite(found.sd_mm[parameter, lane]) & (width[parameter, lane] > 0.0)
    side, parameter, lane = side[use], parameter[use], lane[use]
    wanted = NORMAL_95 * found.sd_mm[parameter, lane]
    best, bound = adapted.theta_mm[parameter, lane], np.asarray(data.bounds_mm)[side, parameter, lane]
    repeated = lanes_at(data, lane)

    def short_of(value_mm):
        """By how many mm of the parabola the rise of the profile falls short of the one wanted."""
        E = _least_e(repeated, parameter, value_mm, adapted.theta_mm[:, lane], weight)
        return wanted - np.sqrt(2.0 * width[parameter, lane] * np.maximum(E - adapted.E[lane], 0.0))

    inside, outside = best.copy(), bound.copy()
    short_inside, short_outside = wanted.copy(), short_of(bound)
    is_open = short_outside > 0.0
    for _ in range(_ROUNDS):
        share = short_inside / np.maximum(short_inside - short_outside, 1e-300)
        middle = np.where(is_open, bound, inside + np.where(is_open, 0.0, share) * (outside - inside))
        short = short_of(middle)
        within = short > 0.0
        # The Illinois rule: the end that stays counts half, so that both ends close in.
        short_outside = np.where(within, 0.5 * short_outside, short)
        short_inside = np.where(within, short, 0.5 * short_inside)
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    ends = np.full((2, 6, lanes), np.nan)
    ends[side, parameter, lane] = np.where(is_open, bound, middle)
    opened = np.zeros((2, 6, lanes), bool)
    opened[side, parameter, lane] = is_open
    return Profile(ends, opened)


def _least_e(data: Lanes, parameter, value_mm, theta_mm, weight: float) -> Float[np.ndarray, " lanes"]:
    """E with one parameter of each lane held at a value; NaN where that did not converge."""
    lane = np.arange(len(value_mm))
    bounds, start = np.array(data.bounds_mm), theta_mm.copy()
    bounds[:, parameter, lane] = value_mm
    start[parameter, lane] = value_mm
    held = lanes_at(data, lane, bounds_mm=bounds)
    least = adapted_from(held, start, weight)
    return np.where(least.status == status.OK, least.E, np.nan)
