"""Where does the time of one iteration of the adaptation go? A roofline of its machine code. Simulated subjects.

Counted: the instructions of one iteration of a block of eight subjects, by kind, in the assembly that LLVM makes of the
kernel, each times the runs of its loop (``roofline/counted.py``). Loads and stores that are not in LLVM's text are
spills.

Measured in CPU time, with the same compiler and threads: the peak performance of the machine (``roofline/reached.py``),
the kernel, and the kernel with other AVX-512 instructions instead of its divisions and square roots. The variants with
28 bits are not accurate: only the time of an iteration is useful.
"""

import copy
import os
import re
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path[:0] = [str(Path(__file__).parents[3]), str(Path(__file__).parents[3] / "tests" / "helpers")]

import numpy as np  # noqa: E402
import typer  # noqa: E402

from adapt.engine.kernel import Kernel  # noqa: E402
from adapt.engine.simd_values import REGISTER_BYTES  # noqa: E402
from adapt.solvers.newton.subject import Start, SubjectProblem  # noqa: E402
from adapt.solvers.newton.subjects import subjects_kernel  # noqa: E402
from scripts.reporting import markdown  # noqa: E402
from scripts.research.speed.roofline import counted, reached  # noqa: E402
from scripts.research.speed.side_by_side import first_iterations, prepared  # noqa: E402

BLOCK = 8
"""Subjects per register."""

_V = "<8 x double>"
_DIVISION = re.compile(rf"  (%v\d+) = fdiv contract {_V} (.+), ([^,\n]+)$", re.MULTILINE)
_ROOT = re.compile(rf"  (%v\d+) = call {_V} @llvm\.sqrt\.v8f64\({_V} ([^)\n]+)\)$", re.MULTILINE)

app = typer.Typer(add_completion=False)


def with_reciprocals(text: str, steps: int) -> str:
    """Replace divisions by AVX-512's 14-bit reciprocal and so many Newton steps.

    After two steps and a correction of the quotient the result is the same to rounding, except for divisors that are 0
    or infinite; one step leaves 28 bits.
    """

    def quotient(found: re.Match[str]) -> str:
        q, a, b = found.groups()
        lines = [f"{q}.m = fneg {_V} {b}", f"{q}.r0 = {_estimate('rcp14', b)}"]
        for k in range(steps):
            lines.append(f"{q}.e{k} = {_fma(f'{q}.m', f'{q}.r{k}', 'splat (double 1.0)')}")
            lines.append(f"{q}.r{k + 1} = {_fma(f'{q}.r{k}', f'{q}.e{k}', f'{q}.r{k}')}")
        if steps == 1:
            return "\n".join([*lines, f"{q} = fmul contract {_V} {a}, {q}.r1"])
        lines.append(f"{q}.q = fmul {_V} {a}, {q}.r2")
        lines.append(f"{q}.rest = {_fma(f'{q}.m', f'{q}.q', a)}")
        return "\n".join([*lines, f"{q} = {_fma(f'{q}.rest', f'{q}.r2', f'{q}.q')}"])

    return _declared(_DIVISION.sub(quotient, text), "rcp14")


def with_estimated_roots(text: str) -> str:
    """Replace square roots by x / sqrt(x) from AVX-512's 14-bit estimate and one Newton step, which leaves 28 bits."""

    def root(found: re.Match[str]) -> str:
        y, x = found.groups()
        return "\n".join(
            [
                f"{y}.x = call {_V} @llvm.maxnum.v8f64({_V} {x}, {_V} splat (double 0x0010000000000000))",
                f"{y}.r = {_estimate('rsqrt14', f'{y}.x')}",
                f"{y}.s = fmul {_V} {y}.x, {y}.r",
                f"{y}.h = fmul {_V} {y}.s, splat (double -0.5)",
                f"{y}.e = {_fma(f'{y}.h', f'{y}.r', 'splat (double 0.5)')}",
                f"{y} = {_fma(f'{y}.s', f'{y}.e', f'{y}.s')}",
            ]
        )

    return _declared(_ROOT.sub(root, text), "rsqrt14") + f"declare {_V} @llvm.maxnum.v8f64({_V}, {_V})\n"


def _fma(a: str, b: str, c: str) -> str:
    return f"call {_V} @llvm.fma.v8f64({_V} {a}, {_V} {b}, {_V} {c})"


def _estimate(what: str, x: str) -> str:
    return f"call {_V} @llvm.x86.avx512.{what}.pd.512({_V} {x}, {_V} zeroinitializer, i8 -1)"


def _declared(text: str, estimate: str) -> str:
    fma = f"declare {_V} @llvm.fma.v8f64({_V}, {_V}, {_V})\n"
    text = text if fma.strip() in text else text + fma
    return f"{text}declare {_V} @llvm.x86.avx512.{estimate}.pd.512({_V}, {_V}, i8)\n"


