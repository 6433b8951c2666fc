"""Numbers of many lanes whose arithmetic writes LLVM instructions: machine code from the text that numpy and JAX run.

Called with ``Lane``s, a function of components leaves its instructions in a ``Code``, in which every value stays in a
register or in the first cache, however many there are. Loops (over postures, thorax points, iterations) are written
around such pieces; none of their lengths is in the code. Each lane is on its own: no result depends on its partners.
"""

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from decimal import Decimal
from math import factorial, pi
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

_REGISTER_BYTES = 64
"""Of AVX-512: eight lanes of float64, sixteen of float32; LLVM uses several shorter ones where there is none."""

_HALF_PI = Decimal("1.57079632679489661923132169163975144209858469968755")

_PART_BITS = {8: 32, 4: 12}
"""By bytes of the number: bits of each of the first parts of pi/2, whose product with a count of quarter turns is exact
up to 2^20 of them, in float32 up to 2^12."""

_SERIES = {8: 9, 4: 6}
"""Terms of sine and cosine on +-pi/4: the first one left out is below 1e-18, in float32 below 2e-10."""

_OPERATIONS = ("fadd", "fsub", "fmul", "fdiv", "@llvm.sqrt", "@llvm.maximum", "@llvm.minimum")


class Lane:
    """A number (or a truth) in each of the lanes, as an operand of LLVM."""

    __slots__ = ("code", "operand", "truth")

    def __init__(self, code: "Code", operand: str, truth: bool = False):
        self.code, self.operand, self.truth = code, operand, truth

    @property
    def dtype(self) -> np.dtype:
        """Of the numbers of its code."""
        return self.code.dtype

    def __add__(self, other):
        return self.code.added(self, other)

    __radd__ = __add__

    def __sub__(self, other):
        return self.code.less(self, other)

    def __rsub__(self, other):
        return self.code.less(other, self)

    def __mul__(self, other):
        return self.code.times(self, other)

    __rmul__ = __mul__

    def __truediv__(self, other):
        return self.code.number("fdiv", self, other)

    def __rtruediv__(self, other):
        return self.code.number("fdiv", other, self)

    def __pow__(self, exponent: int):
        return self if exponent == 1 else self * self ** (exponent - 1)

    def __neg__(self):
        return self.code.less(0.0, self)

    def __abs__(self):
        return self.code.called("fabs", self)

    def __lt__(self, other):
        return self.code.compared("olt", self, other)

    def __le__(self, other):
        return self.code.compared("ole", self, other)

    def __gt__(self, other):
        return self.code.compared("ogt", self, other)

    def __ge__(self, other):
        return self.code.compared("oge", self, other)

    def __and__(self, other):
        return self.code.both("and", self, other)

    def __or__(self, other):
        return self.code.both("or", self, other)

    def __invert__(self):
        return self.code.both("xor", self, True)


class Row:
    """One number a lane and place of a loop, in memory: an array of the caller, or scratch."""

    def __init__(self, code: "Code", pointer: str, size: str, place: Callable[[str], str], truth: bool, bytes_: bool):
        self.code, self._pointer, self.size, self._place = code, pointer, size, place
        self.truth, self._bytes = truth, bytes_

    def load(self, index: str) -> Lane:
        return self.code.loaded(self._at(index), self.truth, self._bytes)

    def store(self, index: str, value: Any) -> None:
        self.code.stored(self._at(index), self.code.lane(value), self._bytes)

    def _at(self, index: str) -> str:
        element = "i8" if self._bytes else self.code.element
        return self.code.once(f"getelementptr {element}, ptr {self._pointer}, i64 {self._place(index)}")


