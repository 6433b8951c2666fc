"""Values of the compiler: one number or truth value per problem in a SIMD register, and rows of numbers in memory."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike

if TYPE_CHECKING:
    from adapt.engine.function_builder import FunctionBuilder

REGISTER_BYTES = 64
"""Size of a register of AVX-512: eight problems in float64, sixteen in float32. Without AVX-512, LLVM uses several
shorter registers."""


def simd_width(dtype: DTypeLike) -> int:
    """Return the number of problems for which one register holds one number each."""
    return REGISTER_BYTES // np.dtype(dtype).itemsize


class SimdValue:
    """Number or truth value (mask) of every problem of a block, as an operand of LLVM.

    Its arithmetic computes nothing: operators append instructions to the ``FunctionBuilder``, which is also the array
    namespace of the value (``motions.arrays``).
    """

    __slots__ = ("builder", "is_mask", "operand")

    def __init__(self, builder: "FunctionBuilder", operand: str, is_mask: bool = False):
        self.builder, self.operand, self.is_mask = builder, operand, is_mask

    def __array_namespace__(self, *, api_version: str | None = None) -> "FunctionBuilder":
        return self.builder

    @property
    def dtype(self) -> np.dtype:
        """Type of all numbers of the function under construction."""
        return self.builder.dtype

    def __add__(self, other):
        return self.builder.add(self, other)

    __radd__ = __add__

    def __sub__(self, other):
        return self.builder.subtract(self, other)

    def __rsub__(self, other):
        return self.builder.subtract(other, self)

    def __mul__(self, other):
        return self.builder.multiply(self, other)

    __rmul__ = __mul__

    def __truediv__(self, other):
        return self.builder.arithmetic("fdiv", self, other)

    def __rtruediv__(self, other):
        return self.builder.arithmetic("fdiv", other, self)

    def __pow__(self, exponent: int):
        return self if exponent == 1 else self * self ** (exponent - 1)

    def __neg__(self):
        return self.builder.subtract(0.0, self)

    def __abs__(self):
        return self.builder.call_intrinsic("fabs", self)

    def __lt__(self, other):
        return self.builder.compare("olt", self, other)

    def __le__(self, other):
        return self.builder.compare("ole", self, other)

    def __gt__(self, other):
        return self.builder.compare("ogt", self, other)

    def __ge__(self, other):
        return self.builder.compare("oge", self, other)

    def __and__(self, other):
        return self.builder.combine_masks("and", self, other)

    def __or__(self, other):
        return self.builder.combine_masks("or", self, other)

    def __invert__(self):
        return self.builder.combine_masks("xor", self, True)


class MemoryRow:
    """One number per problem and place of an axis (posture, thorax point), in memory: the caller's array, or scratch.

    ``length`` is the number of places; ``offset_at`` returns the element at which a place begins. A mask of the caller
    has ``one_byte`` per problem, a mask in scratch is a number.
    """

    def __init__(
        self,
        builder: "FunctionBuilder",
        pointer: str,
        length: str,
        offset_at: Callable[[str], str],
        is_mask: bool,
        one_byte: bool,
    ):
        self.builder, self._pointer, self.length, self._offset_at = builder, pointer, length, offset_at
        self.is_mask, self._one_byte = is_mask, one_byte

    def load(self, index: str) -> SimdValue:
        """Load the value at the place ``index``."""
        return self.builder.load(self._address(index), self.is_mask, self._one_byte)

    def store(self, index: str, value: Any) -> None:
        """Store ``value`` at the place ``index``."""
        self.builder.store(self._address(index), self.builder.broadcast(value), self._one_byte)

    def _address(self, index: str) -> str:
        element = "i8" if self._one_byte else self.builder.element
        instruction = f"getelementptr {element}, ptr {self._pointer}, i64 {self._offset_at(index)}"
        return self.builder.instructions.compute(instruction)
