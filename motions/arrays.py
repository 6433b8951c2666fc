"""One text, three engines: at once on numpy's arrays, compiled by JAX, or as machine code (``adapt.engine.llvm``).

What is done along an axis before the lanes (postures of a subject, points of a thorax) is said of one place, with
``along``: on arrays of all places at once, in machine code in a loop.
"""

from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from adapt.engine.llvm import Lane, Loop, Row

Array = Any
"""numpy's or JAX's: what comes in goes out. A type checker cannot follow which, so it is told nothing."""


Value = TypeVar("Value")


def is_jax(x: Any) -> bool:
    """Whether an array is JAX's (or traced), or one in a list of arrays is."""
    if type(x) in _NOT_JAX:
        return False
    return any(map(is_jax, x)) if isinstance(x, (list, tuple)) else isinstance(x, jax.Array)


_NOT_JAX = {np.ndarray, np.float64, np.bool_, float, int, bool, str, type(None)}  # what there is most of, quickly


class ByType(NamedTuple, Generic[Value]):
    """What depends on the type of number: a tolerance for float64, another for float32, whose rounding is 5e8 times as
    large."""

    float64: Value
    float32: Value

    def of(self, like: Any) -> Value:
        """That of the type of ``like``."""
        return self.float32 if like.dtype == np.float32 else self.float64


class _Either:
    """``xp.f`` is ``jax.numpy.f`` where an argument is JAX's, else ``numpy.f``."""

    def __getattr__(self, name: str) -> Any:
        at_once = getattr(np, name)
        if not callable(at_once):
            return at_once  # a number, such as inf
        traced = getattr(jnp, name)

        def call(*arguments: Any, **options: Any) -> Any:
            for x in arguments:
                if type(x) is Lane:
                    return getattr(x.code, name)(*arguments, **options)
                if type(x) is not np.ndarray and is_jax(x):
                    return traced(*arguments, **options)
            return at_once(*arguments, **options)

        setattr(self, name, call)
        return call


xp: Any = _Either()


def repeat_while(unfinished: Callable[[Any], Any], advance: Callable[[Any], Any], state: Any) -> Any:
    """``jax.lax.while_loop``, at once on numpy's arrays; of ``Lane``s each goes on for itself."""
    leaves = jax.tree.leaves(state)
    if code := _code_of(leaves):
        return code.repeat_while(unfinished, advance, state)
    if is_jax(leaves):
        return jax.lax.while_loop(unfinished, advance, state)
    while unfinished(state):
        state = advance(state)
    return state


def repeat(times: int, advance: Callable[[Any], Any], state: Any) -> Any:
    """So many times in a row: ``jax.lax.fori_loop``, at once on numpy's arrays."""
    leaves = jax.tree.leaves(state)
    if code := _code_of(leaves):
        return code.repeat(times, advance, state)
    if is_jax(leaves):
        return jax.lax.fori_loop(0, times, lambda _, x: advance(x), state)
    for _ in range(times):
        state = advance(state)
    return state


def for_each(function: Callable[..., Any], *arrays: Any, like: Any) -> Any:
    """The function along the first axis of the arrays: ``jax.vmap``, at once where ``like`` is numpy's."""
    if is_jax(like):
        return jax.vmap(function)(*map(jnp.asarray, arrays))
    return jax.tree.map(lambda *x: np.stack(x), *map(function, *arrays))


def _code_of(leaves: list[Any]) -> Any:
    """Where their arithmetic is written to, if some are ``Lane``s."""
    return next((x.code for x in leaves if type(x) is Lane), None)


class Whole:
    """All places of an axis at once, which is the first one of each array."""

    def __init__(self, counted: Array | None):
        self._counted = counted

    def reduced(self, function: Callable[..., tuple[Any, Any, Any]], *trees: Any) -> tuple[Any, Any, Any]:
        """The function gives, of one place in each of the trees: what is summed over the places that count; that of
        which the largest is wanted (0 if none counts); and what is kept of each."""
        sums, worst, kept = function(*trees)
        total = jax.tree.map(lambda x: xp.sum(self._of_counted(x), axis=0), sums)
        return total, jax.tree.map(lambda x: xp.max(self._of_counted(x), axis=0, initial=0.0), worst), kept

    def advanced(self, taken: Array, function: Callable[..., tuple[Any, Any, Any]], old: Any, *trees: Any):
        """The same; in the ``taken`` lanes what is kept takes the place of ``old``, the function's first tree."""
        sums, worst, kept = self.reduced(function, old, *trees)
        return sums, worst, jax.tree.map(lambda new, before: xp.where(taken, new, before), kept, old)

    def _of_counted(self, x: Array) -> Array:
        return x if self._counted is None else xp.where(self._counted, x, 0.0)


def along(like: Any, counted: Any = None) -> Any:
    """Over the places of an axis, those of ``like``; ``counted`` (truths) says which have a part in sums."""
    return Loop(like, counted) if isinstance(like, Row) else Whole(counted)


def stacked(components: Any) -> Any:
    """Components as one array, where they are arrays; anything else as it is."""
    if not isinstance(components, (list, tuple)) or type(components[0]) in (Lane, Row):
        return components
    return xp.stack(components)
