"""Profile likelihood intervals: ranges of a parameter in which the least E over all others stays below a limit.

The profile E_k(v) is the least E with parameter k held at v. For a parabola with the curvature at the optimum, the
profile rises by (v - theta_k)^2 / (2 (H^-1)_kk), so that at +-1.96 SD it has risen by
1/2 (1.96 SD_k)^2 / (H^-1)_kk.  Where E is no parabola, the true profile reaches this rise elsewhere. If a bound comes
first, the interval ends at the bound and is open.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from adapt.evaluation.covariance import NORMAL_95, Uncertainty, reduced_inverse
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapted_from
from adapt.solvers.problems import Problems, select_problems

_STRIDES = (1.0, 2.0, 4.0)
"""First places of the search for an end, in half widths of the parabola's interval; the last place is the bound."""

_ROUNDS = 4
"""Evaluations per end between two such places, which find the root of a nearly linear function to some per cent."""


@dataclass(frozen=True)
class Profile:
    """Ends of the 95 % intervals, mm, lower then upper."""

    ends_mm: Float[np.ndarray, "2 adapted problems"]
    open: Bool[np.ndarray, "2 adapted problems"]
    """True where the interval ends at the bound."""


def profile_intervals(
    data: Problems,
    adapted: Adapted,
    found: Uncertainty,
    chosen: Bool[np.ndarray, "adapted problems"],
) -> Profile:
    """Find the intervals of the ``chosen`` free parameters, in all problems at once; NaN for other parameters."""
    H = found.curvature.of_points + found.curvature.of_motion
    inverse = reduced_inverse(H, found.free)
    width = np.einsum("kkl->kl", inverse)
    sought = np.broadcast_to(chosen & found.free & np.isfinite(found.sd_mm) & (width > 0.0), (2, *width.shape))
    ends, opened = np.full(sought.shape, np.nan), np.zeros(sought.shape, bool)
    if not sought.any():
        return Profile(ends, opened)
    side, parameter, problem = np.nonzero(sought)
    wanted = NORMAL_95 * found.sd_mm[parameter, problem]
    best, bound = adapted.theta_mm[parameter, problem], np.asarray(data.bounds_mm)[side, parameter, problem]
    repeated, start = select_problems(data, problem), adapted.theta_mm[:, problem]
    follow = inverse[:, parameter, problem] / width[parameter, problem]

    def short_of(value_mm):
        """Compute by how many mm, measured on the parabola, the rise of the profile is short of the required rise;
        -``wanted``, far beyond, where no E was found.

        Each call evaluates all ends, so that the shape stays the same and nothing is compiled twice.
        """
        E = _least_e(repeated, parameter, value_mm, start + follow * (value_mm - best), adapted.weight[problem])
        rise = np.sqrt(2.0 * width[parameter, problem] * np.maximum(E - adapted.E[problem], 0.0))
        return np.where(np.isfinite(E), wanted - rise, -wanted)

    ends[sought], opened[sought] = _ends(short_of, best, bound, wanted)
    return Profile(ends, opened)


def _ends(short_of: Callable, best, bound, wanted) -> tuple[np.ndarray, np.ndarray]:
    """Find where the profile has the required rise, or the bound if that comes first; the mask is True at bounds."""
    inside, outside = best, best
    short_inside, short_outside = wanted, wanted
    for stride in (*_STRIDES, np.inf):
        further = (short_outside > 0.0) & (outside != bound)
        if not further.any():
            break
        inside, short_inside = (np.where(further, *x) for x in ((outside, inside), (short_outside, short_inside)))
        beyond = np.abs(bound - best) <= stride * wanted
        there = np.where(
            beyond, bound, best + np.sign(bound - best) * np.minimum(stride * wanted, np.abs(bound - best))
        )
        outside = np.where(further, there, outside)
        short_outside = short_of(outside)
    is_open = short_outside > 0.0
    for _ in range(_ROUNDS):
        middle = _crossing(inside, outside, short_inside, short_outside)
        short = short_of(np.where(is_open, bound, middle))
        within = short > 0.0
        # Illinois rule: the value at the end that stays is halved, so that both ends close in.
        short_outside = np.where(within, 0.5 * short_outside, short)
        short_inside = np.where(within, short, 0.5 * short_inside)
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return np.where(is_open, bound, _crossing(inside, outside, short_inside, short_outside)), is_open


def _crossing(inside, outside, short_inside, short_outside):
    """Find, by linear interpolation between a place short of the rise and one beyond, where the rise is reached."""
    apart = short_inside - short_outside
    return inside + np.where(apart > 0.0, short_inside / np.where(apart > 0.0, apart, 1.0), 0.0) * (outside - inside)


def _least_e(data: Problems, parameter, value_mm, start_mm, weight) -> Float[np.ndarray, " problems"]:
    """Minimise E with one parameter of each problem held at a value, starting from the parabola's other parameters; NaN
    where the search did not converge."""
    problem = np.arange(len(value_mm))
    bounds = np.array(data.bounds_mm)
    bounds[:, parameter, problem] = value_mm
    held = select_problems(data, problem, bounds_mm=bounds)
    least = adapted_from(held, np.clip(start_mm, *bounds), weight)
    return np.where(least.status == status.OK, least.E, np.nan)
