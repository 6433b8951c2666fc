"""Adaptation of the girdle to subjects: min E = D + w mean(J_p) over ellipsoid and conoid (thesis Eq. 6.5)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt.engine.batching import as_type, refit, take_problems, with_problems
from adapt.solvers import newton, projection, status
from adapt.solvers.newton.subject import SubjectProblem
from adapt.solvers.objective import (
    DEFAULT_OBJECTIVE,
    OBJECTIVES,
    WEIGHT,
    AtOptimum,
    ObjectiveVariant,
    mean_square_deg2,
)
from adapt.solvers.posture_fits import fit_batch, nearby_angles
from adapt.solvers.problems import Problems, landmark_points, subject_problem
from adapt.solvers.projection.subjects import fit_sizes
from adapt.solvers.solution import SubjectSolution
from adapt.solvers.unmeasured import angle_weights
from models.adapted_parameters import STARTS_MM
from models.effects import ActiveEffects
from models.ellipsoid import signed_distance_mm
from motions.arrays import Array, ByType
from motions.table import FEWEST_ANGLES

_ROUNDS = 4
"""Largest number of rounds: a problem that did not converge, or has a posture in the higher of two local minima,
continues from fresh posture fits."""

_LOWER_DEG2 = ByType(1e-6, 1e-3)
"""Decrease of J below which a fresh posture fit is the same local minimum."""

_SAME_E = ByType(1e-9, 1e-5)
"""Relative difference of E below which two starts have led to one optimum. The optimum of the first start is kept, so
that numbers on which E does not depend stay the same."""

_SAME_MINIMUM = 1e-6
"""Relative decrease of E, when theta is adapted again with the fitted sizes, below which theta is still in the local
minimum in which the sizes were fitted."""

_SAME_SIZE = 0.01
"""Difference in SDs below which sizes fitted from a lower E are the same. Their postures are less exact where angles
were not measured."""

_REWEIGHTED = 1000
"""Largest number of fixed-point iterations of the weights of a variant with roots or lengths: 18 measured problems took
10-500."""

_SETTLED = 1e-4
"""Tolerance of the change of the weights, relative to the weight of J and to the sum over all points."""

_LEAST_WEIGHT = 1e-6
"""Smallest weight of J. The weight tends to 0 at the geometric fit, where the root of D is not differentiable; below
this value no result changes any more."""

_AT_BOUND_MM = 1e-9

_EXACT_DEG2 = 1e-9
"""Largest mean J of postures that the chain follows exactly, up to rounding. Where three angles are out of reach of the
chain, J is larger and the angles do inform the parameters."""


class Adapted(NamedTuple):
    """Adaptations of a batch of problems (see ``adapt.solvers.problems``), numpy arrays."""

    theta_mm: Float[np.ndarray, "adapted problems"]
    """Adapted parameters in the order of ``ADAPTED_PARAMETERS``, mm."""
    at_bound: Bool[np.ndarray, "adapted problems"]
    angles: Float[np.ndarray, "6 postures problems"]
    """Postures of the optimum, rad."""
    multipliers: Float[np.ndarray, "3 postures problems"]
    """Multipliers of A1-A3 in J of each posture, deg^2 per mm; not finite where E does not determine the postures
    (w = 0)."""
    residual_mm: Float[np.ndarray, "3 postures problems"]
    stationarity: Float[np.ndarray, "postures problems"]
    """max |dJ/dq + G' lambda|, deg^2 per degree."""
    D_mm2: Float[np.ndarray, " problems"]
    L_mm2: Float[np.ndarray, " problems"]
    """L of the measured TS and AI; NaN where the variant leaves L out or none was measured."""
    mean_j_deg2: Float[np.ndarray, " problems"]
    E: Float[np.ndarray, " problems"]
    """E in the units of the variant."""
    weight: Float[np.ndarray, " problems"]
    """W of the equivalent sum u d^2 + v L [mm^2] + W mean(J) [deg^2], with the same optimum
    (``ObjectiveVariant.equivalent``)."""
    point_weights: Float[np.ndarray, "points problems"]
    """u of the equivalent sum."""
    landmark_weight: Float[np.ndarray, " problems"]
    """v of the equivalent sum."""
    iterations: Int[np.ndarray, " problems"]
    sizes: Float[np.ndarray, "sizes problems"]
    """Sizes of effects that differ between persons, in SDs from the mean
    (``models.effects.amplitudes.PersonalSize``)."""
    code: Int[np.ndarray, " problems"]
    """Index into ``status.WORDS``."""

    @property
    def status(self) -> Shaped[np.ndarray, " problems"]:
        """Status word of each adaptation."""
        return status.WORDS[self.code]


Progress = Callable[[str], None]


