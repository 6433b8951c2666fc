"""Robust posture fits: from several starting points, each with a status.

A problem is one posture of one subject with one girdle; the last axis of every array is the problem.
"""

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import as_type, put_problems, refit, take_problems
from adapt.solvers import newton, projection, status
from adapt.solvers.newton.postures import OFFSETS_DEG
from adapt.solvers.objective import mean_square_deg2
from adapt.solvers.solution import PostureSolution, put_lower
from adapt.solvers.unmeasured import angle_weights, at_rest
from models.effects import AnyGirdle
from models.girdle import Girdle
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

OPEN_CHAIN_MM = 1e-6
"""Constraint violation above which a chain is unreachable, after attempts to close it from every starting point."""


_FAR_START_DEG2 = 200.0
"""J above which the start of an adaptation is searched from more places. The start need not be the lowest local
minimum: at a threshold of 15 all of 3000 adaptations end alike and take a fifth longer; without more places all but one
end alike and take 6 to 11 % longer."""


_PLACES_DEG = np.stack([np.zeros(6), *OFFSETS_DEG])
"""Places from which a chain is closed before a fit, as offsets to the measured angles."""


def fit_batch(
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None = None,
) -> PostureSolution:
    """Find the closed posture of each problem nearest to its measured angles (rad), with multipliers and status.

    Every problem starts from ``start``, or else from its measured angles and from a closed posture next to them, and
    the lower J wins; where that J is large, also from closed postures near other places. A problem that does not
    converge starts again from the closed postures near nine places. A problem whose chain closes from none of them is
    ``unreachable`` and keeps the angles where the chain is least open. A problem with fewer than three measured angles,
    or with a girdle whose numbers are not all finite (its adaptation failed), is ``invalid``.

    Angles in float32 are fitted in float32, and in float64 where float32 does not converge.
    """
    finite = np.isfinite(angles) | ~measured
    determined = (measured.sum(axis=0) >= FEWEST_ANGLES) & finite.all(axis=0) & _finite(girdle)
    target = at_rest(angles, measured & determined)
    found = _solved(girdle, target, measured, start)
    girdle, target = as_type((girdle, target), float)
    found.code[~np.isfinite(found.j_deg2)] = status.UNCONVERGED
    found.code[~determined] = status.UNUSABLE
    found.residual_mm[:, found.code == status.UNCONVERGED] = np.inf
    for offset in _PLACES_DEG:
        if not (found.code == status.UNCONVERGED).any():
            break
        place = target + offset[:, None] / DEG
        refit(found, found.code == status.UNCONVERGED, _from_closed, girdle, target, measured, place, put=_put_closer)
    open_mm = np.abs(found.residual_mm).max(axis=0)
    found.code[(found.code == status.UNCONVERGED) & (open_mm > OPEN_CHAIN_MM)] = status.OPEN
    return found


def nearby_angles(
    girdle: Girdle, angles: Float[np.ndarray, "6 problems"], measured: Bool[np.ndarray, "6 problems"]
) -> Float[np.ndarray, "6 problems"]:
    """Fit postures by Newton alone, as starting points: where it does not converge, return its last angles (rad), or
    the measured ones if those are not finite."""
    found = newton.fit_postures(girdle, angles, measured, far_deg2=_FAR_START_DEG2).angles
    return np.where(np.isfinite(found).all(axis=0), found, angles)


def _solved(girdle: AnyGirdle, target, measured, start) -> PostureSolution:
    """Fit by Newton where the chain has no effects, by projections where it has effects or Newton has not converged;
    after float32 first by Newton in float64."""
    if not isinstance(girdle, Girdle):
        return projection.fit_postures(girdle, target, measured, start)
    found = as_type(newton.fit_postures(girdle, target, measured, start), float)
    further = projection.fit_postures
    if target.dtype == np.float32:
        (girdle, target), further = as_type((girdle, target), float), _solved
    left = ~found.converged & measured.any(axis=0)  # a problem without measured angles is padding
    return refit(found, left, further, girdle, target, measured, start, put=put_lower)


def _from_closed(girdle: AnyGirdle, target, measured, place) -> PostureSolution:
    """Fit from the closed postures near the places; where that does not converge, return the angles of the closed
    postures."""
    closed, residual = projection.close_chains(girdle, place)
    found = _solved(girdle, target, measured, closed)
    failed = ~found.converged
    for whole, there in ((found.angles, closed), (found.residual_mm, residual)):
        whole[:, failed] = there[:, failed]
    found.j_deg2[:] = mean_square_deg2(found.angles, target, angle_weights(measured))
    found.multipliers[:, failed], found.stationarity[failed] = 0.0, np.nan
    return found


def _put_closer(found: PostureSolution, problems: Int[np.ndarray, " again"], other: PostureSolution) -> None:
    """Replace fits by those of ``other`` that converged or are less open."""
    before, after = (np.abs(one.residual_mm).max(axis=0) for one in (take_problems(found, problems), other))
    closer = other.converged | (after < before)
    put_problems(found, problems[closer], take_problems(other, closer))


def _finite(girdle: AnyGirdle) -> Bool[np.ndarray, " problems"]:
    """Check whether every number of the girdle of a problem is finite."""
    return np.isfinite(sum(np.sum(x, axis=tuple(range(np.ndim(x) - 1))) for x in jax.tree.leaves(girdle)))
