"""Functions of lanes as machine code of this processor: a thread a core over blocks of eight lanes, of sixteen
in float32.

A kernel's text (such as ``adapt.solvers.batched.subject.sweep``) is called once with ``adapt.engine.llvm`` numbers;
LLVM makes object code of what it leaves behind, which is kept between runs. No length is in the code: one compilation
serves every batch. Where JAX sees an accelerator, JAX compiles the same text for it.
"""

import ctypes
import hashlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import jax
import numpy as np
import platformdirs

from adapt.engine.batching import compiled, in_chunks
from adapt.engine.llvm import Code, Lane, width
from motions.errors import InputError
from motions.files import atomic_write_bytes

AXES = ("postures", "points")
"""What there can be several of in a lane."""

_BLOCKS_A_TURN = 16
"""Blocks that a thread takes at a time: few enough that all end together, enough that asking for them is nothing."""

_DIGEST = hashlib.sha256


class _Leaf:
    """One array: ``"3 postures"`` is three components of every posture; ``"bool"`` and ``"int"`` say what they are."""

    def __init__(self, words: str):
        self.rows, self.axis, self.kind = 1, None, float
        self.components = False
        for word in words.split():
            if word.isdigit():
                self.rows, self.components = int(word), True
            elif word in AXES:
                self.axis = AXES.index(word) + 1
            else:
                self.kind = {"bool": bool, "int": int}[word]

    def dtype(self, number: type) -> type:
        return np.bool_ if self.kind is bool else number

    def shape(self, sizes: Sequence[int]) -> tuple[int, ...]:
        axis = () if self.axis is None else (sizes[self.axis],)
        return ((self.rows,) if self.components else ()) + axis + (sizes[0],)


