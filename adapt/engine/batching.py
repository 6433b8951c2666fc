"""Batches of problems: a long batch runs in chunks of one shape, a short one directly by numpy.

The chunks fit into the cache of a CPU and run in threads of their own, on every device that JAX sees. Numpy finishes a
short batch before a compiled program would have been loaded. Problems are independent, so the results do not depend on
the chunks. Every chunk is padded with copies of its last problem to one size, so that one program serves every batch.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial, wraps
from inspect import unwrap
from typing import Any

import jax
import numpy as np
from numpy.typing import DTypeLike

_HAS_OLD_EMITTERS = jax.__version_info__ < (0, 11)
"""True where XLA can emit code without its fusion emitters. Later versions have no others, and refuse the option's
name."""

_UNFUSED = {"xla_disable_hlo_passes": "fusion", "xla_cpu_use_fusion_emitters": True} if _HAS_OLD_EMITTERS else {}
"""Compiler options for streams of elementwise operations. The fusion of JAX 0.10 computes a shared value anew for each
of its uses: measured on one such program, 23 times the operations, 4 times the run time and 6 times the compilation.
The fusion emitters are XLA's default; where ``XLA_FLAGS`` turns them off, such a program compiles for minutes. JAX 0.12
also compiles that long without fusion: measured on posture fits, more than 60 s of CPU time, with fusion 13 s; 512
postures take 0.34 s with fusion, in JAX 0.10 without fusion 0.51 s."""

QUICK_TO_COMPILE = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    **({"xla_cpu_use_fusion_emitters": False} if _HAS_OLD_EMITTERS else {}),
}
"""Compiler options for a large program that runs only a few times; the results are as exact. Measured on the reference
posture fit with an effect, 64 postures: 6 s of compilation instead of 17, in two thirds of the memory; 0.37 ms per
posture instead of 0.13."""


def compiled(function: Callable[..., Any], on_cpu: dict[str, Any] = _UNFUSED) -> Callable[..., Any]:
    """Compile ``function`` by ``jax.jit``, on a CPU with the options ``on_cpu``: a kernel launch there costs less than
    the operations that fusion repeats."""

    @cache
    def program() -> Callable[..., Any]:  # delayed to the first call: asking for the backend starts it
        return jax.jit(function, compiler_options=on_cpu if jax.default_backend() == "cpu" else None)

    return wraps(function)(lambda *arguments: program()(*arguments))


def in_chunks(function: Callable[..., Any], size: int, *trees: Any, eager: int = 0) -> Any:
    """Run ``function(*trees)`` over the last axis of every array, in chunks of ``size`` problems.

    The results are numpy arrays that the caller may write to. With at most ``eager`` problems, ``function`` (made by
    ``compiled``) runs uncompiled on numpy arrays.
    """
    trees = jax.tree.map(np.asarray, trees)
    problems = jax.tree.leaves(trees)[0].shape[-1]
    if problems <= eager:
        with np.errstate(all="ignore"):  # a failed problem gives NaN, which callers detect
            return jax.tree.map(np.array, unwrap(function)(*trees))
    devices = jax.local_devices()
    starts = range(0, problems, size)

    def run(number: int) -> Any:
        first = starts[number]
        count = min(size, problems - first)
        index = first + np.minimum(np.arange(size), count - 1)
        part = jax.tree.map(lambda x: x[..., index], trees)
        device = devices[number % len(devices)]
        result = function(*jax.device_put(part, device))
        return jax.tree.map(lambda x: np.array(x[..., :count]), result)

    if len(starts) == 1:
        return run(0)
    with ThreadPoolExecutor(_workers(devices)) as pool:
        parts = list(pool.map(run, range(len(starts))))
    return jax.tree.map(lambda *x: np.concatenate(x, axis=-1), *parts)


_most_cores = os.cpu_count() or 1


def cores() -> int:
    """Return the number of cores for this process: all cores of the machine, unless it is one of several processes."""
    return _most_cores


def use_cores(number: int) -> None:
    """Limit this process to ``number`` cores, because other processes share the machine."""
    global _most_cores
    _most_cores = number


def _workers(devices: list[Any]) -> int:
    """Return the number of threads: two chunks per device in flight hide the transfers; a CPU is one device with
    several cores."""
    if devices[0].platform == "cpu":
        return max(len(devices), cores())
    return 2 * len(devices)


def in_rounds(
    function: Callable[..., Any], rounds: Sequence[int], fixed: tuple[Any, ...], names: Sequence[str], *start: Any
) -> Any:
    """Run ``function(*fixed, (*start, converged), iterations)``, then again on the problems that have not converged.

    ``rounds``: the maximum number of iterations of each round. A round starts from the fields ``names`` of the previous
    round's result. A converged problem keeps its result; ``iterations`` are summed over the rounds.
    """

    def done(fixed: tuple[Any, ...], start: Sequence[Any], iterations: int) -> Any:
        problems = start[0].shape[-1]
        return function(*fixed, (*start, np.zeros(problems, bool)), np.full(problems, float(iterations)))

    def go_on(fixed: tuple[Any, ...], before: Any, *, iterations: int) -> Any:
        found = done(fixed, [getattr(before, name) for name in names], iterations)
        return found._replace(iterations=before.iterations + found.iterations)

    result = done(fixed, start, rounds[0])
    for iterations in rounds[1:]:
        refit(result, ~result.converged, partial(go_on, iterations=iterations), fixed, result)
    return result


def refit(
    found: Any, which: Any, function: Callable[..., Any], *given: Any, put: Callable[..., None] | None = None
) -> Any:
    """Run ``function`` on some problems of ``given`` only, and write the results to their places in ``found``.

    ``which``: mask, one entry per problem. ``put``: function that writes the results; by default they replace the
    previous values (``put_problems``).
    """
    left = np.flatnonzero(which)
    if len(left):
        (put or put_problems)(found, left, function(*take_problems(given, left)))
    return found


def as_type(tree: Any, dtype: DTypeLike) -> Any:
    """Convert the floating-point arrays of a tree to ``dtype``. Masks, integers and arrays of this type already stay as
    they are."""

    def cast(x: Any) -> Any:
        x = np.asarray(x)
        return x.astype(dtype, copy=False) if x.dtype.kind == "f" else x

    return jax.tree.map(cast, tree)


def take_problems(tree: Any, index: Any) -> Any:
    """Take some problems of every array: ``index`` holds their numbers, is a mask, or is a slice."""
    if isinstance(index, slice):
        return jax.tree.map(lambda x: np.asarray(x)[..., index], tree)
    index = np.flatnonzero(index) if np.asarray(index).dtype == bool else index
    return jax.tree.map(lambda x: np.asarray(x).take(index, axis=-1), tree)


def put_problems(tree: Any, index: Any, values: Any) -> None:
    """Replace the problems ``index`` of every array of a tree by ``values``, in place."""
    for whole, some in zip(jax.tree.leaves(tree), jax.tree.leaves(values), strict=True):
        whole[..., index] = some


def where_problems(chosen: Any, new: Any, old: Any) -> Any:
    """Take the problems ``chosen`` (a mask) of every array from ``new``, and the others from ``old``."""
    if chosen.all():
        return new
    if not chosen.any():
        return old
    return jax.tree.map(lambda one, other: one if one is other else np.where(chosen, one, other), new, old)


def with_problems(tree: Any, index: Any, values: Any) -> Any:
    """Return a copy of the tree, as numpy arrays, in which ``values`` replace the problems ``index``."""
    result = jax.tree.map(np.array, tree)
    put_problems(result, index, values)
    return result
