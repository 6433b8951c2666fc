"""Posture fit of the chain without effects: Newton on its optimality conditions, by components.

    minimise  J(q) = 1/2 (q - s)' W (q - s),   subject to  A1, A2, A3:  g(q) = 0        (thesis Eq. 6.1-6.2)

A problem that does not converge here is no failure: ``adapt.solvers.projection`` continues with it.
"""

from typing import NamedTuple

import jax
from jaxtyping import Bool, Float

from adapt.engine.axes import stacked
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
from adapt.solvers.newton.linear_algebra import (
    Components,
    backward,
    column,
    factorised,
    forward,
    largest,
    product,
)
from adapt.solvers.solution import PostureSolution
from models.adapted_parameters import adapted_components
from models.derivatives import ConstraintDerivatives, chain, closest_point_multipliers
from models.girdle import Girdle
from motions.arrays import Array, ByType, repeat, repeat_while, xp
from motions.rotations import DEG

_LAST_STEP_RAD = ByType(1e-7, 1e-5)
"""Step length at which a fit ends. Convergence is quadratic, so only rounding is left after this step, and the
optimality conditions are tested there."""

_SAME_MINIMUM_RAD = 1e-3
"""Distance from a known optimum within which the end of a Newton step belongs to its local minimum."""

_SAME_DEG2 = ByType(1e-6, 1e-3)
"""Difference of J below which two optima are the same."""


class _State(NamedTuple):
    """State as in ``adapt.solvers.newton.subject``, without parameters."""

    base: Components
    multipliers: Components
    step: Components
    change: Components
    length: Array
    target: Components
    range_space_penalty: Components
    merit: Array
    closest_point_multipliers: Components
    iterations: Array
    converged: Array


Start = tuple[Float[Array, " 6 problems"], Float[Array, " 3 problems"], Bool[Array, " problems"]]
"""Angles, multipliers, and the mask of problems that have already converged there."""

Lowest = tuple[PostureSolution, Bool[Array, " problems"], Bool[Array, " problems"]]
"""Lower one of the optima reached from two starts, with the iterations from both; whether each start led to an optimum;
whether they led to different optima."""


class _Problem(NamedTuple):
    """Problem min J over the closed postures of a girdle, by components."""

    girdle: Girdle
    measured: Components
    weights: Components

    @property
    def theta(self) -> Components:
        """Adapted parameters."""
        return adapted_components(self.girdle)

    def objective_gradient(self, q: Components) -> Components:
        """Compute W (q - s)."""
        return [w * (x - s) for w, x, s in zip(self.weights, q, self.measured, strict=True)]

    def j_deg2(self, q: Components) -> Array:
        """Compute 1/2 (q - s)' W (q - s)."""
        return 0.5 * product(self.objective_gradient(q), [x - s for x, s in zip(q, self.measured, strict=True)])

    def chain(self, q: Components, multipliers: Components, nearby_multipliers: Components) -> ConstraintDerivatives:
        return chain(self.girdle, q, self.theta, multipliers, nearby_multipliers)

    def closest_point_multipliers(self, q: Components) -> Components:
        return closest_point_multipliers(self.girdle, q, self.theta)


def iterate(
    girdle: Girdle,
    measured: Float[Array, " 6 problems"],
    weights: Float[Array, " 6 problems"],
    start: Start,
    iterations: Float[Array, " problems"],
) -> PostureSolution:
    """Iterate at most ``iterations`` times from ``start``; a problem that has converged there stays where it is."""
    problem = _Problem(girdle, list(measured), list(weights))
    (angles, multipliers), converged = map(list, start[:2]), start[2]
    first = _first(angles, multipliers, problem.closest_point_multipliers(angles))._replace(converged=converged)
    end = _iterated(problem, first, [xp.full_like(x, xp.inf) for x in angles], iterations)
    return _judged(problem, *_last_step(end, end.converged & ~converged), end.iterations)


def iterate_from_two_starts(
    girdle: Girdle,
    measured: Float[Array, " 6 problems"],
    weights: Float[Array, " 6 problems"],
    starts: tuple[Float[Array, " 6 problems"], Float[Array, " 6 problems"]],
    closing_steps: tuple[Float[Array, " problems"], Float[Array, " problems"]],
    iterations: Float[Array, " problems"],
) -> Lowest:
    """Close the chain by ``closing_steps`` from each start, and fit it from there in at most ``iterations``.

    A path from the second start is not followed to its end where it leads to the optimum of the first start.
    """
    problem = _Problem(girdle, list(measured), list(weights))
    each = xp.zeros_like(measured[0])
    nothing = [each + xp.inf] * 6, [each] * 3, each + xp.inf, each <= 0.0, each > 0.0, xp.zeros_like(each, int)

    def tried(carry):
        start, steps, (best, best_multipliers, lowest, settled, _, count) = carry
        end = _iterated(problem, _closed_nearby(problem, start, steps), best, iterations)
        q, multipliers = _last_step(end, end.converged)
        J = problem.j_deg2(q)
        another = end.converged & ~_near(q, best)
        lower = another & (lowest > J)
        further = (
            [xp.where(lower, x, y) for x, y in zip(q, best, strict=True)],
            [xp.where(lower, x, y) for x, y in zip(multipliers, best_multipliers, strict=True)],
            xp.where(lower, J, lowest),
            settled & end.converged,
            another & (lowest < xp.inf) & (abs(J - lowest) > _SAME_DEG2.for_dtype_of(J)),
            count + end.iterations,
        )
        return list(starts[1]), closing_steps[1], further

    _, _, found = repeat(2, tried, (list(starts[0]), closing_steps[0], nothing))
    best, multipliers, lowest, settled, apart, count = found
    q = [xp.where(lowest < xp.inf, x, s) for x, s in zip(best, measured, strict=True)]
    return _judged(problem, q, multipliers, count), settled, apart


