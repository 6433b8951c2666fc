"""Mutation testing of the numerical core: put in one small fault at a time and see whether the tests notice it.

``python scripts/mutate_core.py --mutants 40 --seed 1`` draws so many mutants of each file in TESTS_OF, runs the tests
of the file on each mutant, the quickest first, until one fails, and prints the mutants that survived. A mutant is
killed if a test fails or the tests take PATIENCE times as long as on the unchanged project.

Every mutant is put into a separate copy of the project and tested in a process of its own. The working tree therefore
stays as it is, and functions with decorators (custom derivatives, all compiled functions) are mutated too.
"""

import ast
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated
from xml.etree import ElementTree

import pytest
import typer
from numpy.random import PCG64, Generator
from rich.console import Console
from rich.progress import track
from rich.table import Table

ROOT = Path(__file__).parents[1]

TESTS_OF = {
    "motions/rotations.py": ["tests/motions/test_motions_rotations.py"],
    "adapt/engine/function_builder.py": ["tests/engine/test_machine.py"],
    "adapt/engine/instructions.py": ["tests/engine/test_machine.py"],
    "adapt/engine/trigonometry.py": ["tests/engine/test_machine.py"],
    "adapt/engine/axes.py": ["tests/engine/test_machine.py"],
    "adapt/engine/jax_program.py": ["tests/engine/test_jax_program.py"],
    "models/ellipsoid.py": ["tests/models/test_ellipsoid.py"],
    "models/girdle.py": ["tests/models/test_girdle.py"],
    "models/derivatives.py": ["tests/models/test_derivatives.py"],
    "adapt/solvers/objective.py": ["tests/solvers/test_objective.py"],
    "adapt/solvers/newton/elimination.py": ["tests/solvers/test_elimination.py"],
    "adapt/solvers/newton/backtracking.py": ["tests/solvers/test_backtracking.py"],
}
"""The quick tests of each file; slower ones, which fit whole subjects, would notice more mutants."""

PATIENCE, AT_LEAST_S = 5.0, 60.0
"""Time limit of the tests of a mutant, as a multiple of their normal time and in seconds at least.

A mutant that makes a loop longer or endless exceeds the limit; a busy machine does not.
"""

_ALL_PASSED, _SOME_FAILED, _INTERRUPTED = 0, 1, 2
"""Exit statuses of pytest: "interrupted" where a file cannot be imported. Other statuses are wrong calls of pytest."""

_NOT_ASSIGNED = "nothing assigns to it; a type checker sees who would"

_PROCESSES = multiprocessing.get_context("forkserver")
_PROCESSES.set_forkserver_preload(["pytest", "jax", "jax.numpy", "hypothesis", "jaxtyping", "scipy.optimize", "casadi"])
"""Every process starts with the slow imports done, and with no module of the project."""

_SAME_LENGTH = "both are of one length; strict only says so"

_OTHER_NAMES = "values and labels have other names, each its own"

_ANY_SHARE = "the way that a point is moved off a plane only has to be more than 0 and less than shows"

