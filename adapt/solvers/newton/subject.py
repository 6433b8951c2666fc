"""Adaptation of the chain without effects: adapted parameters and all postures of a subject at once (thesis Eq. 6.5).

    minimise  D(theta) + sum_p 1/2 (q_p - s_p)' W_p (q_p - s_p),   g(q_p, theta) = 0 for every posture p,
    lower <= theta <= upper

with W_p the weight (w / postures) of J_p. The optimality conditions have an arrow shape: one 9 x 9 block per posture,
bordered by theta; their solution is the nested optimum. Derivatives are hand-written (``models.derivatives``), every
array is one component. Each iteration evaluates once and eliminates the postures
(``adapt.solvers.newton.elimination``); theta minimises the remaining quadratic model within its bounds and a trust
radius (``_box_minimum``). Backtracking (``adapt.solvers.newton.backtracking``) finds the step length on the augmented
Lagrangian E + lambda'g + 1/2 g' s g, which needs no more than g: a rejected point costs one evaluation.

One kernel function serves the engines of ``motions.arrays``: the operations on postures and thorax points are functions
of one posture or one point. A problem that does not converge here is no failure: ``adapt.solvers.projection`` continues
with it.
"""

from typing import Any, NamedTuple

import jax
from jaxtyping import Bool, Float

from adapt.engine.axes import along, stacked
from adapt.solvers import status
from adapt.solvers.newton.backtracking import accepted_or_shorter, good_enough, until_converged
from adapt.solvers.newton.elimination import (
    CLOSED_MM,
    STATIONARY,
    STEP_LIMIT_RAD,
    Elimination,
    augmented,
    stationarity,
)
from adapt.solvers.newton.linear_algebra import Components, backward, factorised, forward, largest, product
from adapt.solvers.solution import THETA_TOLERANCE, SubjectSolution
from models.adapted_parameters import ADAPTED, ELLIPSOID, ellipsoid_components
from models.derivatives import (
    Distance,
    Vector,
    chain,
    closest_point_multiplier_near,
    closest_point_multipliers,
    distance,
    ellipsoid_curvature,
    ellipsoid_slope,
)
from models.ellipsoid import closest_point_multiplier
from models.girdle import Girdle
from motions.arrays import Array, ByType, repeat, xp
from motions.rotations import DEG

_THETA_FLOOR = ByType(1e-9, 1e-6)
"""Smallest pivot of the matrix in theta, relative to its largest entry; a raised pivot leads to the trust radius."""

_FLAT = ByType(THETA_TOLERANCE, 5e-5)
"""Tolerance of |dE/dtheta| for a free parameter. In float32 rounding leaves 1e-5: 0.1 mm in the flattest direction that
is distinguished from a flat one, with a curvature of ``_THETA_FLOOR`` times 1e2."""

_FIRST_RADIUS_MM, _LEAST_RADIUS_MM = 15.0, 0.01

_GROWTH = 2.0
"""Factor on the trust radius after a full step."""

_ACTIVE_SETS = 5
"""Number of changes of the active set within one step."""

_COORDINATE_STEPS = 8
"""Rounds of coordinate steps after the active sets: with them a third fewer problems need a second round of
iterations."""


class SubjectProblem(NamedTuple):
    """Data and model of an adaptation."""

    girdle: Girdle
    points_mm: Float[Array, " 3 points problems"]
    point_weights: Float[Array, " points problems"]
    levels_mm: Float[Array, " points problems"]
    """Nominal distance of each point to the ellipsoid: 0 for a thorax point."""
    angles: Float[Array, " 6 postures problems"]
    """Measured angles s, rad, finite everywhere."""
    weights: Float[Array, " 6 postures problems"]
    """W, including w / postures: E per rad^2. Zero for unmeasured angles."""
    counted: Bool[Array, " postures problems"]
    """False for padding: a copy of some posture that is solved too and has no part in E."""
    lower: Float[Array, " adapted problems"]
    upper: Float[Array, " adapted problems"]


Start = tuple[
    Float[Array, " adapted problems"],
    Float[Array, " 6 postures problems"],
    Float[Array, " 3 postures problems"],
    Bool[Array, " problems"],
]
"""Parameters, angles, multipliers, and the mask of problems that have already converged there."""


class _Posture(NamedTuple):
    """Last accepted point of a posture, and the step from it."""

    q: Components
    multipliers: Components
    dq: Components
    change: Components
    """Change of the multipliers in the step."""
    target: Components
    """Multipliers at the end of the full step, which the merit uses."""
    range_space_penalty: Components
    closest_point_multipliers: Components
    """Multipliers t of the closest points of TS and AI."""


