"""The fast path of the adaptation: the Newton iteration of ``adapt.subject``, written for speed.

The same problem, conditions and tolerances; derivatives by hand (``models.derivatives``), every array one component, so
that an iteration is a stream of elementwise operations on a chunk of subjects that stays in the cache. Each iteration
evaluates once and eliminates the postures (``adapt.elimination``); theta minimises what is left, a quadratic
model, within its bounds and a trust radius (``_box_minimum``). The length of the step is found by backtracking
(``adapt.backtracking``) on the augmented Lagrangian  E + lambda'g + 1/2 g' s g,  which needs no more than g: a refused
point costs one evaluation.

A lane that does not end here is no failure: ``adapt.subject`` goes on with it, and judges every lane.
"""

from typing import NamedTuple

import jax
from jaxtyping import Bool, Float, Int

from adapt.backtracking import accepted_or_shorter, good_enough, until_converged
from adapt.elimination import Components, Elimination, augmented, largest, product, stationarity
from adapt.linalg import Factor, diagonal, matvec
from adapt.newton import STEP_LIMIT_RAD
from adapt.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from adapt.subject import THETA_TOLERANCE, Problem
from models.derivatives import ELLIPSOID, chain, distance, ellipsoid_curvature, ellipsoid_slope, foot
from models.ellipsoid import foot_multiplier
from models.girdle import Girdle, feet
from motions.arrays import Array, repeat, xp
from motions.rotations import DEG

_THETA_FLOOR = 1e-9
"""Smallest pivot of the matrix in theta, relative to its largest entry; a raised one leads to the trust radius."""

_FIRST_RADIUS_MM = 15.0

_GROWTH = 2.0
"""Factor on the trust radius after a full step."""

_ACTIVE_SETS = 5
"""Changes of the set of parameters at a bound within one step."""


class Point(NamedTuple):
    """A point of the whole-subject problem, by component: postures x lanes, theta lanes alone."""

    q: Components
    theta: Components
    multipliers: Components


class State(NamedTuple):
    """The last accepted point, the step from it and how much of it is tried now."""

    base: Point
    step: Point
    length: Float[Array, " lanes"]
    target: Components
    """Multipliers at the end of the full step: those of the merit."""
    stiffness: Components
    merit: Float[Array, " lanes"]
    """Of the base; infinite before the first evaluation."""
    radius_mm: Float[Array, " lanes"]
    feet: Components
    """t of TS and AI at the point tried last."""
    thorax_feet: Float[Array, " points lanes"]
    iterations: Int[Array, " lanes"]
    converged: Bool[Array, " lanes"]
    """The base meets the tolerances of ``adapt.subject``."""


class Swept(NamedTuple):
    """Where the fast path ended."""

    theta: Float[Array, " 6 lanes"]
    angles: Float[Array, " 6 postures lanes"]
    multipliers: Float[Array, " 3 postures lanes"]
    iterations: Int[Array, " lanes"]
    converged: Bool[Array, " lanes"]


def sweep(
    girdle: Girdle,
    points_mm: Float[Array, " 3 points lanes"],
    shares: Float[Array, " points lanes"],
    problem: Problem,
    start: Swept,
    iterations: int,
) -> Swept:
    """At most ``iterations`` iterations on from ``start``; a lane that has converged stays where it is."""
    spread = girdle.over_postures()
    point = Point(list(start.angles), list(start.theta), list(start.multipliers))
    state = _first(girdle, points_mm, point)._replace(converged=start.converged)

    end = until_converged(_iterate, (spread, points_mm, shares, problem), state, iterations)
    # The step that a converged lane still proposes is taken too: quadratically, nothing but rounding is left then.
    last = jax.tree.map(lambda x, dx: xp.where(end.converged & ~start.converged, x + dx, x), end.base, end.step)
    q, theta_, multipliers_ = (xp.stack(x) for x in last)
    return Swept(theta_, q, multipliers_, start.iterations + end.iterations, end.converged)


def _first(girdle: Girdle, points_mm, start: Point) -> State:
    """Nothing accepted yet: the first evaluation is at the start itself. Its merit is what the next one must not
    exceed, so the feet are exact from the beginning."""
    lane, posture = start.theta[0], start.q[0]
    moved = girdle.with_adapted(xp.stack(start.theta)).over_postures()
    return State(
        base=start,
        step=jax.tree.map(xp.zeros_like, start),
        length=xp.ones_like(lane),
        target=start.multipliers,
        stiffness=[xp.zeros_like(posture)] * 3,
        merit=xp.full_like(lane, xp.inf),
        radius_mm=xp.full_like(lane, _FIRST_RADIUS_MM),
        feet=feet(moved, xp.stack(start.q)),
        thorax_feet=foot_multiplier(*xp.broadcast_arrays(points_mm - moved.centre_mm, moved.semi_axes_mm)),
        iterations=xp.zeros_like(lane, int),
        converged=xp.zeros_like(lane, bool),
    )


def _over_postures(of_lanes: Components) -> Components:
    return [x[None] for x in of_lanes]


class Thorax(NamedTuple):
    """D = sum share_i d_i^2 with its derivatives in the ellipsoid's parameters, lower triangle."""

    value: Array
    slope: Components
    curvature: list[Components]
    feet: Array


def _thorax(points_mm, shares, girdle: Girdle, theta: Components, feet) -> Thorax:
    centre = girdle.centre_mm[0], theta[0], theta[1]
    point = points_mm[0] - centre[0], points_mm[1] - centre[1], points_mm[2] - centre[2]
    axes = theta[2], theta[3], theta[4]
    at = distance(point, axes, foot(point, axes, feet))
    slope, curvature = ellipsoid_slope(at), ellipsoid_curvature(at)
    pull = 2.0 * shares * at.d

    def entry(i, j):
        return xp.sum(2.0 * shares * slope[i] * slope[j] + pull * curvature[i][j], axis=0)

    return Thorax(
        xp.sum(shares * at.d**2, axis=0),
        [xp.sum(pull * x, axis=0) for x in slope],
        [[entry(i, j) for j in range(i + 1)] for i in range(ELLIPSOID)],
        at.t,
    )


