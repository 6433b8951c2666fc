"""List of the instructions of one function: each value is computed once, and unused values are left out."""

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_COUNTED = ("fadd", "fsub", "fmul", "fdiv", "@llvm.sqrt", "@llvm.maximum", "@llvm.minimum")
"""Instructions that count as operations on numbers."""

_NAME = re.compile(r"%[\w.]+")


@dataclass(frozen=True)
class _LoopStart:
    name: str


class _LoopEnd:
    pass


_Line = str | _LoopStart | _LoopEnd


class InstructionList:
    """Instructions in order, with a separate list for the function's entry block. A line is ``%name = instruction``, or
    an instruction with a side effect."""

    def __init__(self) -> None:
        self.entry: list[str] = []
        self._lines: list[_Line | list[str]] = []
        self._available: list[dict[str, str]] = [{}]
        self._loops: list[str] = []
        self._names = 0

    def new_name(self) -> str:
        """Return a name that no value has yet."""
        self._names += 1
        return f"%v{self._names}"

    def append(self, *lines: str) -> None:
        """Append lines unchanged."""
        self._lines += lines

    def compute(self, instruction: str) -> str:
        """Return the name of the instruction's value, and reuse a value of this or an enclosing loop."""
        for values in self._available:
            if instruction in values:
                return values[instruction]
        name = self._available[-1][instruction] = self.new_name()
        self.append(f"{name} = {instruction}")
        return name

    def insertion_point(self) -> list[str]:
        """Return a list whose lines will stand here, for instructions that are known only later."""
        lines: list[str] = []
        self._lines.append(lines)
        return lines

    @contextmanager
    def loop(self, name: str) -> Iterator[tuple[str, str]]:
        """Repeat the lines written within; ``enter_if`` takes the labels and ends the part that runs before each
        iteration.

        Values computed within are not available after the loop.
        """
        label = f"{name}{self.new_name()[1:]}"
        self.append(f"br label %{label}", f"{label}:")
        self._available.append({})
        self._loops.append(name)
        yield f"{label}.in", f"{label}.out"
        self.append(f"br label %{label}", f"{label}.out:")
        self._lines.append(_LoopEnd())
        self._loops.pop()
        self._available.pop()

    def enter_if(self, condition: str, labels: tuple[str, str]) -> None:
        """Start another iteration of the loop with these labels if the condition holds, or leave the loop."""
        inside, outside = labels
        self.append(f"br i1 {condition}, label %{inside}, label %{outside}", f"{inside}:")
        self._lines.append(_LoopStart(self._loops[-1]))

    def live(self) -> list[str]:
        """Return the lines with side effects, and the lines of all values on which these depend."""
        needed = self._needed()
        return [line for line in self._flat() if isinstance(line, str) and _is_live(line, needed)]

    def count_operations(self) -> Counter[tuple[str, ...]]:
        """Count the live operations on numbers, keyed by the loops around them, outermost first."""
        needed, path = self._needed(), []
        operations: Counter[tuple[str, ...]] = Counter()
        for line in self._flat():
            if isinstance(line, _LoopStart):
                path.append(line.name)
            elif isinstance(line, _LoopEnd):
                path.pop()
            elif line.partition(" = ")[0] in needed and any(word in line for word in _COUNTED):
                operations[tuple(path)] += 1
        return operations

    def _flat(self) -> list[_Line]:
        return [part for line in self._lines for part in (line if isinstance(line, list) else [line])]

    def _needed(self) -> set[str]:
        """Return the names that live lines read, scanning backwards: a value is written before it is read."""
        needed: set[str] = set()
        for line in reversed(self._flat()):
            if isinstance(line, str) and _is_live(line, needed):
                name, is_value, read = line.partition(" = ")
                needed.update(_NAME.findall(read if is_value else name))
        return needed


def _is_live(line: str, needed: set[str]) -> bool:
    name, is_value, _ = line.partition(" = ")
    return not is_value or name in needed
