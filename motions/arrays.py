"""One text for every engine: run at once on numpy's arrays, compiled by JAX, or written down by a compiler's values.

The arguments decide which: each brings its namespace of functions through ``__array_namespace__`` (Python array API
standard). A namespace that is neither numpy's nor JAX's brings its own ``repeat_while`` and ``repeat`` too.
"""

from collections.abc import Callable, Iterable
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Array = Any
"""numpy's or JAX's: what comes in goes out. A type checker cannot follow which, so it is told nothing."""


Value = TypeVar("Value")


def is_jax(x: Any) -> bool:
    """Tell whether an array is JAX's (or traced), or one in a list of arrays is."""
    return _namespace((x,)) is jnp


_AT_ONCE = {np.ndarray, np.float64, np.bool_, float, int, bool, str, type, type(None)}
"""Types of what numpy computes with, and of options: what there is most of, told quickly."""


def _namespace(values: Iterable[Any]) -> Any:
    """Return the namespace of the first value that has another than numpy's, else numpy; look into lists and tuples."""
    for x in values:
        if type(x) in _AT_ONCE:
            continue
        if isinstance(x, (list, tuple)):
            namespace = _namespace(x)
        elif hasattr(x, "__array_namespace__"):
            namespace = x.__array_namespace__()
        else:
            continue
        if namespace is not np:
            return namespace
    return np


class ByType(NamedTuple, Generic[Value]):
    """What depends on the type of number: a tolerance for float64, another for float32, whose rounding is 5e8 times as
    large."""

    float64: Value
    float32: Value

    def for_dtype_of(self, array: Array) -> Value:
        """Return the value for the type of the array's numbers."""
        return self.float32 if array.dtype == np.float32 else self.float64


class _Dispatched:
    """``xp.f`` is ``f`` of the arguments' namespace: ``numpy.f``, or ``jax.numpy.f`` where an argument is JAX's."""

    def __getattr__(self, name: str) -> Any:
        at_once = getattr(np, name)
        if not callable(at_once):
            return at_once  # a number, such as inf

        def call(*arguments: Any, **options: Any) -> Any:
            namespace = _namespace(arguments)
            return (at_once if namespace is np else getattr(namespace, name))(*arguments, **options)

        setattr(self, name, call)
        return call


xp: Any = _Dispatched()


def repeat_while(unfinished: Callable[[Any], Any], advance: Callable[[Any], Any], state: Any) -> Any:
    """Advance the state as long as it is unfinished: ``jax.lax.while_loop``, at once on numpy's arrays."""
    namespace = _namespace(jax.tree.leaves(state))
    if namespace is jnp:
        return jax.lax.while_loop(unfinished, advance, state)
    if namespace is not np:
        return namespace.repeat_while(unfinished, advance, state)
    while unfinished(state):
        state = advance(state)
    return state


def repeat(times: int, advance: Callable[[Any], Any], state: Any) -> Any:
    """Advance the state so many times: ``jax.lax.fori_loop``, at once on numpy's arrays."""
    namespace = _namespace(jax.tree.leaves(state))
    if namespace is jnp:
        return jax.lax.fori_loop(0, times, lambda _, x: advance(x), state)
    if namespace is not np:
        return namespace.repeat(times, advance, state)
    for _ in range(times):
        state = advance(state)
    return state