class Kernel:
    """``text`` compiled. ``inputs`` (one tree an argument) and ``outputs`` are trees of words, see ``_Leaf``.

    All of it is done in float32 where one of the arrays given is of that type, else in float64.
    """

    def __init__(self, name: str, text: Callable[..., Any], inputs: tuple[Any, ...], outputs: Any, chunk: int):
        """``chunk``: lanes that JAX works on at a time."""
        self.name, self.text, self.inputs, self.chunk = name, text, inputs, chunk
        self._takes = [_Leaf(words) for words in jax.tree.leaves(inputs)]
        words, self._result = jax.tree.flatten(outputs)
        self._gives = [_Leaf(one) for one in words]
        self._program = compiled(text)
        self._functions: dict[type, tuple[Any, int]] = {}

    def __call__(self, *trees: Any) -> Any:
        """The text of these arrays, lanes last, as numpy."""
        return self.by_jax(*trees) if has_accelerator() else self.by_machine(*trees)

    def by_jax(self, *trees: Any) -> Any:
        """On every device that JAX sees."""
        number = _number(trees)
        arrays = [
            np.asarray(x, leaf.dtype(number)) for x, leaf in zip(jax.tree.leaves(trees), self._takes, strict=True)
        ]
        return in_chunks(self._program, self.chunk, *jax.tree.unflatten(jax.tree.structure(trees), arrays))

    def by_machine(self, *trees: Any) -> Any:
        """On the cores of this processor."""
        number = _number(trees)
        arrays = [
            np.ascontiguousarray(x, leaf.dtype(number))
            for x, leaf in zip(jax.tree.leaves(trees), self._takes, strict=True)
        ]
        lanes = arrays[0].shape[-1]
        if 0 < lanes < width(number):
            arrays = [_padded(x, width(number)) for x in arrays]
        sizes = [arrays[0].shape[-1], 1, 1]
        for x, leaf in zip(arrays, self._takes, strict=True):
            if leaf.axis is not None:
                sizes[leaf.axis] = x.shape[-2]
            if x.shape != leaf.shape(sizes):
                raise ValueError(f"{self.name}: an array of shape {x.shape} where {leaf.shape(sizes)} is expected")
        results = [np.empty(leaf.shape(sizes), leaf.dtype(number)) for leaf in self._gives]
        self._run([*arrays, *results], sizes, number)
        results = [
            x[..., :lanes].astype(int) if leaf.kind is int else x[..., :lanes]
            for x, leaf in zip(results, self._gives, strict=True)
        ]
        return jax.tree.unflatten(self._result, results)

    def _run(self, arrays: list[np.ndarray], sizes: list[int], number: type) -> None:
        function, rows = self._function(number)
        pointers = (ctypes.c_void_p * len(arrays))(*(x.__array_interface__["data"][0] for x in arrays))
        lengths = (ctypes.c_int64 * len(sizes))(*sizes)
        blocks = -(-sizes[0] // width(number))
        turns = iter(range(0, blocks, _BLOCKS_A_TURN))

        def run() -> None:
            scratch = np.empty(rows * max(sizes[1:]) * width(number), number)
            for first in turns:  # each goes to the thread that asks first
                function(pointers, lengths, first, min(first + _BLOCKS_A_TURN, blocks), scratch.ctypes.data)

        others = min(_cores(), -(-blocks // _BLOCKS_A_TURN)) - 1  # this thread works too
        waiting = [_threads().submit(run) for _ in range(others)]
        run()
        for one in waiting:
            one.result()

    def _function(self, number: type) -> tuple[Any, int]:
        """The function, and how many numbers a lane and posture it keeps in scratch."""
        if number not in self._functions:
            name = f"{self.name}_{number.__name__}"
            library = _linked(name, _object_code(name, lambda: self.code(number)))
            function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 2, ctypes.c_void_p)
            rows = ctypes.CFUNCTYPE(ctypes.c_int64)(library[f"{name}_rows"])
            self._functions[number] = function(library[name]), rows()
        return self._functions[number]

    def code(self, dtype: type = np.float64) -> Code:
        """The text's instructions."""
        code = Code(f"{self.name}_{dtype.__name__}", dtype)
        with code.blocks():
            arguments = []
            for number, leaf in enumerate(self._takes):
                rows = code.argument(number, leaf.rows, leaf.axis, leaf.kind is bool)
                values = rows if leaf.axis is not None else [row.load("0") for row in rows]
                arguments.append(values if leaf.components else values[0])
            given = self.text(*jax.tree.unflatten(jax.tree.structure(self.inputs), arguments))
            for number, (leaf, value) in enumerate(zip(self._gives, self._result.flatten_up_to(given), strict=True)):
                values = list(value) if leaf.components else [value]
                rows = code.argument(len(self._takes) + number, leaf.rows, leaf.axis, leaf.kind is bool)
                size = "1" if leaf.axis is None else code.size(leaf.axis)
                with code.loop(size, "result") as index:
                    for row, x in zip(rows, values, strict=True):
                        row.store(index, x if isinstance(x, Lane) else x.load(index))
        return code


def _number(trees: Any) -> type:
    """The type of number to work in."""
    return np.float32 if any(x.dtype == np.float32 for x in jax.tree.leaves(trees)) else np.float64


def _padded(x: np.ndarray, lanes: int) -> np.ndarray:
    """A block full of lanes: the last one again and again."""
    return x.take(np.minimum(np.arange(lanes), x.shape[-1] - 1), axis=-1)


@cache
def has_accelerator() -> bool:
    """Whether JAX sees something better than a CPU."""
    return jax.default_backend() != "cpu"


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_cores())


@cache
def _cores() -> int:
    return os.cpu_count() or 1


# --- compiling, once


def _object_code(name: str, code: Callable[[], Code]) -> bytes:
    """From the user's cache folder, or compiled and put there. A file that is not as it was written is not used."""
    path = Path(platformdirs.user_cache_path("girdle")) / "machine" / f"{name}-{_key()}"
    with suppress(OSError):
        content = path.read_bytes()
        digest, made = content[: _DIGEST().digest_size], content[_DIGEST().digest_size :]
        if _DIGEST(made).digest() == digest:
            return made
    made = compiled_text(code().text())
    with suppress(OSError, InputError):  # a folder that cannot be written to costs the next run this compilation
        path.parent.mkdir(parents=True, exist_ok=True)
        atomic_write_bytes(path, _DIGEST(made).digest() + made)
    return made


@cache
def _key() -> str:
    """One word for all that the code depends on: the project's text, the compiler, the processor."""
    import llvmlite
    import llvmlite.binding as llvm

    platform = f"{llvmlite.__version__} {llvm.get_host_cpu_name()} {_features()}"
    return _DIGEST(platform.encode() + source_digest(_ROOT)).hexdigest()[:32]


_ROOT = Path(__file__).parents[2]

_PACKAGES = ("motions", "models", "adapt")


def source_digest(root: Path) -> bytes:
    """Hash the names and the text of every Python file of the packages below a folder, at any depth."""
    digest = _DIGEST()
    for package in _PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            text = file.read_bytes()
            digest.update(f"{file.relative_to(root).as_posix()} {len(text)}\n".encode() + text)
    return digest.digest()


def _features() -> str:
    import llvmlite.binding as llvm

    return llvm.get_host_cpu_features().flatten()


@cache
def _machine() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=_features(), opt=2, jit=True)


def compiled_text(text: str) -> bytes:
    """Object code for this processor."""
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(text)
    module.verify()
    return _machine().emit_object(module)


@cache
def _jit() -> Any:
    import llvmlite.binding as llvm

    return llvm.create_lljit_compiler(_machine())


_LINKED: list[Any] = []
"""Kept to the end of the process: functions may be running in threads, and LLVM cannot give one of them back alone."""


def _linked(name: str, made: bytes) -> Any:
    import llvmlite.binding as llvm

    builder = llvm.JITLibraryBuilder().add_object_img(made).add_current_process()
    exported = builder.export_symbol(name).export_symbol(f"{name}_rows")
    _LINKED.append(exported.link(_jit(), f"{name}{len(_LINKED)}"))
    return _LINKED[-1]
