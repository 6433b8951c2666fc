"""Kernel: one function run on a batch of problems, as machine code of this processor or by XLA.

The kernel function (such as ``adapt.solvers.newton.subject.iterate``) is called once with the values of
``adapt.engine.simd_values``; LLVM compiles the resulting instructions to object code, which is cached between runs.
Threads, one per core, run it over blocks of eight problems, of sixteen in float32. The code contains no lengths, so one
compilation serves every batch. XLA compiles the same function where llvmlite is missing or fails, or where the function
uses an operation of JAX that the compiler does not know. The results then agree to rounding but take longer, on a GPU
too (docs/research/performance.md). The logger of this module says so, once per reason.
"""

import ctypes
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import jax
import numpy as np

from adapt.engine.batching import compiled, cores, in_chunks
from adapt.engine.function_builder import FunctionBuilder
from adapt.engine.machine_code import MachineCodeError, link
from adapt.engine.object_cache import object_code
from adapt.engine.simd_values import SimdValue, simd_width

_LOG = logging.getLogger(__name__)

AXES = ("postures", "points")
"""Axes that the arrays of a problem may have."""

_BLOCKS_A_TURN = 16
"""Blocks that a thread takes at a time: few enough that all threads end together, enough that taking them costs
nothing."""


_Arrays = list[np.ndarray]


class _ArraySpec:
    """Specification of one array: ``"3 postures"`` is three components of every posture; ``"bool"`` and ``"int"`` are
    element types."""

    def __init__(self, words: str):
        self.rows, self.axis, self.kind = 1, None, float
        self.has_components = False
        for word in words.split():
            if word.isdigit():
                self.rows, self.has_components = int(word), True
            elif word in AXES:
                self.axis = AXES.index(word) + 1
            else:
                self.kind = {"bool": bool, "int": int}[word]

    def dtype(self, number: type) -> type:
        """Return the type of the elements, where ``number`` is the type of floating-point numbers."""
        return np.bool_ if self.kind is bool else number

    def shape(self, sizes: Sequence[int]) -> tuple[int, ...]:
        """Return the shape for ``sizes``, the numbers of problems, postures and points."""
        axis = () if self.axis is None else (sizes[self.axis],)
        return ((self.rows,) if self.has_components else ()) + axis + (sizes[0],)