def adapt_batch(
    data: Problems,
    weight: float = WEIGHT,
    objective: str = DEFAULT_OBJECTIVE,
    progress: Progress = lambda _: None,
) -> Adapted:
    """Find the lowest E of each problem from several starts, with exact derivatives and the bounds of the model.

    ``objective`` names the objective variant. A problem is ``ok`` when the optimality conditions of the whole-subject
    problem hold to tolerance. Sizes of effects that differ between persons are fitted too, with the default variant;
    later computations take them as known (``Problems.with_sizes``).
    """
    if data.active_effects.own:
        return _with_own_sizes(data, weight, objective, progress)
    chosen, equivalent = OBJECTIVES[objective], np.full(data.counted.shape[1:], WEIGHT)
    if chosen.form == "squares":
        _, equivalent = chosen.equivalent(
            weight, _at_optimum(data, chosen, data.girdle.adapted_mm, np.full(equivalent.shape, np.nan))
        )
    lowest = _lowest(data, weight, chosen, equivalent, progress)
    return lowest if chosen.form == "squares" else _reweighted(data, weight, chosen, lowest, progress)


def _with_own_sizes(data: Problems, weight: float, objective: str, progress: Progress) -> Adapted:
    """Adapt with the mean sizes from several starts; then fit sizes and parameters from there, and repeat while E is
    lower with postures in another local minimum."""
    count = data.counted.shape[1]
    sizes = np.zeros((sum(map(len, data.active_effects.own)), count))
    adapted = adapt_batch(data.with_sizes(sizes), weight, progress=progress)
    progress("sizes of effects")
    left, settled = np.arange(count), np.zeros(count, bool)
    for _ in range(_ROUNDS):
        part, before = take_problems(data, left), take_problems(adapted, left)
        problem = subject_problem(part, np.full(len(left), weight))
        own, theta_mm, E, ended = fit_sizes(problem, before.theta_mm, before.angles, part.active_effects)
        moved = np.abs(own - sizes[:, left]).max(axis=0) > _SAME_SIZE
        sizes[:, left] = own
        after = adapted_from(part.with_sizes(own), theta_mm, weight)
        adapted = with_problems(adapted, left, after)
        again = moved & (after.E < E * (1.0 - _SAME_MINIMUM))
        settled[left] = ended & ~again
        left = left[again]
        if not len(left):
            break
    if objective != DEFAULT_OBJECTIVE:
        adapted = adapt_batch(data.with_sizes(sizes), weight, objective, progress)
    adapted.code[~settled] = status.UNCONVERGED
    return adapted._replace(sizes=sizes)


def _reweighted(
    data: Problems, weight: float, variant: ObjectiveVariant, adapted: Adapted, progress: Progress
) -> Adapted:
    """Iterate the weights of points and postures of each problem to a fixed point: at the optimum with these weights,
    the equivalent weights of the variant are the same."""
    left = np.arange(len(adapted.code))
    for number in range(_REWEIGHTED):
        progress(f"weights of the variant, round {number + 1}")
        part, before = take_problems(data, left), take_problems(adapted, left)
        u, W = variant.equivalent(weight, _at_optimum(part, variant, before.theta_mm, before.mean_j_deg2))
        W = np.maximum(W, _LEAST_WEIGHT)
        found = _from_theta(part, weight, variant, W, before.theta_mm, u)
        adapted = with_problems(adapted, left, found._replace(point_weights=u))
        moving = np.abs(np.log(W / before.weight)) > _SETTLED
        moving |= np.abs(u - before.point_weights).max(axis=0) > _SETTLED
        left = left[moving]
        if not len(left):
            return adapted
    adapted.code[left] = status.UNCONVERGED
    return adapted


def _at_optimum(data: Problems, variant: ObjectiveVariant, theta_mm, mean_j_deg2) -> AtOptimum:
    """Compute the terms of E at theta."""
    moved = data.girdle.with_adapted(theta_mm).over_postures()
    places, weights, levels = landmark_points(data, variant.landmarks > 0.0)
    every = np.concatenate([data.points_mm, places], axis=1)
    distance_mm = np.asarray(signed_distance_mm(every, moved.centre_mm, moved.semi_axes_mm))
    of_points, of_landmarks = np.split(distance_mm, [np.shape(data.points_mm)[1]])
    L = np.where(np.any(weights > 0.0, axis=0), np.sum(weights * (of_landmarks - levels) ** 2, axis=0), np.nan)
    return AtOptimum(of_points, np.asarray(data.point_weights), mean_j_deg2, np.sum(data.counted, axis=0), L)


