"""Run a kernel's text on an NVIDIA GPU: LLVM compiles it to PTX, and the driver compiles PTX to the GPU's machine code.

A thread works on one problem at a time, then on the problem as many places further as there are threads. The scratch
rows of all threads are interleaved, so that the threads of a warp read contiguous memory. Only the driver is needed, by
its C interface (https://docs.nvidia.com/cuda/cuda-driver-api/).
"""

import ctypes
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import jax
import numpy as np
from numpy.typing import DTypeLike

from adapt.engine.function_builder import FunctionBuilder
from adapt.engine.kernel import Kernel

_TARGET = "nvptx64-nvidia-cuda"

_ARCHITECTURE, _PTX_VERSION = "sm_70", "+ptx63"
"""Volta of 2017 and CUDA 10, which every later GPU and driver accepts."""

_THREADS_A_BLOCK = 128

_BLOCKS_A_MULTIPROCESSOR = 2
"""The kernel uses all 255 registers that a thread can have: a multiprocessor has enough for 256 threads."""

_MULTIPROCESSORS = 16
"""CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT."""

STAGES = ("kernel", "transfers")
"""Parts of the time of a call."""

_REGISTERS = ("tid", "ctaid", "ntid", "nctaid")
"""PTX registers: a thread's number in its block, the block's number, and the numbers of threads and of blocks."""

_THREAD = [
    *(f"%{name} = call i32 @llvm.nvvm.read.ptx.sreg.{name}.x()" for name in _REGISTERS),
    "%before = mul i32 %ctaid, %ntid",
    "%thread32 = add i32 %before, %tid",
    "%threads32 = mul i32 %nctaid, %ntid",
    "%thread = zext i32 %thread32 to i64",
    "%threads = zext i32 %threads32 to i64",
]


class ThreadBuilder(FunctionBuilder):
    """Builder of ``void name(ptr arrays, ptr sizes, ptr scratch)``, which every thread of a GPU runs."""

    def __init__(self, name: str, dtype: DTypeLike):
        super().__init__(name, dtype, width=1)
        own = f"%own = getelementptr {self.element}, ptr %scratch, i64 %thread"
        self.instructions.entry += [*_THREAD, own]
        self.scratch, self.scratch_stride = "%own", "%threads"

    @contextmanager
    def each_block(self) -> Iterator[None]:
        """Repeat the body of the context for each of the thread's problems, with its number in ``%problem``."""
        with self.loop(self.size(0), "thread", "%thread", "%threads") as problem:
            self.instructions.append(f"%problem = add i64 {problem}, 0")
            yield

    def text(self) -> str:
        """Return the module, which contains the function alone."""
        return "\n".join(
            [
                f'target triple = "{_TARGET}"',
                *(f"declare i32 @llvm.nvvm.read.ptx.sreg.{name}.x()" for name in _REGISTERS),
                f"define ptx_kernel void @{self.name}(ptr %arrays, ptr %sizes, ptr noalias %scratch) {{",
                *self.body(),
                "",
            ]
        )


def emit_ptx(text: str) -> str:
    """Compile a module to PTX; this turns the builder's variables into registers, which the driver would not do."""
    import llvmlite.binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(_TARGET)
    machine = target.create_target_machine(cpu=_ARCHITECTURE, features=_PTX_VERSION, opt=3)
    module = llvm.parse_assembly(text)
    module.verify()
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(module, passes)
    return machine.emit_assembly(module)


class DriverError(Exception):
    """NVIDIA's driver is missing, or an operation of the driver failed."""


@cache
def _driver() -> ctypes.CDLL:
    """Load the driver and select the first GPU's primary context, which is JAX's as well."""
    try:
        library = ctypes.CDLL("libcuda.so.1")
    except OSError as error:
        raise DriverError(str(error)) from error
    device, context = ctypes.c_int(), ctypes.c_void_p()
    _check(library, "cuInit", 0)
    _check(library, "cuDeviceGet", ctypes.byref(device), 0)
    _check(library, "cuDevicePrimaryCtxRetain", ctypes.byref(context), device)
    _check(library, "cuCtxSetCurrent", context)
    return library


