"""Builder of LLVM instructions: a kernel function called with ``SimdValue`` arguments leaves its instructions here.

Every problem (ISPC's program instance) has one lane of a register, and a block of problems (ISPC's gang) fills the
register. Values stay in registers or in the first-level cache, however many there are. Loops (over postures, thorax
points, iterations) enclose these instructions; the code contains no length of an axis. No result depends on the other
problems of a block.
"""

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import jax
import numpy as np
from numpy.typing import DTypeLike

from adapt.engine.instructions import InstructionList
from adapt.engine.simd_values import REGISTER_BYTES, MemoryRow, SimdValue, simd_width
from adapt.engine.trigonometry import cosine, sine

_ROWS = "SCRATCH_ROWS"
"""Placeholder for the number of scratch rows per place, which is known only at the end."""


class FunctionBuilder:
    """Builder of one function, ``void name(ptr arrays, ptr sizes, i64 first, i64 last, ptr scratch)``.

    ``arrays`` points to the arrays, component first and problems last; ``sizes`` to the number of problems and the
    lengths of the axes. The function runs blocks ``first`` to ``last`` (exclusive); the last block of all ends with the
    last problem.

    The builder is also the array namespace of its values: their ``where``, ``sqrt``, ``repeat_while``, ...
    """

    def __init__(self, name: str, dtype: DTypeLike, width: int | None = None):
        """Start an empty function. ``dtype``: float64 or float32, the type of all numbers. ``width``: problems per
        block, by default one register full."""
        self.name, self.dtype = name, np.dtype(dtype)
        self.simd_width = width or simd_width(dtype)
        self.scratch, self.scratch_stride = "%scratch", str(self.simd_width)
        self.element = {8: "double", 4: "float"}[self.dtype.itemsize]
        self.vector, self.mask = f"<{self.simd_width} x {self.element}>", f"<{self.simd_width} x i1>"
        self.instructions = InstructionList()
        self.scratch_rows = 0
        self._zero, self._one = (self.broadcast(x).operand for x in (0.0, 1.0))

    # --- values

    def broadcast(self, x: Any) -> SimdValue:
        """Convert x to a SIMD value; a Python number is the same in every problem (uniform)."""
        if isinstance(x, SimdValue):
            return x
        if isinstance(x, bool):
            return SimdValue(self, f"splat (i1 {str(x).lower()})", is_mask=True)
        rounded = float(self.dtype.type(x))  # LLVM IR writes a float as the bits of the same double
        return SimdValue(self, f"splat ({self.element} 0x{struct.pack('>d', rounded).hex().upper()})")

    def arithmetic(self, operation: str, a: Any, b: Any) -> SimdValue:
        """Append an arithmetic operation on a and b. The flag ``contract`` lets LLVM fuse a product and a sum into one
        instruction, rounded once."""
        a, b = self.broadcast(a), self.broadcast(b)
        return self._number(f"{operation} contract {self.vector} {a.operand}, {b.operand}")

    def add(self, a: Any, b: Any) -> SimdValue:
        """Add a and b; a summand that is 0 by construction takes no instruction."""
        a, b = self.broadcast(a), self.broadcast(b)
        if self.is_zero(a):
            return b
        return a if self.is_zero(b) else self.arithmetic("fadd", a, b)

    def subtract(self, a: Any, b: Any) -> SimdValue:
        """Subtract b from a; a number b that is 0 by construction takes no instruction."""
        a, b = self.broadcast(a), self.broadcast(b)
        if self.is_zero(b):
            return a
        if self.is_zero(a):
            return self._number(f"fneg {self.vector} {b.operand}")
        return self.arithmetic("fsub", a, b)

    def multiply(self, a: Any, b: Any) -> SimdValue:
        """Multiply a by b. A factor that is 0 by construction gives 0, whatever the other factor is."""
        a, b = self.broadcast(a), self.broadcast(b)
        if self.is_zero(a) or b.operand == self._one:
            return a
        return b if self.is_zero(b) or a.operand == self._one else self.arithmetic("fmul", a, b)

    def is_zero(self, x: Any) -> bool:
        """Check whether x is 0 by construction."""
        return self.broadcast(x).operand == self._zero

    def call_intrinsic(self, function: str, *arguments: Any, flags: str = "") -> SimdValue:
        """Call the LLVM intrinsic of this name."""
        operands = ", ".join(f"{self.vector} {self.broadcast(x).operand}" for x in arguments)
        kind = f"v{self.simd_width}f{8 * self.dtype.itemsize}"
        return self._number(f"call {flags}{self.vector} @llvm.{function}.{kind}({operands})")

    def compare(self, how: str, a: Any, b: Any) -> SimdValue:
        """Compare a with b and return a mask; ``how`` is LLVM's predicate (``olt``: less than, false for NaN)."""
        a, b = self.broadcast(a), self.broadcast(b)
        return self._mask(f"fcmp {how} {self.vector} {a.operand}, {b.operand}")

    def combine_masks(self, operation: str, a: Any, b: Any) -> SimdValue:
        """Combine two masks by LLVM's ``and``, ``or`` or ``xor``."""
        a, b = self.broadcast(a), self.broadcast(b)
        return self._mask(f"{operation} {self.mask} {a.operand}, {b.operand}")

    def _number(self, instruction: str) -> SimdValue:
        return SimdValue(self, self.instructions.compute(instruction))

    def _mask(self, instruction: str) -> SimdValue:
        return SimdValue(self, self.instructions.compute(instruction), is_mask=True)

    # --- functions of numpy

    def where(self, condition: SimdValue, yes: Any, no: Any) -> SimdValue:
        yes, no = self.broadcast(yes), self.broadcast(no)
        if yes.operand == no.operand:
            return yes
        kind = self.mask if yes.is_mask else self.vector
        instruction = f"select {self.mask} {condition.operand}, {kind} {yes.operand}, {kind} {no.operand}"
        return self._mask(instruction) if yes.is_mask else self._number(instruction)

    def zeros_like(self, _: Any, kind: type = float) -> SimdValue:
        return self.broadcast(kind(0))

    def full_like(self, _: Any, value: float) -> SimdValue:
        return self.broadcast(value)

    def sqrt(self, x: Any) -> SimdValue:
        return self.call_intrinsic("sqrt", x)

    def maximum(self, a: Any, b: Any) -> SimdValue:
        """Take the larger of a and b; NaN if either is NaN."""
        return self.call_intrinsic("maximum", a, b, flags="nsz ")

    def minimum(self, a: Any, b: Any) -> SimdValue:
        return self.call_intrinsic("minimum", a, b, flags="nsz ")

    def clip(self, x: Any, low: Any, high: Any) -> SimdValue:
        return self.minimum(self.maximum(x, low), high)

    def any(self, x: SimdValue) -> SimdValue:
        """Return x, each problem's own truth value: ``repeat_while`` checks whether any problem is unfinished."""
        return x

    def sin(self, x: SimdValue) -> SimdValue:
        return sine(x)

    def cos(self, x: SimdValue) -> SimdValue:
        return cosine(x)

    # --- memory

    def load(self, address: str, is_mask: bool, one_byte: bool = False) -> SimdValue:
        """Load one number per problem; a mask is stored as 1 or 0, in ``one_byte`` or as a number."""
        name = self.instructions.new_name()
        if not one_byte:
            self.instructions.append(f"{name} = load {self.vector}, ptr {address}, align {self.dtype.itemsize}")
            number = SimdValue(self, name)
            return number > 0.5 if is_mask else number
        self.instructions.append(f"{name} = load <{self.simd_width} x i8>, ptr {address}, align 1")
        return self._mask(f"icmp ne <{self.simd_width} x i8> {name}, splat (i8 0)")

    def store(self, address: str, value: SimdValue, one_byte: bool = False) -> None:
        """Store one number per problem; a mask is stored as 1 or 0, in ``one_byte`` or as a number."""
        if one_byte:
            widened = f"zext {self.mask} {value.operand} to <{self.simd_width} x i8>"
            as_bytes = self.instructions.compute(widened)
            self.instructions.append(f"store <{self.simd_width} x i8> {as_bytes}, ptr {address}, align 1")
        else:
            self.instructions.append(self.store_instruction(address, value))

    def store_instruction(self, address: str, value: SimdValue) -> str:
        """Return the instruction that stores a number, or a mask as 1 or 0."""
        if value.is_mask:
            value = self.where(value, 1.0, 0.0)
        return f"store {self.vector} {value.operand}, ptr {address}, align {self.dtype.itemsize}"

    def variable(self) -> str:
        """Allocate memory for one number per problem; return its address."""
        name = self.instructions.new_name()
        self.instructions.entry.append(f"{name} = alloca {self.vector}, align {REGISTER_BYTES}")
        return name

    def scratch_row(self, length: str, is_mask: bool) -> MemoryRow:
        """Return a new row of scratch memory, next to the other rows of the same place of the axis."""
        row, self.scratch_rows = self.scratch_rows, self.scratch_rows + 1
        compute = self.instructions.compute

        def offset_at(index: str) -> str:
            first = compute(f"mul i64 {index}, {_ROWS}")
            return compute(f"mul i64 {compute(f'add i64 {first}, {row}')}, {self.scratch_stride}")

        return MemoryRow(self, self.scratch, length, offset_at, is_mask, one_byte=False)

    def argument_rows(self, number: int, rows: int, axis: int | None, is_mask: bool) -> list[MemoryRow]:
        """Return the rows of the caller's array ``number``; ``axis``: entry of ``sizes`` with the length of its axis,
        if any."""
        pointer = self._argument("ptr", "%arrays", number)
        length = "1" if axis is None else self.size(axis)
        compute = self.instructions.compute

        def offset_of(row: int) -> Callable[[str], str]:
            def offset_at(index: str) -> str:
                place = compute(f"add i64 {compute(f'mul i64 {length}, {row}')}, {index}")
                return compute(f"add i64 {compute(f'mul i64 {place}, {self.size(0)}')}, %problem")

            return offset_at

        return [MemoryRow(self, pointer, length, offset_of(row), is_mask, one_byte=is_mask) for row in range(rows)]

    def size(self, axis: int) -> str:
        """Return an entry of ``sizes``: the number of problems, or the length of an axis."""
        return self._argument("i64", "%sizes", axis)

    def _argument(self, kind: str, table: str, number: int) -> str:
        name = f"%{table[1:]}.{number}"
        address, entry = f"{name}.at = getelementptr {kind}, ptr {table}, i64 {number}", self.instructions.entry
        if address not in entry:
            entry += [address, f"{name} = load {kind}, ptr {name}.at"]
        return name

    # --- loops

    @contextmanager
    def loop(self, length: str, name: str, first: str = "0", step: str = "1") -> Iterator[str]:
        """Repeat the instructions within for every ``step``th index from ``first`` up to ``length``."""
        write = self.instructions
        counter = write.new_name()
        write.entry.append(f"{counter} = alloca i64")
        write.append(f"store i64 {first}, ptr {counter}")
        with write.loop(name) as labels:
            index, more, following = write.new_name(), write.new_name(), write.new_name()
            write.append(f"{index} = load i64, ptr {counter}", f"{more} = icmp slt i64 {index}, {length}")
            write.enter_if(more, labels)
            yield index
            write.append(f"{following} = add i64 {index}, {step}", f"store i64 {following}, ptr {counter}")

    @contextmanager
    def each_block(self) -> Iterator[None]:
        """Repeat the instructions within for one block after the other; ``%problem`` is the first problem of a
        block."""
        compute = self.instructions.compute
        with self.loop("%last", "block", "%first") as block:
            last = compute(f"sub i64 {self.size(0)}, {self.simd_width}")
            problem = compute(f"mul i64 {block}, {self.simd_width}")
            fits = compute(f"icmp slt i64 {problem}, {last}")
            self.instructions.append(f"%problem = select i1 {fits}, i64 {problem}, i64 {last}")
            yield

    def repeat_while(
        self,
        unfinished: Callable[[Any], SimdValue],
        advance: Callable[[Any], Any],
        state: Any,
        name: str = "while",
    ) -> Any:
        """Advance each problem while it is unfinished, as ``motions.arrays.repeat_while`` does with this problem alone.

        A finished problem keeps its state while others continue. Each ``MemoryRow`` of the state changes in place.
        """
        leaves, tree = jax.tree.flatten(state)
        places = {k: self.variable() for k, x in enumerate(leaves) if not isinstance(x, MemoryRow)}
        masks = {k: self.broadcast(leaves[k]).is_mask for k in places}
        for k, place in places.items():
            self.store(place, self.broadcast(leaves[k]))

        def now() -> Any:
            values = [self.load(places[k], masks[k]) if k in places else x for k, x in enumerate(leaves)]
            return values, jax.tree.unflatten(tree, values)

        with self.instructions.loop(name) as labels:
            before, old = now()
            mask = unfinished(old)
            self.instructions.enter_if(self._any_lane(mask), labels)
            for k, x in enumerate(jax.tree.leaves(advance(old))):
                if k in places:
                    self.store(places[k], self.where(mask, x, before[k]))
        return now()[1]

    def _any_lane(self, mask: SimdValue) -> str:
        bits = self.instructions.compute(f"bitcast {self.mask} {mask.operand} to i{self.simd_width}")
        return self.instructions.compute(f"icmp ne i{self.simd_width} {bits}, 0")

    def repeat(self, times: int, advance: Callable[[Any], Any], state: Any) -> Any:
        """Advance the state ``times`` times."""

        def advance_and_count(counted):
            number, now = counted
            return number + 1.0, advance(now)

        first = self.broadcast(0.0), state
        return self.repeat_while(lambda counted: counted[0] < times, advance_and_count, first, f"times.{times}.")[1]

    # --- the whole

    def text(self) -> str:
        """Return the LLVM module: the function, and ``name_rows()``, which returns the number of scratch rows per
        place."""
        return "\n".join(
            [
                f"define i64 @{self.name}_rows() {{ ret i64 {self.scratch_rows} }}",
                f"define void @{self.name}(ptr %arrays, ptr %sizes, i64 %first, i64 %last, ptr noalias %scratch) "
                f'"min-legal-vector-width"="512" {{',
                *self.body(),
                "",
            ]
        )

    def body(self) -> list[str]:
        """Return the body of the function and the declarations of the intrinsics that it calls."""
        live = self.instructions.live()
        lines = [*self.instructions.entry, "br label %start", "start:", *live, "ret void"]
        text = "\n  ".join(lines).replace(_ROWS, str(self.scratch_rows))
        called = sorted({m for line in live for m in re.findall(r"call [a-z ]*?(<[^>]*> @llvm[.\w]+)\(", line)})
        return [f"entry:\n  {text}\n}}", *(f"declare {x}({', '.join([self.vector] * _arity(x))})" for x in called)]

    def count_operations(self) -> Counter[tuple[str, ...]]:
        """Count the operations on numbers, keyed by the loops around them, outermost first."""
        return self.instructions.count_operations()


def _arity(function: str) -> int:
    return 2 if "imum" in function or "atan2" in function else 1