def _lowest(data: Problems, weight: float, variant: ObjectiveVariant, equivalent, progress: Progress) -> Adapted:
    """Solve all starts of all problems side by side, continue each optimum until its postures are the lowest, and
    return the lowest optimum of each problem."""
    problem = subject_problem(data, equivalent, variant.landmarks)
    theta, angles = _starts(data)
    count = len(equivalent)
    every = np.tile(np.arange(count), theta.shape[-1] // count)
    progress("round 1")
    data, problem, equivalent = take_problems((data, problem, equivalent), every)
    found = solved_from(problem, data.active_effects, theta, angles)
    E = _as_adapted(data, weight, variant, equivalent, found).E
    same = _SAME_E.for_dtype_of(data.angles)
    kept = np.flatnonzero(_distinct(np.where(found.converged & np.isfinite(E), E, np.inf).reshape(-1, count), same))
    data, problem, equivalent, found = take_problems((data, problem, equivalent, found), kept)
    found = _to_the_lowest_postures(data, problem, found, progress)
    ended = _as_adapted(as_type(data, float), weight, variant, equivalent, found)
    E = np.where((ended.code != status.UNCONVERGED) & np.isfinite(ended.E), ended.E, np.inf)
    lowest, number = np.full(count, np.inf), every[kept]
    np.minimum.at(lowest, number, E)
    among_lowest = np.flatnonzero(lowest[number] * (1.0 + same) >= E)
    return take_problems(ended, among_lowest[np.unique(number[among_lowest], return_index=True)[1]])


def _distinct(E: Float[np.ndarray, "starts problems"], same: float) -> Bool[np.ndarray, "starts problems"]:
    """Return which starts have led to an optimum (finite E) that no earlier start has found; where none has found any,
    the first start."""
    kept = np.zeros(E.shape, bool)
    for number, one in enumerate(E):
        with np.errstate(invalid="ignore"):
            equal = np.abs(E[:number] - one) <= same * np.abs(one)
        kept[number] = np.isfinite(one) & ~(kept[:number] & equal).any(axis=0)
    kept[0] |= ~np.isfinite(E).any(axis=0)
    return kept


def _starts(data: Problems) -> tuple[Float[np.ndarray, "adapted starts"], Float[np.ndarray, "6 postures starts"]]:
    """Return theta at every offset to the geometric fit, with the postures fitted there and with the measured angles;
    with active effects, whose solver closes the chains itself, with the measured angles alone."""
    lower, upper = data.bounds_mm
    theta = [np.clip(data.girdle.adapted_mm + offset[:, None], lower, upper) for offset in STARTS_MM]
    angles = [np.asarray(data.angles)]
    if not data.active_effects.effects:
        girdle = take_problems(data.girdle.with_adapted(theta[0]), np.nonzero(data.counted)[1])
        near = nearby_angles(girdle, *_of_rows(data))
        angles.insert(0, _over_postures(data, near))
    each_theta, each_angles = zip(*[(one, other) for other in angles for one in theta], strict=True)
    return np.concatenate(each_theta, axis=-1), np.concatenate(each_angles, axis=-1)


def adapted_from(
    data: Problems,
    theta: Float[np.ndarray, "adapted problems"],
    weight: float | Float[np.ndarray, " problems"] = WEIGHT,
) -> Adapted:
    """Find the optimum of E = D [mm^2] + weight mean(J) [deg^2] within the bounds from a single start theta, mm."""
    variant = OBJECTIVES[DEFAULT_OBJECTIVE]
    equivalent = np.broadcast_to(np.asarray(weight, float), data.counted.shape[1:])
    return _from_theta(data, weight, variant, equivalent, theta)


def _from_theta(data: Problems, weight, variant: ObjectiveVariant, equivalent, theta, point_weights=None) -> Adapted:
    """Find the optimum reached from theta and the postures that are fitted there."""
    problem = subject_problem(data, equivalent, variant.landmarks, point_weights)
    start = data.angles if data.active_effects.effects else fitted_angles(data, theta)
    found = solved_from(problem, data.active_effects, theta, start)
    found = _to_the_lowest_postures(data, problem, found, lambda _: None)
    return _as_adapted(as_type(data, float), weight, variant, equivalent, found)


def _to_the_lowest_postures(
    data: Problems, problem: SubjectProblem, result: SubjectSolution, progress: Progress
) -> SubjectSolution:
    """Continue problems that have not converged or have a posture in the higher of two local minima."""
    left = np.arange(len(result.converged))
    for number in range(2, _ROUNDS + 1):
        angles, lower = _lower_postures(take_problems(data, left), take_problems(result, left))
        again = ~result.converged[left] | lower
        left = left[again]
        if not len(left):
            break
        progress(f"round {number}")
        part = take_problems((problem, data.active_effects), left)
        further = solved_from(*part, result.theta[:, left], angles[..., again])
        gains = further.converged | ~result.converged[left]
        left = left[gains]  # any other would repeat the same path
        result = with_problems(result, left, take_problems(further, gains))
        if not len(left):
            break
    return result


def solved_from(problem: SubjectProblem, active_effects: ActiveEffects, theta, angles) -> SubjectSolution:
    """Find the optima reached from one start, by Newton where the chain has no effects, by projections where it has
    some and where Newton has not converged (1 of 10 000 simulated adaptations); check ``converged``."""
    if active_effects.effects:
        return projection.fit_subjects(problem, theta, angles, active_effects)
    found = newton.fit_subjects(problem, theta, angles)
    exact = as_type(problem, float)
    if problem.angles.dtype == np.float32:
        refit(found, ~found.converged, newton.fit_subjects, exact, *as_type((theta, angles), float))
    return refit(found, ~found.converged, projection.fit_subjects, exact, found.theta, found.angles)


def _lower_postures(data: Problems, solved: SubjectSolution) -> tuple[np.ndarray, np.ndarray]:
    """Return the postures, fitted anew at the solution where that lowers their J, and the problems where it does.

    A posture can follow theta in a local minimum that has become the higher one; E is the sum over the lowest.
    """
    fresh = fitted_angles(data, solved.theta)
    weights = angle_weights(data.measured)
    before, after = (mean_square_deg2(angles, data.angles, weights) for angles in (solved.angles, fresh))
    lower = (after < before - _LOWER_DEG2.for_dtype_of(data.angles)) & data.counted
    return np.where(lower[None], fresh, solved.angles), np.any(lower, axis=0)


def fitted_angles(data: Problems, theta: Float[Array, " adapted problems"]) -> Float[Array, " 6 postures problems"]:
    """Fit the postures of every problem with its own girdle at theta; padding is a copy of the last counted posture."""
    girdles = data.girdles_at(theta, *np.nonzero(data.counted))
    angles = fit_batch(girdles, *_of_rows(data)).angles
    return _over_postures(data, angles)


def _of_rows(data: Problems) -> tuple[Float[np.ndarray, "6 rows"], Bool[np.ndarray, "6 rows"]]:
    """Return the measured angles of every counted posture, and the mask of measured angles."""
    posture, problem = np.nonzero(data.counted)
    return np.asarray(data.angles)[:, posture, problem], np.asarray(data.measured)[:, posture, problem]


def _over_postures(data: Problems, angles: Float[np.ndarray, "6 rows"]) -> Float[np.ndarray, "6 postures problems"]:
    """Arrange the angles of the counted postures by problem; padding is a copy of the last counted posture."""
    place = np.zeros(data.counted.shape, int)
    place[np.nonzero(data.counted)] = np.arange(angles.shape[1])
    return angles[:, np.maximum.accumulate(place, axis=0)]


def _as_adapted(data: Problems, weight, variant: ObjectiveVariant, equivalent, solved: SubjectSolution) -> Adapted:
    angles, count = np.sum(data.measured, axis=0), np.sum(data.counted, axis=0)
    determined = np.all(angles >= FEWEST_ANGLES, axis=0)
    theta = np.where(determined, solved.theta, np.nan)
    j = mean_square_deg2(solved.angles, data.angles, angle_weights(data.measured))
    mean_j = np.where(data.counted, j, 0.0).sum(axis=0) / count
    at = _at_optimum(data, variant, theta, mean_j)
    lower, upper = (np.asarray(bound) for bound in data.bounds_mm)
    informed = np.any(data.counted & (angles > FEWEST_ANGLES), axis=0) | (mean_j > _EXACT_DEG2)
    converged = np.asarray(solved.converged) & np.isfinite(at.D_mm2) & np.isfinite(mean_j)
    code = np.where(informed, np.where(converged, status.CONVERGED, status.UNCONVERGED), status.EXACT)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_weight = count / equivalent  # W of an angle in E is weight / postures times its W in J
        multipliers, stationarity = (np.asarray(x) * per_weight for x in (solved.multipliers, solved.stationarity))
    return Adapted(
        theta_mm=theta,
        at_bound=(theta <= lower + _AT_BOUND_MM) | (theta >= upper - _AT_BOUND_MM),
        angles=np.asarray(solved.angles),
        multipliers=multipliers,
        residual_mm=np.asarray(solved.residual_mm),
        stationarity=stationarity,
        D_mm2=at.D_mm2,
        L_mm2=at.L_mm2,
        mean_j_deg2=mean_j,
        E=variant.value(weight, at),
        weight=np.asarray(equivalent, float),
        point_weights=at.point_weights,
        landmark_weight=np.full(theta.shape[1:], variant.landmarks),
        iterations=np.asarray(solved.iterations),
        sizes=np.zeros((0, *theta.shape[1:])),
        code=np.where(determined, code, status.UNUSABLE),
    )
