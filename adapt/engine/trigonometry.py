"""Sine and cosine of SIMD values, which LLVM lacks for registers, accurate to two units in the last place."""

from decimal import Decimal
from math import factorial, pi

from numpy import dtype
from numpy.typing import DTypeLike

from adapt.engine.simd_values import SimdValue

_HALF_PI = Decimal("1.57079632679489661923132169163975144209858469968755")

_PART_BITS = {8: 32, 4: 12}
"""Bits of each of the first two parts of pi/2, by bytes per number. The product of a part and a number of quarter turns
is exact for numbers up to 2^20, in float32 up to 2^12."""

_SERIES = {8: 9, 4: 6}
"""Number of terms of the series of sine and cosine on +-pi/4, by bytes per number. The first omitted term is below
1e-18, in float32 below 2e-10."""


def sine(x: SimdValue) -> SimdValue:
    """Append the instructions of sin(x), x in radians."""
    sin, cos, quarter = _quarter_turns(x)
    value = x.builder.where((quarter >= 3.0) | ((quarter >= 1.0) & (quarter < 2.0)), cos, sin)
    return x.builder.where(quarter >= 2.0, -value, value)


def cosine(x: SimdValue) -> SimdValue:
    """Append the instructions of cos(x), x in radians."""
    sin, cos, quarter = _quarter_turns(x)
    value = x.builder.where((quarter >= 3.0) | ((quarter >= 1.0) & (quarter < 2.0)), sin, cos)
    return x.builder.where((quarter >= 1.0) & (quarter < 3.0), -value, value)


def _quarter_turns(x: SimdValue) -> tuple[SimdValue, SimdValue, SimdValue]:
    """Return sine and cosine of the remainder of x after whole quarter turns (at most pi/4), and the number of turns
    modulo 4."""
    builder = x.builder
    turns = builder.call_intrinsic("roundeven", x * (2.0 / pi))
    left = x
    for part in half_pi_parts(x.dtype):
        left = left - turns * part
    square = left * left
    sin = cos = builder.broadcast(0.0)
    for k in reversed(range(_SERIES[x.dtype.itemsize])):
        sin = sin * square + (-1.0) ** k / factorial(2 * k + 1)
        cos = cos * square + (-1.0) ** k / factorial(2 * k)
    return left * sin, cos, turns - 4.0 * builder.call_intrinsic("floor", 0.25 * turns)


def half_pi_parts(number: DTypeLike) -> list[float]:
    """Return pi/2 as a sum: two parts of few bits, and the remainder."""
    parts, rest = [], _HALF_PI
    for place in range(1, 3):
        scale = Decimal(2) ** (_PART_BITS[dtype(number).itemsize] * place - 1)
        parts.append(float((rest * scale).to_integral_value() / scale))
        rest -= Decimal(parts[-1])
    return [*parts, float(rest)]