class Kernel:
    """Kernel ``function`` to be compiled; ``inputs`` (one tree per argument) and ``outputs`` are trees of words
    (``_ArraySpec``).

    All computations are in float32 where one of the given arrays is float32, else in float64.
    """

    def __init__(self, name: str, function: Callable[..., Any], inputs: tuple[Any, ...], outputs: Any, chunk: int):
        """Set up a kernel; ``chunk``: number of problems that XLA works on at a time."""
        self.name, self.function, self.inputs, self.chunk = name, function, inputs, chunk
        self._inputs = [_ArraySpec(words) for words in jax.tree.leaves(inputs)]
        words, self._result = jax.tree.flatten(outputs)
        self._outputs = [_ArraySpec(one) for one in words]
        self._program = compiled(function)
        self._functions: dict[type, tuple[Any, int]] = {}
        self._left_to_xla: set[type] = set()

    def __call__(self, *trees: Any) -> Any:
        """Run the kernel on arrays with the problems last; return numpy arrays."""
        run = self.native if self._has_machine_code(_number(trees)) else self.by_jax
        return run(*trees)

    def by_jax(self, *trees: Any) -> Any:
        """Run the kernel by XLA, on every device that JAX sees."""
        number = _number(trees)
        arrays = [
            np.asarray(x, spec.dtype(number)) for x, spec in zip(jax.tree.leaves(trees), self._inputs, strict=True)
        ]
        return in_chunks(self._program, self.chunk, *jax.tree.unflatten(jax.tree.structure(trees), arrays))

    def native(self, *trees: Any) -> Any:
        """Run the kernel by machine code, on the cores of this processor. Raises MachineCodeError."""
        number = _number(trees)
        arrays, results, sizes = self.laid_out(trees, number, at_least=simd_width(number))
        self._run([*arrays, *results], sizes, number)
        return self.result_of(results, jax.tree.leaves(trees)[0].shape[-1])

    def laid_out(self, trees: Any, number: type, at_least: int = 1) -> tuple[_Arrays, _Arrays, list[int]]:
        """Return the arrays that the compiled code reads, the arrays that it writes, and the sizes.

        Arrays of fewer than ``at_least`` problems are padded. The sizes are the numbers of problems, postures and
        points.
        """
        arrays = [
            np.ascontiguousarray(x, spec.dtype(number))
            for x, spec in zip(jax.tree.leaves(trees), self._inputs, strict=True)
        ]
        if 0 < arrays[0].shape[-1] < at_least:
            arrays = [_padded(x, at_least) for x in arrays]
        sizes = self._sizes(arrays)
        return arrays, [np.empty(spec.shape(sizes), spec.dtype(number)) for spec in self._outputs], sizes

    def result_of(self, results: _Arrays, problems: int) -> Any:
        """Return the results of the compiled code for the first ``problems`` problems, as a tree."""
        results = [
            x[..., :problems].astype(int) if spec.kind is int else x[..., :problems]
            for x, spec in zip(results, self._outputs, strict=True)
        ]
        return jax.tree.unflatten(self._result, results)

    def _sizes(self, arrays: Sequence[np.ndarray]) -> list[int]:
        """Return the numbers of problems, postures and points. Raises ValueError for an array with other numbers."""
        sizes = [arrays[0].shape[-1], 1, 1]
        for x, spec in zip(arrays, self._inputs, strict=True):
            if spec.axis is not None:
                sizes[spec.axis] = x.shape[-2]
            if x.shape != spec.shape(sizes):
                raise ValueError(f"{self.name}: an array of shape {x.shape} where {spec.shape(sizes)} is expected")
        return sizes

    def _run(self, arrays: list[np.ndarray], sizes: list[int], number: type) -> None:
        function, rows = self._compiled_function(number)
        pointers = (ctypes.c_void_p * len(arrays))(*(x.__array_interface__["data"][0] for x in arrays))
        lengths = (ctypes.c_int64 * len(sizes))(*sizes)
        blocks = -(-sizes[0] // simd_width(number))
        turns = iter(range(0, blocks, _BLOCKS_A_TURN))

        def run() -> None:
            scratch = np.empty(rows * max(sizes[1:]) * simd_width(number), number)
            for first in turns:  # each turn goes to the thread that asks first
                function(pointers, lengths, first, min(first + _BLOCKS_A_TURN, blocks), scratch.ctypes.data)

        others = min(cores(), -(-blocks // _BLOCKS_A_TURN)) - 1  # this thread works too
        waiting = [_threads().submit(run) for _ in range(others)]
        run()
        for one in waiting:
            one.result()

    def _has_machine_code(self, number: type) -> bool:
        """Check whether there is machine code for numbers of this type; try once to compile it."""
        if number not in self._functions and number not in self._left_to_xla:
            try:
                self._compiled_function(number)
            except MachineCodeError as error:
                self._left_to_xla.add(number)
                _note_fallback(str(error))
        return number in self._functions

    def _compiled_function(self, number: type) -> tuple[Any, int]:
        """Return the function, and the count of numbers that it keeps in scratch per problem and place of an axis."""
        if number not in self._functions:
            name = f"{self.name}_{number.__name__}"
            library = link(name, object_code(name, lambda: self.build(number).text()))
            function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 2, ctypes.c_void_p)
            rows = ctypes.CFUNCTYPE(ctypes.c_int64)(library[f"{name}_rows"])
            self._functions[number] = function(library[name]), rows()
        return self._functions[number]

    def build(
        self, dtype: type = np.float64, make: Callable[..., FunctionBuilder] = FunctionBuilder
    ) -> FunctionBuilder:
        """Write the instructions of the kernel."""
        builder = make(f"{self.name}_{dtype.__name__}", dtype)
        with builder.each_block():
            arguments = []
            for number, spec in enumerate(self._inputs):
                rows = builder.argument_rows(number, spec.rows, spec.axis, spec.kind is bool)
                values = rows if spec.axis is not None else [row.load("0") for row in rows]
                arguments.append(values if spec.has_components else values[0])
            results = self.function(*jax.tree.unflatten(jax.tree.structure(self.inputs), arguments))
            outputs = zip(self._outputs, self._result.flatten_up_to(results), strict=True)
            for number, (spec, result) in enumerate(outputs, len(self._inputs)):
                _write_result(builder, number, spec, result)
        return builder


def _write_result(builder: FunctionBuilder, number: int, spec: _ArraySpec, result: Any) -> None:
    """Copy a result to the caller's array ``number``."""
    values = list(result) if spec.has_components else [result]
    rows = builder.argument_rows(number, spec.rows, spec.axis, spec.kind is bool)
    length = "1" if spec.axis is None else builder.size(spec.axis)
    with builder.loop(length, "result") as index:
        for row, x in zip(rows, values, strict=True):
            row.store(index, x if isinstance(x, SimdValue) else x.load(index))


@cache
def _note_fallback(reason: str) -> None:
    """Log, once per reason, that XLA runs instead of machine code."""
    _LOG.info("no machine code here, XLA runs the fast paths, more slowly: %s", reason)


def _number(trees: Any) -> type:
    """Return the type of number to compute in."""
    return np.float32 if any(x.dtype == np.float32 for x in jax.tree.leaves(trees)) else np.float64


def _padded(x: np.ndarray, problems: int) -> np.ndarray:
    """Pad an array to a full block by repeating the last problem."""
    return x.take(np.minimum(np.arange(problems), x.shape[-1] - 1), axis=-1)


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores())
