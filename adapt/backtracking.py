"""The loop of both fast paths: every iteration tries a point, accepts it or comes back part of the way.

A state has ``length`` (the share of the step that is tried), ``merit`` (of the last accepted point), ``iterations`` and
``converged``, one of each a lane.
"""

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.chunks import lanes_of, with_lanes
from motions.arrays import Array, is_jax, xp

_SHORTER = 0.3
"""Factor on a step whose end was refused."""

_ROUNDING = 1e-11
"""Relative error of the merit: a rise below it is no rise."""


class Tried(Protocol):
    """What every state has; a NamedTuple."""

    @property
    def length(self) -> Float[Array, " lanes"]: ...
    @property
    def merit(self) -> Float[Array, " lanes"]: ...
    @property
    def iterations(self) -> Int[Array, " lanes"]: ...
    @property
    def converged(self) -> Bool[Array, " lanes"]: ...
    def _replace(self, **changes: Any) -> Any: ...


State = TypeVar("State", bound=Tried)


def good_enough(state: Tried, merit: Float[Array, " lanes"]) -> Bool[Array, " lanes"]:
    """Whether the point tried may be gone on from. NaN may not."""
    return merit <= state.merit + _ROUNDING * (1.0 + abs(state.merit))


def accepted_or_shorter(good: Bool[Array, " lanes"], accepted: State, state: State) -> State:
    """The next state: the accepted one, or a shorter step from where the last one was."""
    refused = state._replace(length=_SHORTER * state.length, iterations=accepted.iterations)
    return jax.tree.map(lambda yes, no: xp.where(good, yes, no), accepted, refused)


def until_converged(iterate: Callable[..., State], fixed: tuple[Any, ...], first: State, iterations: int) -> State:
    """``iterate(*fixed, state)`` at most so many times; a lane that has converged stays where it is."""
    if not is_jax(first.length):
        return _of_the_unfinished(iterate, fixed, first, iterations)

    def advance(state: State) -> State:
        return jax.tree.map(lambda old, new: xp.where(state.converged, old, new), state, iterate(*fixed, state))

    def unfinished(state: State) -> Bool[Array, ""]:
        return xp.any(~state.converged & (state.iterations < iterations))

    return jax.lax.while_loop(unfinished, advance, first)


def _of_the_unfinished(iterate, fixed, first: State, iterations: int) -> State:
    """On numpy's arrays: who has converged costs nothing any more."""
    whole, state, active = first, first, np.arange(first.length.shape[-1])
    for number in range(iterations + 1):
        done = state.converged
        if number == iterations or done.all():
            break
        if done.any():
            whole = with_lanes(whole, active, state)
            active, fixed, state = active[~done], lanes_of(fixed, ~done), lanes_of(state, ~done)
        state = iterate(*fixed, state)
    return with_lanes(whole, active, state)
