"""Array functions for one source text that numpy runs, JAX compiles, or the project's own compiler translates.

The arguments decide: each provides its namespace of functions through ``__array_namespace__`` (Python array API
standard). A namespace other than numpy's and JAX's also provides its own ``repeat_while`` and ``repeat``.
"""

from collections.abc import Callable, Iterable
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Array = Any
"""Array of numpy or JAX; functions return the kind that they get, which type checkers cannot follow."""


Value = TypeVar("Value")


def is_jax(x: Any) -> bool:
    """Check whether an array, or any array in a list, is a JAX array (also a traced one)."""
    return _namespace((x,)) is jnp


_EAGER = {np.ndarray, np.float64, np.bool_, float, int, bool, str, type, type(None)}
"""Types that need no look-up of a namespace, numpy's and those of options: the most frequent arguments."""


def _namespace(values: Iterable[Any]) -> Any:
    """Return the first namespace that is not numpy's, searching lists and tuples too; numpy if there is none."""
    for x in values:
        if type(x) in _EAGER:
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


def batch_text(one: str, array: Any) -> str:
    """Write the batch of an array with one number of each of its members: 'one girdle', '10 x 3 girdles'.

    Only its shape counts, if it has one: ``jit`` and ``tree_map`` put tracers and objects of any kind in its place.
    """
    shape = getattr(array, "shape", ())
    return f"{' x '.join(map(str, shape))} {one}s" if shape else f"one {one}"


class ByType(NamedTuple, Generic[Value]):
    """Value that depends on the number type, such as a tolerance: float32 rounds 5e8 times as coarsely as float64."""

    float64: Value
    float32: Value

    def for_dtype_of(self, array: Array) -> Value:
        """Return the value for the dtype of the array."""
        return self.float32 if array.dtype == np.float32 else self.float64


class _Dispatched:
    """Namespace ``xp``: ``xp.f`` is ``f`` of the arguments' namespace, such as ``numpy.f`` or ``jax.numpy.f``."""

    def __getattr__(self, name: str) -> Any:
        eager = getattr(np, name)
        if not callable(eager):
            return eager  # a constant, such as inf

        def call(*arguments: Any, **options: Any) -> Any:
            namespace = _namespace(arguments)
            return (eager if namespace is np else getattr(namespace, name))(*arguments, **options)

        setattr(self, name, call)
        return call


xp: Any = _Dispatched()


def repeat_while(unfinished: Callable[[Any], Any], advance: Callable[[Any], Any], state: Any) -> Any:
    """Advance the state while ``unfinished`` holds: ``jax.lax.while_loop``, or a Python loop for numpy arrays."""
    namespace = _namespace(jax.tree.leaves(state))
    if namespace is jnp:
        return jax.lax.while_loop(unfinished, advance, state)
    if namespace is not np:
        return namespace.repeat_while(unfinished, advance, state)
    while unfinished(state):
        state = advance(state)
    return state


def repeat(times: int, advance: Callable[[Any], Any], state: Any) -> Any:
    """Advance the state ``times`` times: ``jax.lax.fori_loop``, or a Python loop for numpy arrays."""
    namespace = _namespace(jax.tree.leaves(state))
    if namespace is jnp:
        return jax.lax.fori_loop(0, times, lambda _, x: advance(x), state)
    if namespace is not np:
        return namespace.repeat(times, advance, state)
    for _ in range(times):
        state = advance(state)
    return state
