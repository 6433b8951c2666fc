"""What this machine reaches at best, by the compiler and the threads of the fits: multiply-adds, divisions and square
roots of registers, and bytes from each level of memory."""

import os
from typing import Any

import numpy as np

from adapt.engine.axes import along
from adapt.engine.kernel import Kernel
from adapt.engine.simd_values import REGISTER_BYTES
from motions.arrays import repeat, xp
from scripts.reporting import timed

_CHAINS, _LINKS, _ROUNDS = 12, 32, 1000
"""Independent operations, enough to hide that each takes four cycles; those between two looks at memory; and how
often."""

_CACHE_ROWS, _CACHE_ROUNDS = 96, 400
"""Registers read at a place of an axis, and how often all places are."""

_STREAMS = 8
"""Arrays read side by side."""


def _chains(link):
    """Nothing but one operation on registers."""

    def text(x: Any) -> list[Any]:
        def longer(values: list[Any]) -> list[Any]:
            for _ in range(_LINKS):
                values = [link(value) for value in values]
            return values

        return repeat(_ROUNDS, longer, [x + float(k) for k in range(_CHAINS)])

    return text


def _sum(row: list[Any]) -> Any:
    """By halves: no addition waits for the one before."""
    half = len(row) // 2
    return row[0] if half == 0 else _sum(row[:half]) + _sum(row[half:])


def _read_again(x: Any) -> Any:
    """The sum of rows that are kept beside each other, many times."""
    first, _, kept = along(x).reduced(lambda one: (one, (), [one + float(k) for k in range(_CACHE_ROWS)]), x)

    def again(total):
        return total + along(kept[0]).reduced(lambda row: (_sum(row), (), ()), kept)[0]

    return repeat(_CACHE_ROUNDS, again, xp.zeros_like(first))


PEAK = Kernel("peak", _chains(lambda x: 0.999 * x + 0.5), ("",), str(_CHAINS), 64)
DIVISIONS = Kernel("divisions", _chains(lambda x: 1.5 / x), ("",), str(_CHAINS), 64)
ROOTS = Kernel("roots", _chains(lambda x: xp.sqrt(x)), ("",), str(_CHAINS), 64)
CACHE = Kernel("cache", _read_again, ("postures",), "", 64)
STREAM = Kernel("stream", lambda x: sum(x[1:], x[0]), (str(_STREAMS),), "", 64)


def _ns_an_operation(kernel: Kernel) -> float:
    """Nanoseconds that a core takes for an operation on a register of eight numbers."""
    x = np.ones(64 * 8 * _cores())
    kernel.by_machine(x)
    registers = len(x) / 8 / _cores() * _CHAINS * _LINKS * _ROUNDS
    return timed(lambda: kernel.by_machine(x)) / registers * 1e9


def peak_gflops() -> float:
    """Of all cores."""
    return 2.0 * 8 * _cores() / _ns_an_operation(PEAK)


def division_ns() -> float:
    """Of a register, by a core."""
    return _ns_an_operation(DIVISIONS)


def root_ns() -> float:
    """Of a register, by a core."""
    return _ns_an_operation(ROOTS)


def cache_gb_s(kib: int) -> float:
    """Read by all cores, each from so many KiB of its own."""
    places = kib * 1024 // (REGISTER_BYTES * _CACHE_ROWS)
    blocks = 16 * _cores()
    x = np.ones((places, 8 * blocks))
    CACHE.by_machine(x)
    read = REGISTER_BYTES * _CACHE_ROWS * places * _CACHE_ROUNDS * blocks
    return read / timed(lambda: CACHE.by_machine(x)) / 1e9


def memory_gb_s() -> float:
    """Read by all cores from arrays of half a GiB together."""
    x = np.ones((_STREAMS, 2**26 // _STREAMS))
    STREAM.by_machine(x)
    return x.nbytes * (1.0 + 1.0 / _STREAMS) / timed(lambda: STREAM.by_machine(x)) / 1e9


def _cores() -> int:
    return os.cpu_count() or 1
