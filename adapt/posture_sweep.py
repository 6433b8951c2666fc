"""The fast path of the posture fit: the Newton iteration of ``adapt.posture`` by components (see ``adapt.sweep``).

A lane that does not end here is no failure: ``adapt.posture`` goes on with it, and judges every lane.
"""

from typing import NamedTuple

from jaxtyping import Bool, Float, Int

from adapt.backtracking import accepted_or_shorter, good_enough, until_converged
from adapt.elimination import Components, Elimination, augmented, column, largest, product, stationarity
from adapt.linalg import backward, factorised, forward
from adapt.newton import STEP_LIMIT_RAD
from adapt.posture import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from models.derivatives import chain
from models.girdle import Girdle, feet
from motions.arrays import Array, repeat, xp
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
    length: Float[Array, " lanes"]
    target: Components
    stiffness: Components
    merit: Float[Array, " lanes"]
    feet: Components
    iterations: Int[Array, " lanes"]
    converged: Bool[Array, " lanes"]


class SweptPostures(NamedTuple):
    """Where the fast path ended."""

    angles: Float[Array, " 6 lanes"]
    multipliers: Float[Array, " 3 lanes"]
    converged: Bool[Array, " lanes"]
    iterations: Int[Array, " lanes"]


def sweep_postures(
    girdle: Girdle,
    measured: Float[Array, " 6 lanes"],
    weights: Float[Array, " 6 lanes"],
    start: SweptPostures,
    iterations: int,
) -> SweptPostures:
    """At most ``iterations`` iterations on from ``start``; a lane that has converged stays where it is."""
    lane = xp.zeros_like(measured[0])
    first = _State(
        base=list(start.angles),
        multipliers=list(start.multipliers),
        step=[lane] * 6,
        change=[lane] * 3,
        length=lane + 1.0,
        target=[lane] * 3,
        stiffness=[lane] * 3,
        merit=lane + xp.inf,
        feet=feet(girdle, start.angles),
        iterations=xp.zeros_like(lane, int),
        converged=start.converged,
    )
    theta = list(girdle.adapted_mm)

    end = until_converged(_iterate, (girdle, theta, list(measured), list(weights)), first, iterations)
    # The step that a converged lane still proposes is taken too: quadratically, nothing but rounding is left then.
    last = end.converged & ~start.converged
    q = [xp.where(last, x + dx, x) for x, dx in zip(end.base, end.step, strict=True)]
    multipliers = [xp.where(last, x + dx, x) for x, dx in zip(end.multipliers, end.change, strict=True)]
    return SweptPostures(xp.stack(q), xp.stack(multipliers), end.converged, start.iterations + end.iterations)


def _iterate(girdle: Girdle, theta: Components, measured: Components, weights: Components, state: _State) -> _State:
    q = [x + state.length * dx for x, dx in zip(state.base, state.step, strict=True)]
    multipliers = [x + state.length * dx for x, dx in zip(state.multipliers, state.change, strict=True)]
    at = chain(girdle, q, theta, multipliers, state.feet)
    gap = [x - s for x, s in zip(q, measured, strict=True)]
    pull = [w * x for w, x in zip(weights, gap, strict=True)]
    J = 0.5 * product(pull, gap)
    good = good_enough(state, J + augmented(state.target, state.stiffness, at.g))
    postures = Elimination(at, weights, pull, [], 0)
    step, target = postures.moved([])
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
    theta = list(girdle.adapted_mm)
    lane = xp.zeros_like(start[0])

    def closer(carry):
        q, feet = carry
        at = chain(girdle, q, theta, [lane] * 3, feet)
        S, inverse, _ = factorised([[product(at.G[i], at.G[j]) for j in range(i + 1)] for i in range(3)], lane)
        lift = backward(S, [x * d for x, d in zip(forward(S, at.g), inverse, strict=True)])
        step = [-product(column(at.G, k), lift) for k in range(6)]
        limit = xp.minimum(1.0, STEP_LIMIT_RAD / largest(step))
        return [x + limit * dx for x, dx in zip(q, step, strict=True)], at.feet

    q, _ = repeat(_CLOSING_STEPS, closer, (list(start), [lane] * 2))
    return xp.stack(q)
