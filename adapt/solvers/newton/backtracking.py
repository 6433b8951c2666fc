"""The loop of both fast paths: every iteration tries a point, accepts it or comes back part of the way.

A state has ``length`` (the share of the step that is tried), ``merit`` (of the last accepted point), ``iterations`` and
``converged``, one of each a problem.
"""

from collections.abc import Callable
from typing import Any

import jax
from jaxtyping import Bool, Float

from motions.arrays import Array, ByType, repeat_while, xp

_SHORTER = 0.3
"""Factor on a step whose end was refused."""

_HARDLY = 0.05
"""Share of a step that is taken in any case."""

_ROUNDING = ByType(1e-11, 1e-5)
"""Relative error of the merit, of some thirty terms in float32: a rise below it is no rise."""


def good_enough(state: Any, merit: Float[Array, " problems"]) -> Bool[Array, " problems"]:
    """Decide whether to go on from the point tried. From NaN never.

    A step that is still refused when hardly anything is left of it goes uphill, as one may where a posture or theta is
    not at a minimum: the point is taken, and the next step is another one, with the new multipliers and a small radius.
    """
    lower = merit <= state.merit + _ROUNDING.for_dtype_of(merit) * (1.0 + abs(state.merit))
    return lower | ((state.length < _HARDLY) & (merit < xp.inf))


def accepted_or_shorter(good: Bool[Array, " problems"], accepted: Any, state: Any) -> Any:
    """Choose the next state: the accepted one, or a shorter step from where the last one was."""
    refused = state._replace(length=_SHORTER * state.length, iterations=accepted.iterations)
    return jax.tree.map(lambda yes, no: xp.where(good, yes, no), accepted, refused)


def until_converged(advance: Callable[[Any], Any], first: Any, iterations: Float[Array, " problems"]) -> Any:
    """Repeat ``advance`` of (state, what goes with it) at most ``iterations`` times.

    A problem that has converged stays where it is; what goes with the state is left alone there by ``advance`` itself.
    """

    def active(state: Any) -> Bool[Array, " problems"]:
        return ~state.converged & (state.iterations < iterations)

    def next_one(old: Any) -> Any:
        state, *rest = advance(old)
        here = active(old[0])
        return (jax.tree.map(lambda new, before: xp.where(here, new, before), state, old[0]), *rest)

    return repeat_while(lambda now: xp.any(active(now[0])), next_one, first)