def _iterate(girdle: Girdle, points_mm, shares, problem: Problem, state: State) -> State:
    tried = jax.tree.map(lambda x, dx: x + state.length * dx, state.base, state.step)
    q, multipliers = tried.q, tried.multipliers
    theta = _over_postures(tried.theta)
    at = chain(girdle, q, theta, multipliers, state.feet)
    thorax = _thorax(points_mm, shares, girdle, theta, state.thorax_feet)
    weights = list(problem.weights)
    gap = [x - s for x, s in zip(q, problem.measured, strict=True)]
    pull = [w * x for w, x in zip(weights, gap, strict=True)]

    def total(of_postures):
        return xp.sum(xp.where(problem.counted, of_postures, 0.0), axis=0)

    def worst(of_postures):
        return xp.max(xp.where(problem.counted, of_postures, 0.0), axis=0)

    E = thorax.value + total(0.5 * product(pull, gap))

    def merit(target, stiffness):
        return E + total(augmented(target, stiffness, at.g))

    good = good_enough(state, merit(state.target, state.stiffness))

    # Is it the optimum?
    slope = [x + total(at.T[0][k] * multipliers[0] + at.T[1][k] * multipliers[1]) for k, x in enumerate(thorax.slope)]
    slope.append(total(-multipliers[2]))
    lower, upper = list(problem.lower), list(problem.upper)
    free_slope = [
        xp.where(((x <= lo) & (b > 0.0)) | ((x >= up) & (b < 0.0)), 0.0, b)
        for x, lo, up, b in zip(tried.theta, lower, upper, slope, strict=True)
    ]
    zero = xp.zeros_like(at.g[0])
    T = [[*row, zero] for row in at.T] + [[zero] * ELLIPSOID + [zero - 1.0]]
    postures = Elimination(at, weights, pull, T, ELLIPSOID)
    right = [total(postures.slope(i)) for i in range(6)]
    right = [b + x for b, x in zip(right, thorax.slope, strict=False)] + right[ELLIPSOID:]
    matrix = [[total(postures.curvature(max(i, j), min(i, j))) for j in range(6)] for i in range(6)]
    for i in range(ELLIPSOID):
        for j in range(ELLIPSOID):
            matrix[i][j] += thorax.curvature[max(i, j)][min(i, j)]

    radius = xp.where(state.length < 1.0, xp.maximum(state.length * state.radius_mm, 1.0), _GROWTH * state.radius_mm)
    here = xp.stack(tried.theta)
    low, high = xp.maximum(problem.lower - here, -radius), xp.minimum(problem.upper - here, radius)
    theta_step, definite = _box_minimum(xp.stack([xp.stack(row) for row in matrix]), xp.stack(right), low, high)

    dq, target = postures.moved(list(theta_step[:, None]))
    converged = (
        good
        & definite
        & (worst(xp.where(postures.convex, 0.0, 1.0)) == 0.0)
        & (worst(largest(at.g)) <= CONSTRAINT_TOLERANCE_MM)
        & (worst(stationarity(at, pull, multipliers)) / DEG <= STATIONARITY_TOLERANCE)
        & (largest(free_slope) <= THETA_TOLERANCE)
    )
    step = Point(dq, list(theta_step), [x - y for x, y in zip(target, multipliers, strict=True)])
    accepted = State(
        base=tried,
        step=step,
        length=xp.minimum(1.0, STEP_LIMIT_RAD / worst(largest(dq))),
        target=target,
        stiffness=postures.stiffness,
        merit=merit(target, postures.stiffness),
        radius_mm=radius,
        feet=at.feet,
        thorax_feet=thorax.feet,
        iterations=state.iterations + 1,
        converged=converged,
    )
    return accepted_or_shorter(good, accepted, state)


def _box_minimum(
    matrix: Float[Array, " 6 6 lanes"], slope: Float[Array, " 6 lanes"], low: Array, high: Array
) -> tuple[Float[Array, " 6 lanes"], Bool[Array, " lanes"]]:
    """The minimum of 1/2 x' matrix x + slope' x over low <= x <= high, and whether matrix was positive definite.

    Active sets: solve with some parameters fixed at a bound, fix those that come out beyond one, release those whose
    slope there points inward; mostly two or three rounds. A clipped free step would leave the others where they are
    good for a parameter that never came: the reason of this function.
    """
    size = xp.max(abs(matrix), axis=(0, 1))

    def with_fixed(fixed):
        free = fixed == 0
        value = xp.where(fixed < 0, low, xp.where(fixed > 0, high, 0.0))
        reduced = xp.where(free[:, None] & free[None], matrix, 0.0) + diagonal(xp.where(free, 0.0, size))
        factor = Factor(reduced, _THETA_FLOOR * size)
        x = factor.solve_vector(xp.where(free, -(slope + matvec(matrix, value)), size * value))
        return x, factor.positive

    def again(fixed):
        x, _ = with_fixed(fixed)
        push = slope + matvec(matrix, x)
        below = xp.where(fixed < 0, push > 0.0, x < low)
        above = xp.where(fixed > 0, push < 0.0, x > high)
        return xp.where(below, -1, xp.where(above, 1, 0))

    fixed = repeat(_ACTIVE_SETS, again, xp.zeros_like(slope, int))
    x, definite = with_fixed(fixed)
    return xp.clip(x, low, high), definite
