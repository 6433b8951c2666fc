"""The fast path of the posture fit: the Newton iteration of ``adapt.posture`` by components (see ``adapt.sweep``).

A lane that does not end here is no failure: ``adapt.posture`` goes on with it.
"""

from typing import NamedTuple

from jaxtyping import Bool, Float, Int

from adapt.backtracking import accepted_or_shorter, good_enough, until_converged
from adapt.elimination import Components, Elimination, augmented, column, largest, product, stationarity
from adapt.linalg import backward, factorised, forward
from adapt.newton import STEP_LIMIT_RAD
from adapt.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from models.derivatives import chain, feet
from models.girdle import Girdle
from motions.arrays import Array, repeat, stacked, xp
from motions.rotations import DEG

_CLOSING_STEPS = 6
"""Steps of the second start onto the constraint surface: closed to 1e-3 mm from 15 degrees off, mostly."""

_AT_REST_RAD = 1e-10
"""Step still proposed where a fit may end; quadratically, nothing is left of it."""


class _State(NamedTuple):
    """As in ``adapt.sweep``, without parameters."""

    base: Components
    multipliers: Components
    step: Components
    change: Components
    length: Array
    target: Components
    stiffness: Components
    merit: Array
    feet: Components
    iterations: Array
    converged: Array


class PostureStart(NamedTuple):
    """Where the fast path begins."""

    angles: Float[Array, " 6 lanes"]
    multipliers: Float[Array, " 3 lanes"]
    converged: Bool[Array, " lanes"]


class SweptPostures(NamedTuple):
    """Where it ended, with the conditions of ``adapt.posture.Postures`` there, the feet computed anew."""

    angles: Float[Array, " 6 lanes"]
    multipliers: Float[Array, " 3 lanes"]
    residual_mm: Float[Array, " 3 lanes"]
    stationarity: Float[Array, " lanes"]
    iterations: Int[Array, " lanes"]
    converged: Bool[Array, " lanes"]


def sweep_postures(
    girdle: Girdle,
    measured: Float[Array, " 6 lanes"],
    weights: Float[Array, " 6 lanes"],
    start: PostureStart,
    iterations: Float[Array, " lanes"],
) -> SweptPostures:
    """At most ``iterations`` iterations on from ``start``; a lane that has converged there stays where it is."""
    lane, theta = xp.zeros_like(measured[0]), adapted(girdle)
    first = _State(
        base=list(start.angles),
        multipliers=list(start.multipliers),
        step=[lane] * 6,
        change=[lane] * 3,
        length=lane + 1.0,
        target=[lane] * 3,
        stiffness=[lane] * 3,
        merit=lane + xp.inf,
        feet=feet(girdle, start.angles, theta),
        iterations=xp.zeros_like(lane, int),
        converged=start.converged,
    )

    def advance(everything):
        return (_iterate(girdle, theta, list(measured), list(weights), *everything),)

    (end,) = until_converged(advance, (first,), iterations)
    # The step that a converged lane still proposes is taken too: quadratically, nothing but rounding is left then.
    last = end.converged & ~start.converged
    q = [xp.where(last, x + dx, x) for x, dx in zip(end.base, end.step, strict=True)]
    multipliers = [xp.where(last, x + dx, x) for x, dx in zip(end.multipliers, end.change, strict=True)]
    at = chain(girdle, q, theta, multipliers, feet(girdle, q, theta))
    pull = [w * (x - s) for w, x, s in zip(weights, q, measured, strict=True)]
    rest = stationarity(at, pull, multipliers) / DEG
    converged = (largest(at.g) <= CONSTRAINT_TOLERANCE_MM) & (rest <= STATIONARITY_TOLERANCE)
    return SweptPostures(stacked(q), stacked(multipliers), stacked(at.g), rest, end.iterations, converged)


def adapted(girdle: Girdle) -> Components:
    """The adapted parameters, by component."""
    return [*girdle.centre_mm[1:], *girdle.semi_axes_mm, girdle.conoid_length_mm]


def _iterate(girdle: Girdle, theta: Components, measured: Components, weights: Components, state: _State) -> _State:
    q = [x + state.length * dx for x, dx in zip(state.base, state.step, strict=True)]
    multipliers = [x + state.length * dx for x, dx in zip(state.multipliers, state.change, strict=True)]
    at = chain(girdle, q, theta, multipliers, state.feet)
    gap = [x - s for x, s in zip(q, measured, strict=True)]
    pull = [w * x for w, x in zip(weights, gap, strict=True)]
    J = 0.5 * product(pull, gap)
    good = good_enough(state, J + augmented(state.target, state.stiffness, at.g))
    postures = Elimination(at, weights, pull, parameters=False)
    step, target = postures.steps.moved([])
    converged = (
        good
        & postures.convex
        & (largest(at.g) <= CONSTRAINT_TOLERANCE_MM)
        & (stationarity(at, pull, multipliers) / DEG <= STATIONARITY_TOLERANCE)
        & (largest(step) <= _AT_REST_RAD)
    )
    accepted = _State(
        base=q,
        multipliers=multipliers,
        step=step,
        change=[x - y for x, y in zip(target, multipliers, strict=True)],
        length=xp.minimum(1.0, STEP_LIMIT_RAD / largest(step)),
        target=target,
        stiffness=postures.stiffness,
        merit=J + augmented(target, postures.stiffness, at.g),
        feet=at.feet,
        iterations=state.iterations + 1,
        converged=converged,
    )
    return accepted_or_shorter(good, accepted, state)


def closed_nearby(girdle: Girdle, start: Float[Array, " 6 lanes"]) -> Float[Array, " 6 lanes"]:
    """Gauss-Newton onto the constraint surface, q <- q - G'(GG')^-1 g: a start, not a solution."""
    theta = adapted(girdle)
    lane = xp.zeros_like(start[0])

    def closer(carry):
        q, feet_here = carry
        at = chain(girdle, q, theta, [lane] * 3, feet_here)
        S, inverse, _ = factorised([[product(at.G[i], at.G[j]) for j in range(i + 1)] for i in range(3)], lane)
        lift = backward(S, [x * d for x, d in zip(forward(S, at.g), inverse, strict=True)])
        step = [-product(column(at.G, k), lift) for k in range(6)]
        limit = xp.minimum(1.0, STEP_LIMIT_RAD / largest(step))
        return [x + limit * dx for x, dx in zip(q, step, strict=True)], at.feet

    q, _ = repeat(_CLOSING_STEPS, closer, (list(start), [lane] * 2))
    return stacked(q)
