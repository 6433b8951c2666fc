"""A batch of problems: a long one in chunks of one shape, in cache on a CPU, on every device that JAX sees, a thread
each; a short one at once by numpy, before a compiled program would have been loaded.

Problems are independent, so the outcome does not depend on the chunks. Every chunk is padded with copies of its last
problem to one size, so that one program serves every batch.
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
"""XLA may emit code without its fusion emitters: later versions have no other, and refuse the option's name."""

_UNFUSED = {"xla_disable_hlo_passes": "fusion", "xla_cpu_use_fusion_emitters": True} if _HAS_OLD_EMITTERS else {}
"""Compiler option for the streams of elementwise operations. JAX 0.10's fusion computes a shared value anew in each of
its uses: measured on one such program, 23 times the operations, 4 times the run time and 6 times the compilation. The
emitters are XLA's default; where ``XLA_FLAGS`` turns them off, such a program compiles for minutes. JAX 0.12 does so
where it may not fuse: measured on posture fits more than 60 s of CPU time, fused 13 s; 512 postures then take 0.34 s,
in JAX 0.10 unfused 0.51 s."""

QUICK_TO_COMPILE = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    **({"xla_cpu_use_fusion_emitters": False} if _HAS_OLD_EMITTERS else {}),
}
"""Compiler options for a large program that is run a few times, as exact. Measured on the reference posture fit with an
effect, 64 postures: compiled in 6 s instead of 17, in two thirds of the memory; 0.37 ms a posture instead of 0.13."""


def compiled(function: Callable[..., Any], on_cpu: dict[str, Any] = _UNFUSED) -> Callable[..., Any]:
    """Compile by ``jax.jit``, with options on a CPU, where a kernel launch costs less than what fusion repeats."""

    @cache
    def program() -> Callable[..., Any]:  # not before the first call: asking for the backend starts it
        return jax.jit(function, compiler_options=on_cpu if jax.default_backend() == "cpu" else None)

    return wraps(function)(lambda *arguments: program()(*arguments))


def in_chunks(function: Callable[..., Any], size: int, *trees: Any, at_once: int = 0) -> Any:
    """Run ``function(*trees)`` over the last axis of every array, in chunks of ``size`` problems.

    The results are numpy's arrays, to be written to.

    Up to ``at_once`` problems the function (``compiled``) runs on numpy's arrays as it is written.
    """
    trees = jax.tree.map(np.asarray, trees)
    problems = jax.tree.leaves(trees)[0].shape[-1]
    if problems <= at_once:
        with np.errstate(all="ignore"):  # a problem that fails is NaN, and found out
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
    """Tell on how many cores this process works: all of the machine, unless it is one of several."""
    return _most_cores


def use_cores(number: int) -> None:
    """Let this process work on so many cores, because others share the machine with it."""
    global _most_cores
    _most_cores = number


def _workers(devices: list[Any]) -> int:
    """Count threads: two chunks a device in flight hide the transfers; a CPU is one device with several cores."""
    if devices[0].platform == "cpu":
        return max(len(devices), cores())
    return 2 * len(devices)


def in_rounds(
    function: Callable[..., Any], rounds: Sequence[int], fixed: tuple[Any, ...], names: Sequence[str], *start: Any
) -> Any:
    """Run ``function(*fixed, (*start, converged), iterations)``, again on the problems not yet ``converged``.

    ``rounds`` are the most iterations of each. A round starts with these fields of the result of the one before
    (``names``); a problem that has converged stays where it is, and its ``iterations`` add up.
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
    """Run ``function`` on these problems of ``given`` alone, and put what it finds into their places in ``found``.

    ``which``: a truth a problem. ``put``: another way to put it there than to replace what was.
    """
    left = np.flatnonzero(which)
    if len(left):
        (put or put_problems)(found, left, function(*take_problems(given, left)))
    return found


def as_type(tree: Any, dtype: DTypeLike) -> Any:
    """Convert the numbers of every array to this type; leave truths, counts, and an array that has it already."""

    def cast(x: Any) -> Any:
        x = np.asarray(x)
        return x.astype(dtype, copy=False) if x.dtype.kind == "f" else x

    return jax.tree.map(cast, tree)


def take_problems(tree: Any, index: Any) -> Any:
    """Take some problems of every array: ``index`` holds their numbers, says which they are, or is a slice."""
    if isinstance(index, slice):
        return jax.tree.map(lambda x: np.asarray(x)[..., index], tree)
    index = np.flatnonzero(index) if np.asarray(index).dtype == bool else index
    return jax.tree.map(lambda x: np.asarray(x).take(index, axis=-1), tree)


def put_problems(tree: Any, index: Any, values: Any) -> None:
    """Replace some problems of every array of a tree by those of ``values``, in place."""
    for whole, some in zip(jax.tree.leaves(tree), jax.tree.leaves(values), strict=True):
        whole[..., index] = some


def where_problems(chosen: Any, new: Any, old: Any) -> Any:
    """Take the chosen problems of every array of one tree, the others of another."""
    if chosen.all():
        return new
    if not chosen.any():
        return old
    return jax.tree.map(lambda one, other: one if one is other else np.where(chosen, one, other), new, old)


def with_problems(tree: Any, index: Any, values: Any) -> Any:
    """Replace some problems of every array by those of ``values``, in a copy of the tree, as numpy."""
    result = jax.tree.map(np.array, tree)
    put_problems(result, index, values)
    return result
