"""Posture fits that can be relied on: from several starts, each with a status.

A problem is one posture of one subject with one girdle; the last axis of every array is the problem.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Shaped

from adapt.engine.batching import QUICK_TO_COMPILE, as_type, compiled, in_chunks, take_problems
from adapt.solvers import status
from adapt.solvers.batched.posture import SweptPostures
from adapt.solvers.batched.posture_kernels import OFFSETS_DEG, fitted_from, fitted_from_places, put_lower
from adapt.solvers.extended.postures import fit_by_newton, fit_extended
from adapt.solvers.reference.constraints import ByHand, Constraints, Differentiated
from adapt.solvers.reference.posture import (
    Postures,
    close_chain,
    lower_of_two_starts,
    mean_square_deg2,
    objective_weights,
    solve_postures,
)
from models.effects import AnyGirdle
from models.girdle import Girdle
from motions.arrays import Array
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

OPEN_CHAIN_MM = 1e-6
"""A chain still open by more than this after closing it from every start cannot be closed here."""


_FAR_START_DEG2 = 200.0
"""J from which a start of an adaptation is looked for from more places. It need not be the lowest: of 3000 adaptations
all end alike from 15 on, which takes a fifth longer, and all but one without places, which takes 6 to 11 % longer."""


@dataclass(frozen=True)
class Fitted:
    """Posture fits of a batch of problems."""

    angles: Float[np.ndarray, "6 problems"]
    """rad."""
    multipliers: Float[np.ndarray, "3 problems"]
    """Of A1-A3, deg^2 a mm."""
    residual_mm: Float[np.ndarray, "3 problems"]
    stationarity: Float[np.ndarray, " problems"]
    """deg^2 a degree."""
    j_deg2: Float[np.ndarray, " problems"]
    status: Shaped[np.ndarray, " problems"]
    jump: Bool[np.ndarray, " problems"]
    """True where the posture is not on the branch of the posture before it in its motion."""

    def take(self, problems) -> "Fitted":
        """Take some problems, by their numbers, where they are or as a slice."""
        return Fitted(**{name: value[..., problems] for name, value in vars(self).items()})

    def put(self, problems, values: "Fitted") -> None:
        """Replace some problems by others, in place."""
        for name, value in vars(values).items():
            getattr(self, name)[..., problems] = value

    def copy(self) -> "Fitted":
        """Copy every array."""
        return Fitted(**{name: value.copy() for name, value in vars(self).items()})


def fit_batch(
    girdle: AnyGirdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None = None,
) -> Fitted:
    """Find the closed posture of each problem closest to its measured angles (rad), with multipliers and status.

    Every problem starts from ``start``, else from its measured angles and from where its chain closes nearest to them,
    and the lower J wins; where that is far, also from where it closes next to places around.
    One that does not converge starts again where it closes from nine other places. A problem whose chain closes from
    nowhere is ``unreachable`` and keeps the angles where it is least open; one with fewer than three angles, or with a
    girdle that has no numbers (its adaptation failed), is ``invalid``.

    Angles in float32 are fitted in float32, and in float64 where that does not converge.
    """
    target = at_rest_where_unknown(angles, measured)
    weights = objective_weights(measured)
    determined = (measured.sum(axis=0) >= FEWEST_ANGLES) & np.isfinite(target).all(axis=0) & _finite(girdle)
    target = at_rest_where_unknown(target, determined)
    fitted = as_fitted(_solved(girdle, target, weights, start))
    girdle, target = as_type((girdle, target), float)
    fitted.status[~determined] = status.INVALID
    least_open = np.full(len(determined), np.inf)
    place, together = 0, 1  # most end well at the first place
    while place < len(_PLACES_DEG):
        again = np.flatnonzero(fitted.status == status.NOT_CONVERGED)
        if not len(again):
            return fitted
        places = _PLACES_DEG[place : place + together] / DEG
        _start_again(fitted, least_open, again, take_problems((girdle, target, weights), again), places)
        place += len(places)
        together = max(1, max(_SMALL_CHUNK, _at_once(girdle)) // len(again))
    fitted.status[(fitted.status == status.NOT_CONVERGED) & (least_open > OPEN_CHAIN_MM)] = status.UNREACHABLE
    return fitted


def at_rest_where_unknown(
    angles: Float[np.ndarray, " 6 *batch"], known: Bool[np.ndarray, " *any"]
) -> Float[np.ndarray, " 6 *batch"]:
    """Replace angles (rad) that are not known by those of the arm at rest."""
    rest = (REST_DEG / DEG).astype(angles.dtype).reshape(6, *(1,) * (angles.ndim - 1))
    return np.where(known, angles, rest)


def nearby_angles(
    girdle: Girdle, angles: Float[np.ndarray, "6 problems"], measured: Bool[np.ndarray, "6 problems"]
) -> Float[np.ndarray, "6 problems"]:
    """Fit postures by the fast path alone, for a start: where that does not converge, the angles (rad) that it ends
    with, or the measured ones if they are not finite."""
    target = at_rest_where_unknown(angles, measured)
    found = fitted_from_places((girdle, target, objective_weights(measured)), _FAR_START_DEG2).angles
    return np.where(np.isfinite(found).all(axis=0), found, target)


def _start_again(fitted: Fitted, least_open, again, problem, places) -> None:
    """Fit the problems ``again`` from where they close next to each of the places, and put in the first that converges.

    Else what was least open so far, ``least_open``. The places are tried side by side.
    """
    count = len(again)
    girdle, target, weights = take_problems(problem, np.tile(np.arange(count), len(places)))
    closed, residual = _in_small_chunks(_close, girdle, target + np.repeat(places.T, count, axis=1))
    tried = as_fitted(reference_fit(girdle, target, weights, closed))
    unsolved, every_open_mm = _unsolved(closed, residual, target, weights), np.abs(residual).max(axis=0)
    for first in range(0, len(places) * count, count):
        here = first + np.flatnonzero(fitted.status[again] == status.NOT_CONVERGED)
        converged = tried.status[here] == status.OK
        fitted.put(again[here[converged] - first], tried.take(here[converged]))
        here = here[~converged]
        here = here[every_open_mm[here] < least_open[again[here - first]]]
        least_open[again[here - first]] = every_open_mm[here]
        fitted.put(again[here - first], unsolved.take(here))


def _finite(girdle: AnyGirdle) -> Bool[np.ndarray, " problems"]:
    """Whether every number of the girdle of a problem is one."""
    return np.isfinite(sum(np.sum(x, axis=tuple(range(np.ndim(x) - 1))) for x in jax.tree.leaves(girdle)))


_WORDS = np.array([status.NOT_CONVERGED, status.OK], "U16")


def as_fitted(solved: SweptPostures) -> Fitted:
    """Convert swept postures to fits with a status: ``ok`` if converged with a finite J, else ``not_converged``."""
    words = _WORDS[(solved.converged & np.isfinite(solved.j_deg2)).astype(int)]
    angles, multipliers, residual_mm, stationarity, j_deg2 = (np.require(x, requirements="W") for x in solved[:5])
    return Fitted(angles, multipliers, residual_mm, stationarity, j_deg2, words, np.zeros(len(words), bool))


def _unsolved(closed, residual, target, weights) -> Fitted:
    """Angles where the chain closes, or is least open, as a fit that did not converge."""
    j = np.asarray(mean_square_deg2(closed, target, weights))
    words = np.full(len(j), status.NOT_CONVERGED, "U16")
    return Fitted(closed, np.zeros_like(residual), residual, np.full_like(j, np.nan), j, words, np.zeros(len(j), bool))


def _solved(girdle: AnyGirdle, target, weights, start) -> SweptPostures:
    """Take the fast path, then projections where needed; after float32 first the fast path in float64."""
    if not isinstance(girdle, Girdle):
        return _projected(girdle, target, weights, start)
    problem = girdle, target, weights
    quick = as_type(fitted_from_places(problem) if start is None else fitted_from(problem, start), float)
    left = np.flatnonzero(~quick.converged & (weights > 0.0).any(axis=0))  # without weights it is padding
    if len(left):
        girdle, target, weights = take_problems(problem, left)
        start = None if start is None else start[:, left]
        if target.dtype == np.float32:
            girdle, target = as_type((girdle, target), float)
            further = _solved(girdle, target, weights, start)
        else:
            further = _projected(girdle, target, weights, start)
        put_lower(quick, left, further)
    return quick


def _projected(girdle: AnyGirdle, target, weights, start) -> SweptPostures:
    """Project onto the constraints, from places around too; where needed take Newton steps or the reference solver."""
    quick = fit_extended(girdle, target, weights, start)
    for number, offset in enumerate(OFFSETS_DEG if start is None else ()):
        again = np.arange(target.shape[1]) if number < _MORE_STARTS else np.flatnonzero(~quick.converged)
        if len(again):
            chain, s, W = take_problems((girdle, target, weights), again)
            put_lower(quick, again, fit_extended(chain, s, W, s + offset[:, None] / DEG))

    def finish(solve: Callable[..., SweptPostures]) -> None:
        left = np.flatnonzero(~quick.converged)
        if len(left):
            put_lower(quick, left, solve(left, *take_problems((girdle, target, weights), left)))

    finish(lambda left, chain, s, W: fit_by_newton(chain, s, W, quick.angles[:, left]))
    finish(lambda left, chain, s, W: reference_fit(chain, s, W, None if start is None else start[:, left]))
    return quick


_MORE_STARTS = 2
"""Places around the measured angles that a fit with effects starts from too: the nearest valley may be a higher one."""


def reference_fit(girdle: AnyGirdle, target, weights, start) -> SweptPostures:
    """Find the optimum reached from one start; without one the lower of two (``lower_of_two_starts``)."""
    if start is not None:
        return _as_swept(_in_small_chunks(_solve, girdle, target, weights, start), target, weights)

    def solve(*arrays) -> Postures:
        """One start after the other: problems side by side share Newton steps to the closest points, and rounding."""
        of_starts = (_in_small_chunks(_solve, girdle, *take_problems(arrays, start)) for start in range(2))
        return jax.tree.map(lambda *x: np.stack(x, axis=-1), *of_starts)

    def close(angles):
        return _in_small_chunks(_close, girdle, angles)[0]

    return _as_swept(lower_of_two_starts(solve, close, target, weights), target, weights)


def _as_swept(solved: Postures, target, weights) -> SweptPostures:
    return SweptPostures(
        solved.angles,
        solved.multipliers,
        solved.residual_mm,
        solved.stationarity,
        np.asarray(mean_square_deg2(solved.angles, target, weights)),
        solved.iterations,
        np.asarray(solved.converged),
    )


def _in_small_chunks(function, girdle: AnyGirdle, *arrays) -> Any:
    """Run the reference solver."""
    return in_chunks(function, _SMALL_CHUNK, girdle, *arrays, at_once=_at_once(girdle))


def _at_once(girdle: AnyGirdle) -> int:
    """Postures that numpy does. With effects there are no derivatives by hand, which it needs."""
    return _SMALL_AT_ONCE if isinstance(girdle, Girdle) else 0


_SMALL_CHUNK = 64
"""Postures in a chunk of the reference solver, which is long to compile."""

_SMALL_AT_ONCE = 512
"""Postures up to which numpy runs the reference solver: 2 ms each, a tenth of that compiled, which takes 5 s once."""

_PLACES_DEG = np.stack([np.zeros(6), *OFFSETS_DEG])
"""Where a chain is closed from before a fit, as offsets to the measured angles."""


def _constraints(girdle: AnyGirdle) -> Constraints:
    return ByHand(girdle) if isinstance(girdle, Girdle) else Differentiated(girdle.residuals_mm)


_compiled = partial(compiled, on_cpu=QUICK_TO_COMPILE)
"""With effects it compiles for each set of them, and few postures come here."""


@_compiled
def _solve(girdle: AnyGirdle, target: Array, weights: Array, start: Array) -> Postures:
    return solve_postures(_constraints(girdle), target, weights, start)


@_compiled
def _close(girdle: AnyGirdle, start: Array) -> tuple[Array, Array]:
    constraints = _constraints(girdle)
    closed = close_chain(constraints, start)
    return closed, constraints.residual(closed)