class Loop:
    """As ``motions.arrays.Whole``: what is said of one place is done in a loop over all of them."""

    def __init__(self, like: Row, counted: Row | None):
        self._code, self._size, self._counted = like.code, like.size, counted

    def reduced(self, function: Callable[..., tuple[Any, Any, Any]], *trees: Any) -> tuple[Any, Any, Any]:
        return self._done(function, trees, lambda kept, _: kept, None)

    def advanced(self, taken: Lane, function: Callable[..., tuple[Any, Any, Any]], old: Any, *trees: Any):
        def merged(new: list[Lane], before: list[Lane]) -> list[Lane]:
            return [self._code.where(taken, a, b) for a, b in zip(new, before, strict=True)]

        return self._done(function, (old, *trees), merged, old)

    def _done(self, function, trees, merged, into) -> tuple[Any, Any, Any]:
        import jax

        code = self._code
        before = code.later()
        with code.loop(self._size, "posture" if self._counted else "point") as index:
            here = jax.tree.map(lambda row: row.load(index), trees)
            sums, worst, kept = function(*here)
            counts = self._counted.load(index) if self._counted else None

            def total(x, join):
                if code.lane(x).operand == code.lane(0.0).operand:
                    return x
                if counts is not None:
                    x = code.where(counts, x, 0.0)
                place = code.variable()
                code.stored(place, code.lane(0.0), into=before)
                code.stored(place, join(code.loaded(place, truth=False), x))
                return place

            sums = jax.tree.map(lambda x: total(x, code.added), sums)
            worst = jax.tree.map(lambda x: total(x, code.maximum), worst)
            kept, tree = jax.tree.flatten(jax.tree.map(code.lane, kept))
            if into is None:
                rows = [code.scratch(self._size, x.truth) for x in kept]
            else:
                rows = jax.tree.leaves(into)
                kept = merged(kept, jax.tree.leaves(here[0]))
            for row, x in zip(rows, kept, strict=True):
                row.store(index, x)
        sums, worst = jax.tree.map(
            lambda place: code.loaded(place, truth=False) if isinstance(place, str) else place, (sums, worst)
        )
        return sums, worst, jax.tree.unflatten(tree, rows)