def _near(q: Components, known: Components) -> Array:
    """Check whether q is in the local minimum of a known optimum."""
    return largest([x - y for x, y in zip(q, known, strict=True)]) <= _SAME_MINIMUM_RAD


def _first(angles: Components, multipliers: Components, nearby_multipliers: Components) -> _State:
    each = xp.zeros_like(angles[0])
    return _State(
        base=angles,
        multipliers=multipliers,
        step=[each] * 6,
        change=[each] * 3,
        length=each + 1.0,
        target=[each] * 3,
        range_space_penalty=[each] * 3,
        merit=each + xp.inf,
        closest_point_multipliers=nearby_multipliers,
        iterations=xp.zeros_like(each, int),
        converged=each > 0.0,
    )


def _iterated(problem: _Problem, first: _State, known: Components, iterations: Array) -> _State:
    def advance(everything):
        return (_iterate(problem, known, *everything),)

    (end,) = until_converged(advance, (first,), iterations)
    return end


def _last_step(end: _State, last: Array) -> tuple[Components, Components]:
    """Take the step that a problem still proposes at its end, in the ``last`` problems."""
    q = [xp.where(last, x + dx, x) for x, dx in zip(end.base, end.step, strict=True)]
    return q, [xp.where(last, x + dx, x) for x, dx in zip(end.multipliers, end.change, strict=True)]


def _judged(problem: _Problem, q: Components, multipliers: Components, iterations: Array) -> PostureSolution:
    """Test the optimality conditions at q, with the closest points computed anew."""
    at = problem.chain(q, multipliers, problem.closest_point_multipliers(q))
    rest = stationarity(at, problem.objective_gradient(q), multipliers) / DEG
    converged = (largest(at.g) <= CLOSED_MM.for_dtype_of(rest)) & (rest <= STATIONARY.for_dtype_of(rest))
    code = xp.where(converged, status.CONVERGED, status.UNCONVERGED)
    J, no_jump = problem.j_deg2(q), rest < -1.0
    return PostureSolution(stacked(q), stacked(multipliers), stacked(at.g), rest, J, iterations, code, no_jump)


def _iterate(problem: _Problem, known: Components, state: _State) -> _State:
    q = [x + state.length * dx for x, dx in zip(state.base, state.step, strict=True)]
    multipliers = [x + state.length * dx for x, dx in zip(state.multipliers, state.change, strict=True)]
    at = problem.chain(q, multipliers, state.closest_point_multipliers)
    J, objective_gradient = problem.j_deg2(q), problem.objective_gradient(q)
    good = good_enough(state, J + augmented(state.target, state.range_space_penalty, at.g))
    posture = Elimination(at, problem.weights, objective_gradient, parameters=False)
    step, target = posture.steps.moved([])
    short = largest(step) <= _LAST_STEP_RAD.for_dtype_of(J)
    arrived = short | _near([x + dx for x, dx in zip(q, step, strict=True)], known)
    accepted = _State(
        base=q,
        multipliers=multipliers,
        step=step,
        change=[x - y for x, y in zip(target, multipliers, strict=True)],
        length=xp.minimum(1.0, STEP_LIMIT_RAD / largest(step)),
        target=target,
        range_space_penalty=posture.range_space_penalty,
        merit=J + augmented(target, posture.range_space_penalty, at.g),
        closest_point_multipliers=at.closest_point_multipliers,
        iterations=state.iterations + 1,
        converged=good & posture.convex & arrived,
    )
    return accepted_or_shorter(good, accepted, state)


def _closed_nearby(problem: _Problem, start: Components, steps: Array) -> _State:
    """Move onto the constraint surface by ``steps`` Gauss-Newton steps q <- q - G'(GG')^-1 g: a starting point, no
    solution.

    The multipliers there minimise |W (q - s) + G' lambda|.
    """
    each = xp.zeros_like(start[0])

    def closer(carry):
        number, q, _, t = carry
        at = problem.chain(q, [each] * 3, t)
        S, inverse, _ = factorised([[product(at.G[i], at.G[j]) for j in range(i + 1)] for i in range(3)], each)

        def lifted(b: Components) -> Components:
            """Compute (GG')^-1 b."""
            return backward(S, [x * d for x, d in zip(forward(S, b), inverse, strict=True)])

        lift = lifted(at.g)
        step = [-product(column(at.G, k), lift) for k in range(6)]
        limit = xp.minimum(1.0, STEP_LIMIT_RAD / largest(step))
        q = [x + limit * dx for x, dx in zip(q, step, strict=True)]
        objective_gradient = problem.objective_gradient(q)
        new = number + 1.0, q, lifted([-product(row, objective_gradient) for row in at.G]), at.closest_point_multipliers
        return jax.tree.map(lambda a, b: xp.where(number < steps, a, b), new, carry)

    first = each, list(start), [each] * 3, [each] * 2
    _, q, multipliers, t = repeat_while(lambda carry: xp.any(carry[0] < steps), closer, first)
    return _first(q, multipliers, t)