class _State(NamedTuple):
    """Last accepted point of a subject, the step from it, and the share of the step that is tried."""

    theta: Components
    dtheta: Components
    length: Array
    merit: Array
    """Merit of the accepted point; infinite before the first evaluation."""
    radius_mm: Array
    iterations: Array
    converged: Array
    """True where the accepted point meets the tolerances of an optimum."""


class _Sums(NamedTuple):
    """Sums over the postures, or over the points."""

    E: Array
    augmented: Array
    slope: Components
    """dE/dtheta."""
    right: Components
    """dE/dtheta after the postures' own steps."""
    matrix: list[Components]
    """Lower triangle of the system in theta."""


def iterate(problem: SubjectProblem, start: Start, iterations: Float[Array, " problems"]) -> SubjectSolution:
    """Iterate at most ``iterations`` times from ``start``; a problem that has converged there stays where it is."""
    girdle, points_mm, point_weights, levels_mm, *_ = problem
    over_postures, over_points = along(problem.counted, problem.counted), along(point_weights)
    first_theta, first_angles, first_multipliers, already = start
    theta = list(first_theta)
    each = theta[0]
    zero = xp.zeros_like(each)

    def first(q, multipliers):
        none = [xp.zeros_like(q[0])] * 6
        t = closest_point_multipliers(girdle, list(q), theta)
        return (), (), _Posture(list(q), list(multipliers), none, none[:3], list(multipliers), none[:3], t)

    *_, postures = over_postures.reduced(first, first_angles, first_multipliers)
    *_, points = over_points.reduced(lambda point: ((), (), point_multiplier(girdle, theta, point)), points_mm)
    state = _State(
        theta,
        [zero] * len(theta),
        zero + 1.0,
        zero + xp.inf,
        zero + _FIRST_RADIUS_MM,
        xp.zeros_like(each, int),
        already,
    )

    def advance(everything):
        return _iterate(problem, iterations, *everything)

    state, postures, points = until_converged(advance, (state, postures, points), iterations)

    # The step that a converged problem still proposes is taken too: convergence is quadratic, so only rounding is left.
    last = state.converged & ~already
    theta = [xp.where(last, x + dx, x) for x, dx in zip(state.theta, state.dtheta, strict=True)]

    def end_of(own: _Posture, measured, weights):
        q = [xp.where(last, x + dx, x) for x, dx in zip(own.q, own.dq, strict=True)]
        multipliers = [xp.where(last, x + dx, x) for x, dx in zip(own.multipliers, own.change, strict=True)]
        at = chain(girdle, q, theta, multipliers, closest_point_multipliers(girdle, q, theta))
        rest = stationarity(at, _objective_gradient(weights, q, measured), multipliers) / DEG
        return _slope(at, multipliers), (largest(at.g), rest), (q, multipliers, at.g, rest)

    slope, (violation, rest), kept = over_postures.reduced(end_of, postures, problem.angles, problem.weights)

    def thorax_slope(point, point_weight, level):
        t = point_multiplier(girdle, theta, point)
        return thorax_terms(girdle, theta, point, point_weight, level, t)[0].slope, (), ()

    of_points, *_ = over_points.reduced(thorax_slope, points_mm, point_weights, levels_mm)
    free = _free(problem, theta, [x + y for x, y in zip(slope, of_points, strict=True)])
    converged = _closed_and_stationary(violation, rest, free)
    angles, multipliers, residual, rest = map(stacked, kept)
    code = xp.where(converged, status.CONVERGED, status.UNCONVERGED)
    return SubjectSolution(stacked(theta), angles, multipliers, residual, rest, stacked(free), state.iterations, code)


def _objective_gradient(weights, q, measured) -> Components:
    """Compute W (q - s)."""
    return [w * (x - s) for w, x, s in zip(weights, q, measured, strict=True)]


def _slope(at, multipliers: Components) -> Components:
    """Compute the contribution of a posture to dE/dtheta, T' lambda."""
    return [at.T[0][k] * multipliers[0] + at.T[1][k] * multipliers[1] for k in range(len(ELLIPSOID))] + [
        -multipliers[2]
    ]


def _free(problem: SubjectProblem, theta: Components, slope: Components) -> Components:
    """Return dE/dtheta, 0 for a parameter that it pushes beyond its bound."""
    return [
        xp.where(((x <= low) & (b > 0.0)) | ((x >= high) & (b < 0.0)), 0.0, b)
        for x, low, high, b in zip(theta, problem.lower, problem.upper, slope, strict=True)
    ]