class Code:
    """The instructions of one function, ``void name(ptr arrays, ptr sizes, i64 first, i64 last, ptr scratch)``.

    ``arrays`` points to the arrays, component first and lanes last; ``sizes`` to the number of lanes and the lengths of
    the loops. Blocks of lanes from ``first`` to ``last``; the last block of all ends with the last lane.
    """

    def __init__(self, name: str, dtype: DTypeLike):
        """``dtype``: float64 or float32, the type of all numbers."""
        self.name, self.dtype = name, np.dtype(dtype)
        self.width = width(dtype)
        self.element = {8: "double", 4: "float"}[self.dtype.itemsize]
        self.vector = f"<{self.width} x {self.element}>"
        self.operations: Counter[tuple[str, ...]] = Counter()
        self._lines: list[Any] = []
        self._known: list[dict[str, str]] = [{}]
        self._entry: list[str] = []
        self._loops: list[str] = []
        self._count = self._rows = 0

    # --- values

    def lane(self, x: Any) -> Lane:
        """x as a lane: a Python number is the same in all."""
        if isinstance(x, Lane):
            return x
        if isinstance(x, bool):
            return Lane(self, f"splat (i1 {str(x).lower()})", truth=True)
        rounded = float(self.dtype.type(x))  # LLVM writes the bits of a float as those of the same double
        return Lane(self, f"splat ({self.element} 0x{struct.pack('>d', rounded).hex().upper()})")

    def once(self, instruction: str) -> str:
        """The name of its value; the one of before if it was computed on the way here."""
        for known in self._known:
            if instruction in known:
                return known[instruction]
        name = self._known[-1][instruction] = self._new()
        self._lines.append(f"{name} = {instruction}")
        return name

    def number(self, operation: str, a: Any, b: Any) -> Lane:
        """``contract``: a product and a sum may become one instruction, rounded once."""
        a, b = self.lane(a), self.lane(b)
        return Lane(self, self.once(f"{operation} contract {self.vector} {a.operand}, {b.operand}"))

    def added(self, a: Any, b: Any) -> Lane:
        a, b = self.lane(a), self.lane(b)
        if self._is(a, 0.0):
            return b
        return a if self._is(b, 0.0) else self.number("fadd", a, b)

    def less(self, a: Any, b: Any) -> Lane:
        a, b = self.lane(a), self.lane(b)
        if self._is(b, 0.0):
            return a
        if self._is(a, 0.0):
            return Lane(self, self.once(f"fneg {self.vector} {b.operand}"))
        return self.number("fsub", a, b)

    def times(self, a: Any, b: Any) -> Lane:
        """What is 0 by construction stays so, whatever it is multiplied by."""
        a, b = self.lane(a), self.lane(b)
        if self._is(a, 0.0) or self._is(b, 1.0):
            return a
        return b if self._is(b, 0.0) or self._is(a, 1.0) else self.number("fmul", a, b)

    def _is(self, x: Lane, value: float) -> bool:
        return x.operand == self.lane(value).operand

    def called(self, function: str, *arguments: Any, flags: str = "") -> Lane:
        operands = ", ".join(f"{self.vector} {self.lane(x).operand}" for x in arguments)
        size = self.dtype.itemsize
        return Lane(self, self.once(f"call {flags}{self.vector} @llvm.{function}.v{self.width}f{8 * size}({operands})"))

    def compared(self, how: str, a: Any, b: Any) -> Lane:
        a, b = self.lane(a), self.lane(b)
        return Lane(self, self.once(f"fcmp {how} {self.vector} {a.operand}, {b.operand}"), truth=True)

    def both(self, operation: str, a: Any, b: Any) -> Lane:
        a, b = self.lane(a), self.lane(b)
        return Lane(self, self.once(f"{operation} <{self.width} x i1> {a.operand}, {b.operand}"), truth=True)

    # --- functions of numpy

    def where(self, condition: Lane, yes: Any, no: Any) -> Lane:
        yes, no = self.lane(yes), self.lane(no)
        if yes.operand == no.operand:
            return yes
        kind = f"<{self.width} x i1>" if yes.truth else self.vector
        instruction = f"select <{self.width} x i1> {condition.operand}, {kind} {yes.operand}, {kind} {no.operand}"
        return Lane(self, self.once(instruction), yes.truth)

    def zeros_like(self, _: Any, kind: type = float) -> Lane:
        return self.lane(kind(0))

    def full_like(self, _: Any, value: float) -> Lane:
        return self.lane(value)

    def sqrt(self, x: Any) -> Lane:
        return self.called("sqrt", x)

    def maximum(self, a: Any, b: Any) -> Lane:
        """NaN if one of them is."""
        return self.called("maximum", a, b, flags="nsz ")

    def minimum(self, a: Any, b: Any) -> Lane:
        return self.called("minimum", a, b, flags="nsz ")

    def clip(self, x: Any, low: Any, high: Any) -> Lane:
        return self.minimum(self.maximum(x, low), high)

    def any(self, x: Lane) -> Lane:
        """Of each lane alone: ``repeat_while`` asks whether there is one."""
        return x

    def sin(self, x: Any) -> Lane:
        sine, cosine, quarter = self._quarter_turns(x)
        value = self.where((quarter >= 3.0) | ((quarter >= 1.0) & (quarter < 2.0)), cosine, sine)
        return self.where(quarter >= 2.0, -value, value)

    def cos(self, x: Any) -> Lane:
        sine, cosine, quarter = self._quarter_turns(x)
        value = self.where((quarter >= 3.0) | ((quarter >= 1.0) & (quarter < 2.0)), sine, cosine)
        return self.where((quarter >= 1.0) & (quarter < 3.0), -value, value)

    def _quarter_turns(self, x: Any) -> tuple[Lane, Lane, Lane]:
        """Sine and cosine of what is left of x without whole quarter turns, at most pi/4, and how many of four."""
        turns = self.called("roundeven", x * (2.0 / pi))
        left = x
        for part in half_pi_parts(self.dtype):
            left = left - turns * part
        square = left * left
        sine = cosine = self.lane(0.0)
        for k in reversed(range(_SERIES[self.dtype.itemsize])):
            sine = sine * square + (-1.0) ** k / factorial(2 * k + 1)
            cosine = cosine * square + (-1.0) ** k / factorial(2 * k)
        return left * sine, cosine, turns - 4.0 * self.called("floor", 0.25 * turns)

    # --- memory

    def loaded(self, address: str, truth: bool, bytes_: bool = False) -> Lane:
        name = self._new()
        if not bytes_:
            self._lines.append(f"{name} = load {self.vector}, ptr {address}, align {self.dtype.itemsize}")
            number = Lane(self, name)
            return number > 0.5 if truth else number
        self._lines.append(f"{name} = load <{self.width} x i8>, ptr {address}, align 1")
        return Lane(self, self.once(f"icmp ne <{self.width} x i8> {name}, splat (i8 0)"), truth=True)

    def stored(self, address: str, value: Lane, bytes_: bool = False, into: list[Any] | None = None) -> None:
        if bytes_:
            as_bytes = self.once(f"zext <{self.width} x i1> {value.operand} to <{self.width} x i8>")
            self._lines.append(f"store <{self.width} x i8> {as_bytes}, ptr {address}, align 1")
            return
        if value.truth:
            value = self.where(value, 1.0, 0.0)
        store = f"store {self.vector} {value.operand}, ptr {address}, align {self.dtype.itemsize}"
        (self._lines if into is None else into).append(store)

    def variable(self) -> str:
        """Room for one number a lane."""
        name = self._new()
        self._entry.append(f"{name} = alloca {self.vector}, align {_REGISTER_BYTES}")
        return name

    def scratch(self, size: str, truth: bool) -> Row:
        """A new row, beside the others of the same place of the loop."""
        row, self._rows = self._rows, self._rows + 1

        def place(index: str) -> str:
            first = self.once(f"mul i64 {index}, ROWS")
            return self.once(f"mul i64 {self.once(f'add i64 {first}, {row}')}, {self.width}")

        return Row(self, "%scratch", size, place, truth, bytes_=False)

    def argument(self, number: int, rows: int, axis: int | None, truth: bool) -> list[Row]:
        """The rows of the caller's array of this number, along the loop ``axis`` of ``sizes``, if there is one."""
        pointer = self._argument("ptr", "%arrays", number)
        size = "1" if axis is None else self.size(axis)

        def place_of(row: int) -> Callable[[str], str]:
            def place(index: str) -> str:
                which = self.once(f"add i64 {self.once(f'mul i64 {size}, {row}')}, {index}")
                return self.once(f"add i64 {self.once(f'mul i64 {which}, {self.size(0)}')}, %lane")

            return place

        return [Row(self, pointer, size, place_of(row), truth, bytes_=truth) for row in range(rows)]

    def size(self, axis: int) -> str:
        """An entry of ``sizes``: the number of lanes, or the length of a loop."""
        return self._argument("i64", "%sizes", axis)

    def _argument(self, kind: str, table: str, number: int) -> str:
        name = f"%{table[1:]}.{number}"
        address = f"{name}.at = getelementptr {kind}, ptr {table}, i64 {number}"
        if address not in self._entry:
            self._entry += [address, f"{name} = load {kind}, ptr {name}.at"]
        return name

    # --- loops

    @contextmanager
    def loop(self, size: str, name: str, first: str = "0") -> Iterator[str]:
        """Instructions within are done for every index from ``first`` up to ``size``."""
        counter = self._new()
        self._entry.append(f"{counter} = alloca i64")
        self._lines.append(f"store i64 {first}, ptr {counter}")
        with self._again(name) as (go_on, ended):
            index, more, then = self._new(), self._new(), self._new()
            self._lines += [f"{index} = load i64, ptr {counter}", f"{more} = icmp slt i64 {index}, {size}"]
            self._branch(more, go_on, ended)
            yield index
            self._lines += [f"{then} = add i64 {index}, 1", f"store i64 {then}, ptr {counter}"]

    @contextmanager
    def blocks(self) -> Iterator[None]:
        """Within, ``%lane`` is the first lane of one block after the other."""
        with self.loop("%last", "block", "%first") as block:
            last, lane = self.once(f"sub i64 {self.size(0)}, {self.width}"), self.once(f"mul i64 {block}, {self.width}")
            fits = self.once(f"icmp slt i64 {lane}, {last}")
            self._lines.append(f"%lane = select i1 {fits}, i64 {lane}, i64 {last}")
            yield

    def repeat_while(
        self, unfinished: Callable[[Any], Lane], advance: Callable[[Any], Any], state: Any, name: str = "while"
    ) -> Any:
        """As of ``motions.arrays``; a lane that has finished stays as it is. Rows of ``state`` are changed in place."""
        import jax

        leaves, tree = jax.tree.flatten(state)
        places = {k: self.variable() for k, x in enumerate(leaves) if not isinstance(x, Row)}
        truths = {k: self.lane(leaves[k]).truth for k in places}
        for k, place in places.items():
            self.stored(place, self.lane(leaves[k]))

        def here() -> Any:
            now = [self.loaded(places[k], truths[k]) if k in places else x for k, x in enumerate(leaves)]
            return now, jax.tree.unflatten(tree, now)

        with self._again(name) as (go_on, ended):
            before, old = here()
            mask = unfinished(old)
            bits = self.once(f"bitcast <{self.width} x i1> {mask.operand} to i{self.width}")
            self._branch(self.once(f"icmp ne i{self.width} {bits}, 0"), go_on, ended)
            for k, x in enumerate(jax.tree.leaves(advance(old))):
                if k in places:
                    self.stored(places[k], self.where(mask, x, before[k]))
        return here()[1]

    def repeat(self, times: int, advance: Callable[[Any], Any], state: Any) -> Any:
        """So many times in a row."""

        def next_one(numbered):
            number, now = numbered
            return number + 1.0, advance(now)

        first = self.lane(0.0), state
        return self.repeat_while(lambda numbered: numbered[0] < times, next_one, first, f"times.{times}.")[1]

    @contextmanager
    def _again(self, name: str) -> Iterator[tuple[str, str]]:
        label = f"{name}{self._new()[1:]}"
        self._lines += [f"br label %{label}", f"{label}:"]
        self._known.append({})
        self._loops.append(name)
        yield f"{label}.in", f"{label}.out"
        self._lines += [f"br label %{label}", f"{label}.out:", _LoopEnd()]
        self._loops.pop()
        self._known.pop()

    def _branch(self, condition: str, go_on: str, ended: str) -> None:
        self._lines += [f"br i1 {condition}, label %{go_on}, label %{ended}", f"{go_on}:", _LoopStart(self._loops[-1])]

    def later(self) -> list[Any]:
        """A place for instructions that are known only later."""
        place: list[Any] = []
        self._lines.append(place)
        return place

    # --- the whole

    def text(self) -> str:
        """The module: what no stored value depends on is left out."""
        lines = [part for line in self._lines for part in (line if isinstance(line, list) else [line])]
        live = self._live(lines)
        rows = str(self._rows)
        body = "\n  ".join([*self._entry, "br label %start", "start:", *live, "ret void"]).replace("ROWS", rows)
        declared = sorted({m for line in live for m in re.findall(r"call [a-z ]*?(<[^>]*> @llvm[.\w]+)\(", line)})
        functions = [f"declare {one}({', '.join([self.vector] * _arity(one))})" for one in declared]
        return "\n".join(
            [
                f"define i64 @{self.name}_rows() {{ ret i64 {rows} }}",
                f"define void @{self.name}(ptr %arrays, ptr %sizes, i64 %first, i64 %last, ptr noalias %scratch) "
                f'"min-legal-vector-width"="512" {{',
                f"entry:\n  {body}\n}}",
                *functions,
                "",
            ]
        )

    def _live(self, lines: Sequence[Any]) -> list[str]:
        needed: set[str] = set()
        live = []
        for line in reversed(lines):
            if isinstance(line, str):
                name, is_value, rest = line.partition(" = ")
                if not is_value or name in needed:
                    needed.update(_NAME.findall(rest if is_value else line))
                    live.append(line)
        self._count_operations(lines, needed)
        return live[::-1]

    def _count_operations(self, lines: Sequence[Any], needed: set[str]) -> None:
        self.operations.clear()
        path: list[str] = []
        for line in lines:
            if isinstance(line, _LoopStart):
                path.append(line.name)
            elif isinstance(line, _LoopEnd):
                path.pop()
            elif line.partition(" = ")[0] in needed and any(word in line for word in _OPERATIONS):
                self.operations[tuple(path)] += 1

    def _new(self) -> str:
        self._count += 1
        return f"%v{self._count}"


_NAME = re.compile(r"%[\w.]+")


class _LoopStart:
    def __init__(self, name: str):
        self.name = name


class _LoopEnd:
    pass


def _arity(function: str) -> int:
    return 2 if "imum" in function else 1


def width(dtype: DTypeLike) -> int:
    """Lanes of a block of such numbers."""
    return _REGISTER_BYTES // np.dtype(dtype).itemsize


def half_pi_parts(dtype: DTypeLike) -> list[float]:
    """pi/2 as a sum: two parts of few bits, and the rest."""
    parts, rest = [], _HALF_PI
    for number in range(1, 3):
        scale = Decimal(2) ** (_PART_BITS[np.dtype(dtype).itemsize] * number - 1)
        parts.append(float((rest * scale).to_integral_value() / scale))
        rest -= Decimal(parts[-1])
    return [*parts, float(rest)]