EQUIVALENT: dict[str, dict[str, str]] = {
    "adapt/solvers/newton/elimination.py": {
        "zero = xp.zeros_like(T[0][0]): 0 -> 1": ("all entries are of one shape"),
        "return product([m + 0.5 * s * x for m, s, x in zip(target, range_space_penalty, g, "
        "strict=True)], g): True -> False": _SAME_LENGTH,
        "return backward(self._S, [x * d for x, d in zip(forward(self._S, b), "
        "self._S_inverse, strict=True)]): True -> False": _SAME_LENGTH,
        "open_chain = [g + product(row, d) for g, row in zip(self.g, slopes, strict=True)]: "
        "True -> False": _SAME_LENGTH,
        "multipliers = [m - s * g for m, s, g in zip(mu, self.used, open_chain, "
        "strict=True)]: True -> False": _SAME_LENGTH,
        "inverse = [xp.where(self.convex, x, 1.0 / w) for x, w in zip(inverse, damped,"
        " strict=True)]: True -> False": _SAME_LENGTH,
    },
    "adapt/engine/instructions.py": {
        "@dataclass(frozen=True): True -> False": _NOT_ASSIGNED,
        "self._names = 0: 0 -> 1": _OTHER_NAMES,
        "self._names += 1: 1 -> 2": _OTHER_NAMES,
        'label = f"{name}{self.new_name()[1:]}": 1 -> 2': _OTHER_NAMES,
    },
    "adapt/engine/trigonometry.py": {
        "_SERIES = {8: 9, 4: 6}: 9 -> 10": "one term more than rounding shows",
        "for place in range(1, 3):: 3 -> 4": "one part more than is needed",
    },
    "adapt/engine/axes.py": {
        "return [self._builder.where(taken, a, b) for a, b in zip(new, before, strict=True)]: "
        "True -> False": _SAME_LENGTH,
    },
    "models/ellipsoid.py": {
        "return (step + 1, *newton(tau)): step + 1 -> step - 1": (
            "the count only ends a loop that does not converge; no point is known that does not"
        ),
        "return (step + 1, *newton(tau)): 1 -> 2": ("30 steps are more than the 25 that any point needs"),
        "return repeat_while(unfinished, again, (0, tau, S))[1]: 0 -> 1": ("59 steps are, too"),
        "for _ in range(_UNROLLED_STEPS - 1):: _UNROLLED_STEPS - 1 -> _UNROLLED_STEPS + 1": (
            "two steps more, for nothing"
        ),
        "xp.where(abs(x) > _OFF_PLANE * y, x, xp.where(x < 0.0, -_OFF_PLANE * y, _OFF_PLANE *"
        " y)): -_OFF_PLANE * y -> -_OFF_PLANE / y": _ANY_SHARE,
        "xp.where(abs(x) > _OFF_PLANE * y, x, xp.where(x < 0.0, -_OFF_PLANE * y, _OFF_PLANE *"
        " y)): _OFF_PLANE * y -> _OFF_PLANE / y": _ANY_SHARE,
        "return (step < _MAX_STEPS) & xp.any(abs(S - 1.0) > _LAST_STEP.for_dtype_of(S)): 1.0 -> 1.5": (
            "all steps are taken, the later ones for nothing"
        ),
        "_OFF_PLANE = 1e-13: 1e-13 -> 1.5000000000000002e-13": _ANY_SHARE,
        "p = p + xp.where(p < 0.0, -_OFF_PLANE, _OFF_PLANE) * a: xp.where(p < 0.0, "
        "-_OFF_PLANE, _OFF_PLANE) * a -> xp.where(p < 0.0, -_OFF_PLANE, _OFF_PLANE) / a": _ANY_SHARE,
    },
    "models/girdle.py": {
        "@dataclass(frozen=True): True -> False": _NOT_ASSIGNED,
        "return length, jnp.sum(v * dv, axis=0) / jnp.where(length > 0.0, length, 1.0): 1.0 -> 1.5": (
            "only where v = 0, which makes the numerator 0"
        ),
    },
}
"""Reasons why a surviving mutant changes no result, by file and :attr:`Mutant.place`."""

_BINARY = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult}
_COMPARED = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_CALLED = {"sin": "cos", "cos": "sin", "max": "min", "min": "max", "maximum": "minimum", "minimum": "maximum"}
_CALLED |= {"any": "all", "all": "any", "abs": "negative", "sqrt": "square", "zeros_like": "ones_like"}


@dataclass(frozen=True)
class Mutant:
    """One change of one file."""

    file: str
    line: int
    old: str
    new: str
    source: str
    """Text of the whole changed file."""

    text: str
    """The line before the change."""

    @property
    def name(self) -> str:
        return f"{self.file}:{self.line}: {self.old} -> {self.new}"

    @property
    def place(self) -> str:
        """Identify the mutant within its file without its line number."""
        return f"{self.text}: {self.old} -> {self.new}"


def mutants(file: str, source: str) -> list[Mutant]:
    """List every mutant of a file: a changed operator, number, sign, comparison or function name."""
    tree = ast.parse(source)
    types = _annotations(tree)
    found = []
    for place in ast.walk(tree):
        if isinstance(place, ast.expr) and id(place) not in types:
            for changed in map(ast.unparse, _changes(place)):
                text = _spliced(source, place, f"({changed})")
                line = source.splitlines()[place.lineno - 1].strip()
                found.append(Mutant(file, place.lineno, ast.unparse(place), changed, text, line))
    return found


def _spliced(source: str, place: ast.expr, new: str) -> str:
    """Replace the text of a node in the source. Column offsets count bytes."""
    lines = source.encode().splitlines(keepends=True)
    starts = [sum(map(len, lines[:k])) for k in range(len(lines))]
    assert place.end_lineno is not None
    assert place.end_col_offset is not None
    begin, end = starts[place.lineno - 1] + place.col_offset, starts[place.end_lineno - 1] + place.end_col_offset
    content = source.encode()
    return (content[:begin] + new.encode() + content[end:]).decode()


def _annotations(tree: ast.AST) -> set[int]:
    """Return the ids of all nodes of type annotations, which are not mutated: pyright checks types, not the tests."""
    roots = [getattr(node, key, None) for node in ast.walk(tree) for key in ("annotation", "returns")]
    return {id(node) for root in roots if root is not None for node in ast.walk(root)}