def _closed_and_stationary(violation: Array, rest: Array, free_slope: Components) -> Array:
    closed = (violation <= CLOSED_MM.for_dtype_of(violation)) & (rest <= STATIONARY.for_dtype_of(rest))
    return closed & (largest(free_slope) <= _FLAT.for_dtype_of(violation))


def point_multiplier(girdle: Girdle, theta: Components, point, near: Array | None = None) -> Array:
    """Find the multiplier t of the closest point on the ellipsoid at theta; from ``near`` in a few steps."""
    place = _from_centre(girdle, theta, point)
    return closest_point_multiplier(*place) if near is None else closest_point_multiplier_near(*place, near)


def point_distance(girdle: Girdle, theta: Components, point, level, t: Array) -> tuple[Array, Components, Distance]:
    """Compute the distance of a point from its level, mm, with its slopes in the ellipsoid's parameters, and the
    ``Distance`` behind them; t is the multiplier of the closest point."""
    at = distance(*_from_centre(girdle, theta, point), t)
    return at.d - level, ellipsoid_slope(at), at


def _from_centre(girdle: Girdle, theta: Components, point) -> tuple[Vector, Vector]:
    """Return the point relative to the ellipsoid's centre at theta, and the semi-axes there, mm."""
    centre, semi_axes = ellipsoid_components(girdle, theta)
    return (point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]), semi_axes


def thorax_terms(girdle: Girdle, theta: Components, point, point_weight, level, t) -> tuple[_Sums, Array]:
    """Compute a point's part of sum share_i (d_i - level_i)^2 with its derivatives, and the t of its closest point."""
    t = point_multiplier(girdle, theta, point, near=t)
    off, slope, at = point_distance(girdle, theta, point, level, t)
    curvature, objective_gradient, zero = ellipsoid_curvature(at), 2.0 * point_weight * off, xp.zeros_like(off)
    by_parameter = [*(objective_gradient * x for x in slope), zero]
    matrix = [
        [2.0 * point_weight * slope[i] * slope[j] + objective_gradient * curvature[i][j] for j in range(i + 1)]
        for i in range(len(ELLIPSOID))
    ]
    return _Sums(point_weight * off**2, zero, by_parameter, by_parameter, [*matrix, [zero] * len(ADAPTED)]), t


def _iterate(
    problem: SubjectProblem, iterations: Float[Array, " problems"], state: _State, postures: Any, points: Any
) -> tuple[_State, Any, Any]:
    girdle, points_mm, point_weights, levels_mm, *_ = problem
    over_postures, over_points = along(problem.counted, problem.counted), along(point_weights)
    theta = [x + state.length * dx for x, dx in zip(state.theta, state.dtheta, strict=True)]

    def thorax(point, point_weight, level, t):
        sums, t = thorax_terms(girdle, theta, point, point_weight, level, t)
        return sums, (), t

    def tried(own: _Posture, measured, weights):
        q = [x + state.length * dx for x, dx in zip(own.q, own.dq, strict=True)]
        multipliers = [x + state.length * dx for x, dx in zip(own.multipliers, own.change, strict=True)]
        at = chain(girdle, q, theta, multipliers, own.closest_point_multipliers)
        gap = [x - s for x, s in zip(q, measured, strict=True)]
        objective_gradient = [w * x for w, x in zip(weights, gap, strict=True)]
        posture = Elimination(at, list(weights), objective_gradient, parameters=True)
        sums = _Sums(
            E=0.5 * product(objective_gradient, gap),
            augmented=augmented(own.target, own.range_space_penalty, at.g),
            slope=_slope(at, multipliers),
            right=[posture.slope(i) for i in range(len(theta))],
            matrix=[[posture.curvature(i, j) for j in range(i + 1)] for i in range(len(theta))],
        )
        worst = (
            largest(at.g),
            stationarity(at, objective_gradient, multipliers) / DEG,
            xp.where(posture.convex, 0.0, 1.0),
        )
        return sums, worst, (q, multipliers, posture.range_space_penalty, at.closest_point_multipliers, posture.steps)

    of_points, _, points_tried = over_points.reduced(thorax, points_mm, point_weights, levels_mm, points)
    of_postures, worst, kept = over_postures.reduced(tried, postures, problem.angles, problem.weights)
    violation, rest, concave = worst
    sums: _Sums = jax.tree.map(lambda x, y: x + y, of_points, of_postures)
    good = good_enough(state, sums.E + sums.augmented)
    taken = good & ~state.converged & (state.iterations < iterations)

    radius = xp.where(
        state.length < 1.0, xp.maximum(state.length * state.radius_mm, _LEAST_RADIUS_MM), _GROWTH * state.radius_mm
    )
    low = [xp.maximum(bound - x, -radius) for bound, x in zip(problem.lower, theta, strict=True)]
    high = [xp.minimum(bound - x, radius) for bound, x in zip(problem.upper, theta, strict=True)]
    dtheta, definite = _box_minimum(sums.matrix, sums.right, low, high)

    def moved(old: _Posture, point):
        q, multipliers, range_space_penalty, t, steps = point
        dq, target = steps.moved(dtheta)
        change = [x - y for x, y in zip(target, multipliers, strict=True)]
        new = _Posture(q, multipliers, dq, change, target, range_space_penalty, t)
        return augmented(target, range_space_penalty, steps.g), largest(dq), new

    added, longest, postures = over_postures.advanced(taken, moved, postures, kept)
    *_, points = over_points.advanced(taken, lambda _, t: ((), (), t), points, points_tried)
    accepted = _State(
        theta=theta,
        dtheta=dtheta,
        length=xp.minimum(1.0, STEP_LIMIT_RAD / longest),
        merit=sums.E + added,
        radius_mm=radius,
        iterations=state.iterations + 1,
        converged=good
        & definite
        & (concave <= 0.0)
        & _closed_and_stationary(violation, rest, _free(problem, theta, sums.slope)),
    )
    return accepted_or_shorter(good, accepted, state), postures, points


