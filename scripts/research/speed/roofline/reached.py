"""Peak performance of this machine with the compiler and the threads of the fits: multiply-adds, divisions and square
roots of registers, and bytes from each level of memory."""

import os
import time
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

from adapt.engine.axes import along
from adapt.engine.kernel import Kernel
from adapt.engine.simd_values import REGISTER_BYTES
from motions.arrays import repeat, xp

_CHAINS, _LINKS, _ROUNDS = 12, 32, 1000
"""Independent operations, enough to hide the latency of four cycles; operations between two accesses to memory; and
their repetitions."""

_CACHE_ROWS, _CACHE_ROUNDS = 96, 400
"""Registers read at each place of an axis, and repetitions over all places."""

_STREAM_PLACES = 512
"""Places of an axis that is read once: so many that switching threads takes negligible time."""


def _chains(link):
    """Make a kernel text that repeats one operation on registers."""

    def text(x: Any) -> list[Any]:
        def longer(values: list[Any]) -> list[Any]:
            for _ in range(_LINKS):
                values = [link(value) for value in values]
            return values

        return repeat(_ROUNDS, longer, [x + float(k) for k in range(_CHAINS)])

    return text


def _sum(row: list[Any]) -> Any:
    """Sum by halves, so that no addition waits for the one before."""
    half = len(row) // 2
    return row[0] if half == 0 else _sum(row[:half]) + _sum(row[half:])


def _read_again(x: Any) -> Any:
    """Sum rows that are stored contiguously, many times."""
    first, _, kept = along(x).reduced(lambda one: (one, (), [one + float(k) for k in range(_CACHE_ROWS)]), x)

    def again(total):
        return total + along(kept[0]).reduced(lambda row: (_sum(row), (), ()), kept)[0]

    return repeat(_CACHE_ROUNDS, again, xp.zeros_like(first))


def _kernel(name: str, text: Callable[..., Any], inputs: tuple[str, ...], outputs: str) -> Kernel:
    """Make a kernel whose name depends on its text: cached object code is found by name and package sources alone."""
    written = Kernel(name, text, inputs, outputs, 64).build().text()
    return Kernel(f"{name}{zlib.crc32(written.encode())}", text, inputs, outputs, 64)


PEAK = _kernel("peak", _chains(lambda x: 0.999 * x + 0.5), ("",), str(_CHAINS))
DIVISIONS = _kernel("divisions", _chains(lambda x: 1.5 / x), ("",), str(_CHAINS))
ROOTS = _kernel("roots", _chains(lambda x: xp.sqrt(x)), ("",), str(_CHAINS))
CACHE = _kernel("cache", _read_again, ("postures",), "")
STREAM = _kernel("stream", lambda x: along(x).reduced(lambda one: (one, (), ()), x)[0], ("postures",), "")


def core_seconds(run: Callable[[], object]) -> float:
    """Return the CPU seconds of all threads divided by the number of cores: the wall time of an idle machine."""
    start = time.process_time()
    run()
    return (time.process_time() - start) / _cores()


def _ns_an_operation(kernel: Kernel) -> float:
    """Measure the nanoseconds of a core per operation on a register of eight numbers."""
    x = np.ones(64 * 8 * _cores())
    kernel.native(x)
    registers = len(x) / 8 / _cores() * _CHAINS * _LINKS * _ROUNDS
    return core_seconds(lambda: kernel.native(x)) / registers * 1e9


def peak_gflops() -> float:
    """Measure the multiply-add rate of all cores, in GFLOP/s."""
    return 2.0 * 8 * _cores() / _ns_an_operation(PEAK)


def division_ns() -> float:
    """Measure the division of a register by a core, ns."""
    return _ns_an_operation(DIVISIONS)


def root_ns() -> float:
    """Measure the square root of a register by a core, ns."""
    return _ns_an_operation(ROOTS)


def cache_gb_s(kib: int) -> float:
    """Measure the read rate of all cores, each from so many KiB of its own, GB/s."""
    places = kib * 1024 // (REGISTER_BYTES * _CACHE_ROWS)
    blocks = 16 * _cores()
    x = np.ones((places, 8 * blocks))
    CACHE.native(x)
    read = REGISTER_BYTES * _CACHE_ROWS * places * _CACHE_ROUNDS * blocks
    return read / core_seconds(lambda: CACHE.native(x)) / 1e9


def memory_gb_s() -> float:
    """Measure the read rate of all cores from an array of half a GiB in the layout of the kernels' arrays, GB/s."""
    x = np.ones((_STREAM_PLACES, 2**26 // _STREAM_PLACES))
    STREAM.native(x)
    return x.nbytes / core_seconds(lambda: STREAM.native(x)) / 1e9


def _cores() -> int:
    return os.cpu_count() or 1