def _check(library: ctypes.CDLL, function: str, *arguments: Any) -> None:
    code = getattr(library, function)(*arguments)
    if code:
        raise DriverError(f"{function} answers {code}")


def _call(function: str, *arguments: Any) -> None:
    _check(_driver(), function, *arguments)


class _Memory:
    """Allocated memory of the GPU."""

    def __init__(self, size: int):
        self.address = ctypes.c_uint64()
        _call("cuMemAlloc_v2", ctypes.byref(self.address), ctypes.c_size_t(max(size, 1)))

    def put(self, x: np.ndarray) -> None:
        _call("cuMemcpyHtoD_v2", self.address, ctypes.c_void_p(x.ctypes.data), ctypes.c_size_t(x.nbytes))

    def get(self, x: np.ndarray) -> None:
        _call("cuMemcpyDtoH_v2", ctypes.c_void_p(x.ctypes.data), self.address, ctypes.c_size_t(x.nbytes))

    def free(self) -> None:
        _call("cuMemFree_v2", self.address)


class GpuKernel:
    """A kernel in float64 on the first GPU; ``seconds`` adds up the time of each stage. Raises DriverError."""

    def __init__(self, kernel: Kernel):
        self._kernel, self.seconds = kernel, defaultdict[str, float](float)
        builder = kernel.build(np.float64, ThreadBuilder)
        self._scratch_rows = builder.scratch_rows
        module, self._function = ctypes.c_void_p(), ctypes.c_void_p()
        _call("cuModuleLoadData", ctypes.byref(module), emit_ptx(builder.text()).encode() + b"\0")
        _call("cuModuleGetFunction", ctypes.byref(self._function), module, builder.name.encode())
        count = ctypes.c_int()
        _call("cuDeviceGetAttribute", ctypes.byref(count), _MULTIPROCESSORS, 0)
        self._blocks = _BLOCKS_A_MULTIPROCESSOR * count.value

    def __call__(self, *trees: Any) -> Any:
        """Run the kernel on these arrays, whose last axis is the problems; return NumPy arrays."""
        arrays, results, sizes = self._kernel.laid_out(trees, np.float64)
        blocks = min(self._blocks, -(-sizes[0] // _THREADS_A_BLOCK))
        scratch = _Memory(self._scratch_rows * max(sizes[1:]) * blocks * _THREADS_A_BLOCK * 8)
        with self._timed("transfers"):
            given = [_on_gpu(x) for x in arrays]
            found = [_Memory(x.nbytes) for x in results]
            pointers = _on_gpu(np.array([x.address.value for x in [*given, *found]], np.uint64))
            lengths = _on_gpu(np.array(sizes, np.int64))
        with self._timed("kernel"):
            self._launch(blocks, pointers, lengths, scratch)
        with self._timed("transfers"):
            for memory, x in zip(found, results, strict=True):
                memory.get(x)
            for memory in (*given, *found, pointers, lengths, scratch):
                memory.free()
        return self._kernel.result_of(results, sizes[0])

    def _launch(self, blocks: int, *memories: _Memory) -> None:
        addresses = [x.address for x in memories]
        arguments = (ctypes.c_void_p * len(addresses))(*map(ctypes.addressof, addresses))
        _call("cuLaunchKernel", self._function, blocks, 1, 1, _THREADS_A_BLOCK, 1, 1, 0, None, arguments, None)

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        _call("cuCtxSynchronize")
        self.seconds[stage] += time.perf_counter() - start


def _on_gpu(x: np.ndarray) -> _Memory:
    memory = _Memory(x.nbytes)
    memory.put(x)
    return memory


def run_on_gpu(kernels: Sequence[Kernel]) -> dict[str, GpuKernel]:
    """Run these kernels on the GPU from now on, in this process; return them by name."""
    on_gpu = {one.name: GpuKernel(one) for one in kernels}
    native = Kernel.__call__

    def anywhere(self: Kernel, *trees: Any) -> Any:
        double = all(x.dtype != np.float32 for x in jax.tree.leaves(trees))
        return on_gpu[self.name](*trees) if double and self.name in on_gpu else native(self, *trees)

    Kernel.__call__ = anywhere
    return on_gpu