def _box_minimum(
    matrix: list[Components], slope: Components, low: Components, high: Components
) -> tuple[Components, Array]:
    """Find the minimum of 1/2 x' matrix x + slope' x over low <= x <= high, and whether matrix was positive definite.

    Active sets: solve with some parameters fixed at a bound, fix those that leave their bounds, release those whose
    slope points inward; two or three rounds are mostly enough. Clipping the free step instead would leave the other
    parameters at values that fit the unclipped parameter. Where the active sets cycle, steps along one parameter at a
    time reduce the model further.
    """
    size = largest([x for row in matrix for x in row])

    def pushed(x):
        """Compute slope + matrix x."""
        return [b + product([matrix[max(i, j)][min(i, j)] for j in range(len(slope))], x) for i, b in enumerate(slope)]

    def with_fixed(below, above):
        free = [~(a | b) for a, b in zip(below, above, strict=True)]
        value = [xp.where(a, lo, xp.where(b, hi, 0.0)) for a, b, lo, hi in zip(below, above, low, high, strict=True)]
        reduced = [[xp.where(free[i] & free[j], x, 0.0) for j, x in enumerate(row)] for i, row in enumerate(matrix)]
        for i in range(len(slope)):
            reduced[i][i] = xp.where(free[i], reduced[i][i], size)
        L, inverse, positive = factorised(reduced, _THETA_FLOOR.for_dtype_of(size) * size)
        right = [xp.where(f, -b, size * v) for f, b, v in zip(free, pushed(value), value, strict=True)]
        return backward(L, [x * d for x, d in zip(forward(L, right), inverse, strict=True)]), positive

    def again(fixed):
        below, above = fixed
        x, _ = with_fixed(below, above)
        push = pushed(x)
        return (
            [xp.where(a, b > 0.0, y < lo) for a, b, y, lo in zip(below, push, x, low, strict=True)],
            [xp.where(a, b < 0.0, y > hi) for a, b, y, hi in zip(above, push, x, high, strict=True)],
        )

    at_low = [(lo >= 0.0) & (b > 0.0) for lo, b in zip(low, slope, strict=True)]
    at_high = [(hi <= 0.0) & (b < 0.0) for hi, b in zip(high, slope, strict=True)]
    x, definite = with_fixed(*repeat(_ACTIVE_SETS, again, (at_low, at_high)))
    x = [xp.clip(y, lo, hi) for y, lo, hi in zip(x, low, high, strict=True)]

    def lowered(x):
        x = list(x)
        for i in range(len(slope)):
            push = slope[i] + product([matrix[max(i, j)][min(i, j)] for j in range(len(slope))], x)
            x[i] = xp.clip(
                x[i] - push / xp.maximum(matrix[i][i], _THETA_FLOOR.for_dtype_of(size) * size), low[i], high[i]
            )
        return x

    return repeat(_COORDINATE_STEPS, lowered, x), definite
