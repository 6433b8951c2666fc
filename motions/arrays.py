"""One text for numpy and JAX: at once on numpy's arrays where there is little to do, compiled where there is much.

A compiled program takes seconds to load, even from the cache; a few hundred lanes take numpy less than that.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

Array = Any
"""numpy's or JAX's: what comes in goes out. A type checker cannot follow which, so it is told nothing."""


def is_jax(x: Any) -> bool:
    """Whether an array is JAX's (or traced), or one in a list of arrays is."""
    if type(x) in _NOT_JAX:
        return False
    return any(map(is_jax, x)) if isinstance(x, (list, tuple)) else isinstance(x, jax.Array)


_NOT_JAX = {np.ndarray, np.float64, np.bool_, float, int, bool, str, type(None)}  # what there is most of, quickly


class _Either:
    """``xp.f`` is ``jax.numpy.f`` where an argument is JAX's, else ``numpy.f``."""

    def __getattr__(self, name: str) -> Any:
        at_once = getattr(np, name)
        if not callable(at_once):
            return at_once  # a number, such as inf
        traced = getattr(jnp, name)

        def call(*arguments: Any, **options: Any) -> Any:
            for x in arguments:
                if type(x) is not np.ndarray and is_jax(x):
                    return traced(*arguments, **options)
            return at_once(*arguments, **options)

        setattr(self, name, call)
        return call


xp: Any = _Either()


def repeat_while(unfinished: Callable[[Any], Any], advance: Callable[[Any], Any], state: Any) -> Any:
    """``jax.lax.while_loop``, at once on numpy's arrays."""
    if is_jax(jax.tree.leaves(state)):
        return jax.lax.while_loop(unfinished, advance, state)
    while unfinished(state):
        state = advance(state)
    return state


def repeat(times: int, advance: Callable[[Any], Any], state: Any) -> Any:
    """So many times in a row: ``jax.lax.fori_loop``, at once on numpy's arrays."""
    if is_jax(jax.tree.leaves(state)):
        return jax.lax.fori_loop(0, times, lambda _, x: advance(x), state)
    for _ in range(times):
        state = advance(state)
    return state


def for_each(function: Callable[..., Any], *arrays: Any, like: Any) -> Any:
    """The function along the first axis of the arrays: ``jax.vmap``, at once where ``like`` is numpy's."""
    if is_jax(like):
        return jax.vmap(function)(*map(jnp.asarray, arrays))
    return jax.tree.map(lambda *x: np.stack(x), *map(function, *arrays))
