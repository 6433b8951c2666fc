"""Iteration loop of both Newton solvers: every iteration tries a point, accepts it or goes part of the way back.

A state has ``length`` (the share of the step that is tried), ``merit`` (of the last accepted point), ``iterations`` and
``converged``, one of each per problem.
"""

from collections.abc import Callable
from typing import Any

import jax
from jaxtyping import Bool, Float

from motions.arrays import Array, ByType, repeat_while, xp

_SHORTER = 0.3
"""Factor on a step whose end point was rejected."""

_HARDLY = 0.05
"""Share of a step below which its end point is accepted in any case."""

_ROUNDING = ByType(1e-11, 1e-5)
"""Relative error of the merit, of some thirty terms in float32: a smaller rise counts as no rise."""


def good_enough(state: Any, merit: Float[Array, " problems"]) -> Bool[Array, " problems"]:
    """Return where the tried point is accepted; never where its merit is NaN.

    A step that is still rejected at a share below ``_HARDLY`` goes uphill. Such steps occur where a posture or theta is
    not at a minimum: the point is accepted, and the next step differs, with the new multipliers and a small radius.
    """
    lower = merit <= state.merit + _ROUNDING.for_dtype_of(merit) * (1.0 + abs(state.merit))
    return lower | ((state.length < _HARDLY) & (merit < xp.inf))


def accepted_or_shorter(good: Bool[Array, " problems"], accepted: Any, state: Any) -> Any:
    """Choose the next state: the accepted state, or a shorter step from the last accepted point."""
    refused = state._replace(length=_SHORTER * state.length, iterations=accepted.iterations)
    return jax.tree.map(lambda yes, no: xp.where(good, yes, no), accepted, refused)


def until_converged(advance: Callable[[Any], Any], first: Any, iterations: Float[Array, " problems"]) -> Any:
    """Repeat ``advance`` of (state, further data) at most ``iterations`` times.

    A problem that has converged keeps its state; ``advance`` itself leaves its further data unchanged.
    """

    def active(state: Any) -> Bool[Array, " problems"]:
        return ~state.converged & (state.iterations < iterations)

    def next_one(old: Any) -> Any:
        state, *rest = advance(old)
        here = active(old[0])
        return (jax.tree.map(lambda new, before: xp.where(here, new, before), state, old[0]), *rest)

    return repeat_while(lambda now: xp.any(active(now[0])), next_one, first)