def _changes(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.BinOp(left, op, right) if type(op) in _BINARY:
            yield ast.BinOp(left, _BINARY[type(op)](), right)
        case ast.Compare(left, [op], right) if type(op) in _COMPARED:
            yield ast.Compare(left, [_COMPARED[type(op)]()], right)
        case ast.UnaryOp(ast.USub() | ast.Not() | ast.Invert(), operand):
            yield operand
        case ast.Constant(bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(float(value)):
            yield ast.Constant(value * 1.5 if value else 1.0)
        case ast.Call(ast.Attribute(value, str(name), context), arguments, keywords) if name in _CALLED:
            yield ast.Call(ast.Attribute(value, _CALLED[name], context), arguments, keywords)


@dataclass(frozen=True)
class Tests:
    """The tests of one file, the quickest first, and the time limit of a mutant."""

    names: list[str]
    longest_s: float


def tests_of(file: str, folder: Path) -> Tests:
    """Time the tests of a file on the unchanged project, where they must pass."""
    report = folder / "report.xml"
    began = time.monotonic()
    assert _passes(folder, [*TESTS_OF[file], f"--junitxml={report}"], None), f"the tests of {file} fail as it is"
    took_s = time.monotonic() - began
    cases = sorted(ElementTree.parse(report).iter("testcase"), key=lambda case: float(case.attrib["time"]))
    names = [f"{case.attrib['classname'].replace('.', '/')}.py::{case.attrib['name']}" for case in cases]
    return Tests(names, max(AT_LEAST_S, PATIENCE * took_s))


def survives(mutant: Mutant, tests: Tests, folder: Path) -> bool:
    """Check whether all tests pass on the copy of the project with the mutant; the file is restored afterwards."""
    path = folder / mutant.file
    whole = path.read_bytes()
    path.write_text(mutant.source)
    try:
        return _passes(folder, tests.names, tests.longest_s)
    finally:
        path.write_bytes(whole)


def _passes(folder: Path, arguments: list[str], longest_s: float | None) -> bool:
    """Check whether the tests pass on the packages in the folder, instead of the installed ones."""
    process = _PROCESSES.Process(target=_test, args=(folder, arguments))
    process.start()
    process.join(longest_s)
    if process.is_alive():
        process.kill()
        process.join()
        return False
    assert process.exitcode in (_ALL_PASSED, _SOME_FAILED, _INTERRUPTED), f"pytest ended with {process.exitcode}"
    return process.exitcode == _ALL_PASSED


def _test(folder: Path, arguments: list[str]) -> None:
    """Run pytest in a process that has the libraries loaded but no module of the project."""
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(folder))
    os.chdir(folder)
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    os._exit(pytest.main(["-x", "-n", "0", "-p", "no:cacheprovider", "--assert=plain", *arguments]))


def _copied(folder: Path) -> Path:
    for name in ("adapt", "models", "motions", "scripts", "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def main(
    mutants_to_try: Annotated[int, typer.Option("--mutants", min=1, help="How many of each file.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="The same seed draws the same ones.")] = 1,
    jobs: Annotated[int, typer.Option(min=1, help="How many at once.")] = 2,
    only: Annotated[list[str], typer.Option(help="One of the files; repeatable. Else all.")] = list(TESTS_OF),  # noqa: B006
) -> None:
    """Draw mutants of the numerical core and name those that no test notices."""
    every, drawn = [], []
    for file in only:
        there = mutants(file, (ROOT / file).read_text())
        order = Generator(PCG64(seed)).permutation(len(there))[:mutants_to_try]
        every += there
        drawn += [there[k] for k in sorted(order)]
    with tempfile.TemporaryDirectory() as home:
        free: SimpleQueue[Path] = SimpleQueue()
        for number in range(jobs):
            free.put(_copied(Path(home) / str(number)))
        whole = free.get()
        tests = {file: tests_of(file, whole) for file in only}
        free.put(whole)

        def tried(mutant: Mutant) -> bool:
            folder = free.get()
            try:
                return survives(mutant, tests[mutant.file], folder)
            finally:
                free.put(folder)

        survivors = []
        with ThreadPoolExecutor(jobs) as threads:
            outcome = track(threads.map(tried, drawn), "mutants", len(drawn), console=Console(stderr=True))
            for mutant, alive in zip(drawn, outcome, strict=True):
                if alive:  # printed at once: a run takes an hour, and may be stopped
                    print(_said(mutant), flush=True)
                    survivors.append(mutant)
    _print(every, drawn, survivors)


def _print(every: list[Mutant], drawn: list[Mutant], survivors: list[Mutant]) -> None:
    table = Table("file", *(f"[right]{word}" for word in ("mutants", "tried", "killed", "equivalent", "survived")))
    equivalent = [one for one in survivors if one.place in EQUIVALENT.get(one.file, {})]
    counts = [Counter(one.file for one in some) for some in (every, drawn, survivors, equivalent)]
    for file in dict.fromkeys(one.file for one in every):
        there, tried, alive, same = (count[file] for count in counts)
        table.add_row(file, *(f"{number}" for number in (there, tried, tried - alive, same, alive - same)))
    Console().print(table)


def _said(survivor: Mutant) -> str:
    why = EQUIVALENT.get(survivor.file, {}).get(survivor.place)
    return f"survived: {survivor.name}" + (f" (equivalent: {why})" if why else "")


if __name__ == "__main__":
    typer.run(main)