VARIANTS: dict[str, Callable[[str], str]] = {
    "as it is": lambda text: text,
    "refined reciprocals for divisions": lambda text: with_reciprocals(text, 2),
    "reciprocals of 28 bits": lambda text: with_reciprocals(text, 1),
    "roots of 28 bits": with_estimated_roots,
    "both of 28 bits": lambda text: with_estimated_roots(with_reciprocals(text, 1)),
}


def variant(edit: Callable[[str], str]) -> Kernel:
    """Make the subject sweep from its edited text."""
    kernel = copy.copy(subjects_kernel)
    kernel._functions = {}
    kernel.name = f"edited{zlib.crc32(edit(subjects_kernel.build().text()).encode())}"  # key of compiled code
    text = edit(kernel.build().text())
    kernel.build = lambda _: SimpleNamespace(text=lambda: text)  # pyright: ignore[reportAttributeAccessIssue]
    return kernel


def iteration_us(kernel: Kernel, given: Any) -> float:
    """Measure microseconds of a core per iteration of a block, which iterates until its last subject has ended."""
    blocks = kernel.native(*given).iterations.reshape(-1, BLOCK).max(axis=1).sum()
    return reached.core_seconds(lambda: kernel.native(*given)) * (os.cpu_count() or 1) / float(blocks) * 1e6


def without_padding(given: tuple[SubjectProblem, Start, np.ndarray]) -> tuple[SubjectProblem, Start, np.ndarray]:
    """Drop the trailing postures that count for no subject."""
    problem, (theta, angles, multipliers, converged), iterations = given
    last = int(np.any(problem.counted, axis=-1).sum())
    cut = {name: getattr(problem, name)[..., :last, :] for name in ("angles", "weights", "counted")}
    start = theta, angles[..., :last, :], multipliers[..., :last, :], converged
    return problem._replace(**cut), start, iterations


def spread(values: list[float]) -> str:
    """Format median, minimum and maximum."""
    return f"{np.median(values):.3g} ({min(values):.3g}-{max(values):.3g})"


REACHED: dict[str, Callable[[], float]] = {
    "multiply-adds, GFLOP/s": reached.peak_gflops,
    "a division, ns a core": reached.division_ns,
    "a square root, ns a core": reached.root_ns,
    "first cache, GB/s": lambda: reached.cache_gb_s(24),
    "second cache, GB/s": lambda: reached.cache_gb_s(600),
    "memory, GB/s": reached.memory_gb_s,
}


@app.command()
def roofline(
    model: str = "R2",
    subjects: Annotated[int, typer.Option(min=64, help="In blocks of eight.")] = 4096,
    repeats: Annotated[int, typer.Option(min=1)] = 7,
) -> None:
    """Count the instructions of an iteration, measure, and print."""
    data = prepared(model, subjects // BLOCK * BLOCK)
    given = first_iterations(data)
    runs = {name: (variant(edit), given) for name, edit in VARIANTS.items()}
    runs["without padding postures"] = subjects_kernel, without_padding(given)
    rows: dict[str, list[float]] = {name: [] for name in [*REACHED, *runs]}
    for _ in range(repeats):
        for name, measure in REACHED.items():
            rows[name].append(measure())
        for name, run in runs.items():
            rows[name].append(iteration_us(*run))
    postures, points = data.counted.shape[0], data.point_weights.shape[0]
    print_counts(postures, points)
    print(markdown(("what the machine reaches", "median (range)"), [(k, spread(rows[k])) for k in REACHED]), "\n")
    header = ("the kernel", "us an iteration of a block", "times as fast", "share of the peak")
    print(markdown(header, [(name, *speeds(rows, name, given, points)) for name, (_, given) in runs.items()]))


def print_counts(postures: int, points: int) -> None:
    """Print the counts of an iteration."""
    machine, asked = counted.machine_counts(postures, points), counted.text_memory(postures, points)
    operations = counted.operations_of_iteration(postures, points)
    chain = counted.longest_chain_cycles(postures, points)
    print(markdown(("instructions of an iteration of a block", "number"), [(k, f"{n}") for k, n in machine.items()]))
    print(f"\n{operations} operations a subject; the longest chains of a block take {chain:.0f} cycles\n")
    for what, counts in (("loaded and stored a block", machine), ("of which the text asks for", asked)):
        moved = REGISTER_BYTES * (counts["load"] + counts["store"])
        print(f"{what}: {moved / 1024:.0f} KiB, {operations * BLOCK / moved:.2f} operations a byte\n")


def speeds(rows: dict[str, list[float]], name: str, given: Any, points: int) -> tuple[str, str, str]:
    """Format microseconds, speed relative to the unedited kernel, and share of the peak."""
    operations = counted.operations_of_iteration(given[0].problem.counted.shape[0], points) * BLOCK
    faster = [a / b for a, b in zip(rows["as it is"], rows[name], strict=True)]
    per_core = [gflops / (os.cpu_count() or 1) for gflops in rows["multiply-adds, GFLOP/s"]]
    share = [operations / us / 1e3 / peak for us, peak in zip(rows[name], per_core, strict=True)]
    return spread(rows[name]), spread(faster), spread(share)


if __name__ == "__main__":
    app()
