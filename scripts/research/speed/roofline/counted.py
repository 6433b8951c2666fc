"""Counts of the operations in one iteration of the subject sweep, from LLVM's text and from its assembly."""

import math
import re
from collections import Counter
from collections.abc import Iterator

import llvmlite.binding as llvm

from adapt.solvers.newton.subjects import subjects_kernel

_LABEL = re.compile(r"^\s*([a-z.0-9]+?)v\d+(\.in|\.out|):$")
"""Label of a loop: its condition, its body (.in), and what follows it (.out)."""

_MARK = re.compile(r"MARK (\S+)")
_KINDS = (
    ("multiply-add", re.compile(r"vfn?m(add|sub)\d+pd")),
    ("addition, multiplication", re.compile(r"v(add|sub|mul)pd")),
    ("division", re.compile(r"vdivpd")),
    ("square root", re.compile(r"vsqrtpd")),
    ("move between registers or memory", re.compile(r"v(mov|broadcast)")),
    ("other on registers (compare, select, maximum)", re.compile(r"[vk]")),
    ("address, counter, jump", re.compile(r"")),
)
"""Kinds of instructions by the beginning of their names; the first match counts."""


_NAME = re.compile(r"%[\w.]+")
_LATENCY = {
    "fdiv": 24.0,
    "@llvm.sqrt": 32.0,
    "fmul": 4.0,
    "fadd": 4.0,
    "fsub": 4.0,
    "@llvm.": 4.0,
    "fcmp": 4.0,
    "select": 2.0,
    "load <8 x double>": 7.0,
    "": 0.0,
}
"""Latency in cycles of instructions on eight numbers, by a word in the instruction: approximately as on Intel's cores
with AVX-512 (Fog, Instruction tables, Ice Lake). Addresses and counters have no latency."""


def times_an_iteration(path: tuple[str, ...], postures: int, points: int) -> int:
    """Compute how often the innermost of these nested loops runs in one iteration; 0 outside the iterations."""
    if path[:2] != ("block", "while"):
        return 0
    lengths = {"posture": postures, "point": points, "while": 1}  # a second factorisation of a posture is rarely needed
    return math.prod(lengths[word] if word in lengths else int(word.split(".")[1]) for word in path[2:])


def operations_of_iteration(postures: int, points: int) -> int:
    """Count additions, multiplications, divisions and roots of one iteration of one subject in its machine code."""
    counts = subjects_kernel.build().count_operations()
    return sum(count * times_an_iteration(path, postures, points) for path, count in counts.items())


def text_memory(postures: int, points: int) -> Counter[str]:
    """Count the registers that a block's iteration loads and stores according to LLVM's text."""
    total: Counter[str] = Counter()
    for path, line in _with_paths():
        if " = load <8 x double>" in line or line.lstrip().startswith("store <8 x double>"):
            total["load" if " = load" in line else "store"] += times_an_iteration(path, postures, points)
    return total


def machine_counts(postures: int, points: int) -> Counter[str]:
    """Count the instructions of a block's iteration by kind, and the loads and stores of registers, also operands."""
    total: Counter[str] = Counter()
    times = 0
    for line in _assembly().splitlines():
        if mark := _MARK.search(line):
            times = times_an_iteration(tuple(mark[1].split("/")), postures, points)
        elif times and re.match(r"\t[a-z]", line):
            name, _, operands = line.strip().partition("\t")
            total[next(kind for kind, pattern in _KINDS if pattern.match(name))] += times
            if memory := _memory(name, operands):
                total[memory] += times
    return total


def _memory(name: str, operands: str) -> str | None:
    """Return "load" or "store" for an access to memory with a register of eight numbers; AT&T: the last operand is the
    result."""
    if "(" not in operands or "zmm" not in operands or "{1to8}" in operands or not name.startswith("v"):
        return None
    return "store" if operands.rstrip().endswith(")") else "load"


def _with_paths() -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the lines of the text with their enclosing loops; the condition of a loop belongs to the loop."""
    path: tuple[str, ...] = ()
    for line in subjects_kernel.build().text().splitlines():
        label = _LABEL.match(line)
        if label is None:
            yield path, line
        elif label[2] == ".out":
            path = path[:-1]
            yield path, line
        else:
            path = path if label[2] else (*path, label[1])
            yield path, line


def _assembly() -> str:
    """Compile the kernel to assembly, with a comment at the start of each block that names the loops around it."""
    lines = []
    for path, line in _with_paths():
        lines.append(line)
        if _LABEL.match(line):
            lines.append(f'call void asm sideeffect "# MARK {"/".join(path) or "-"}", ""()')
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.initialize_native_asmparser()
    features = llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=2, jit=True
    )  # the same options as in adapt/engine/machine_code.py
    return machine.emit_assembly(llvm.parse_assembly("\n".join(lines)))


def longest_chain_cycles(postures: int, points: int) -> float:
    """Compute the cycles of a block's iteration if each piece of the text took as long as its longest dependency chain.

    The pieces follow one another. A product that becomes part of a multiply-add counts separately.
    """
    ready: dict[str, float] = {}
    total, piece, deepest, times = 0.0, (), 0.0, 0
    for path, line in _with_paths():
        if path != piece or _LABEL.match(line):
            total += deepest * times
            ready, deepest, piece, times = {}, 0.0, path, times_an_iteration(path, postures, points)
        name, is_value, instruction = line.strip().partition(" = ")
        if is_value:
            start = max((ready.get(one, 0.0) for one in _NAME.findall(instruction)), default=0.0)
            ready[name] = start + next(cycles for word, cycles in _LATENCY.items() if word in instruction)
            deepest = max(deepest, ready[name])
    return total + deepest * times
