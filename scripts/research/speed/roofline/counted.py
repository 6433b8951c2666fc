"""What one iteration of the subject sweep consists of, counted in LLVM's text and in the assembly made of it."""

import math
import re
from collections import Counter
from collections.abc import Iterator

import llvmlite.binding as llvm

from adapt.solvers.newton.subjects import subjects_kernel

_LABEL = re.compile(r"^\s*([a-z.0-9]+?)v\d+(\.in|\.out|):$")
"""Of a loop: where it asks whether to go on, what it repeats, and what follows."""

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
"""By the beginning of their names; the first that fits."""


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
"""Cycles until the value of an instruction on eight numbers is there, by the word in it: about those of Intel's cores
with AVX-512 (Fog, Instruction tables, Ice Lake); addresses and counters wait for nothing."""


def times_an_iteration(path: tuple[str, ...], postures: int, points: int) -> int:
    """How often the loops of this path run in one iteration; 0 outside the iterations."""
    if path[:2] != ("block", "while"):
        return 0
    lengths = {"posture": postures, "point": points, "while": 1}  # a second factor of a posture is seldom needed
    return math.prod(lengths[word] if word in lengths else int(word.split(".")[1]) for word in path[2:])


def operations_of_iteration(postures: int, points: int) -> int:
    """Additions, multiplications, divisions and roots of one iteration of one subject, counted in its machine code."""
    counts = subjects_kernel.build().count_operations()
    return sum(count * times_an_iteration(path, postures, points) for path, count in counts.items())


def text_memory(postures: int, points: int) -> Counter[str]:
    """Registers that a block's iteration loads and stores by LLVM's text."""
    total: Counter[str] = Counter()
    for path, line in _with_paths():
        if " = load <8 x double>" in line or line.lstrip().startswith("store <8 x double>"):
            total["load" if " = load" in line else "store"] += times_an_iteration(path, postures, points)
    return total


def machine_counts(postures: int, points: int) -> Counter[str]:
    """Instructions of a block's iteration by kind, and how many load or store a register, by themselves or within."""
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
    """Whether the instruction loads or stores a register of eight numbers; AT&T's operands have the result last."""
    if "(" not in operands or "zmm" not in operands or "{1to8}" in operands or not name.startswith("v"):
        return None
    return "store" if operands.rstrip().endswith(")") else "load"


def _with_paths() -> Iterator[tuple[tuple[str, ...], str]]:
    """The lines of the text with the loops that they are in; the question whether to go on is in its loop."""
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
    """The kernel's, with a comment at the start of each piece that names the loops around it."""
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
    )  # as in adapt/engine/machine_code.py
    return machine.emit_assembly(llvm.parse_assembly("\n".join(lines)))


def longest_chain_cycles(postures: int, points: int) -> float:
    """Cycles of an iteration of a block if each piece of the text took as long as its longest chain of values that need
    each other, and pieces came one after another. A product that becomes part of a multiply-add counts by itself."""
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
