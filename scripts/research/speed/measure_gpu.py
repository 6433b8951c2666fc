"""Run the adaptation on a GPU, by XLA and by PTX from the kernel's own text; compare results and speed with the CPU.

Runs unattended in a few minutes. The script simulates its own subjects, adapts them on each platform in a separate
process, compares the results with the machine code on the CPU and writes a table as Markdown and as JSON. Without a GPU
it measures the CPU alone and says so.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated, Any

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT)]

import jax  # noqa: E402
import numpy as np  # noqa: E402
import typer  # noqa: E402

from adapt.engine.kernel import Kernel  # noqa: E402
from adapt.solvers.newton.subjects import subjects_kernel  # noqa: E402
from adapt.solvers.problems import Problems, problems_of  # noqa: E402
from adapt.solvers.rows import posture_rows  # noqa: E402
from models import load_model  # noqa: E402
from motions.rhythm_subjects import simulate_subjects  # noqa: E402
from scripts.research.speed.one_start import solved_from_geometric_fit  # noqa: E402
from scripts.research.speed.ptx_kernel import STAGES, run_on_gpu  # noqa: E402

SAME = 1e-8
"""Largest relative difference of a parameter between float64 on two devices."""

SEED = 5

PTX = "ptx"
"""Name of the GPU by PTX, beside the names of JAX's platforms."""

REPEATS = 3

DIFFERENT = 65536
"""Number of different simulated subjects. Larger counts repeat them: simulating more would dominate the run time."""

app = typer.Typer(add_completion=False)


@app.command()
def measure(
    out: Annotated[Path, typer.Option(help="Folder for gpu.md and gpu.json.")] = Path("out/gpu"),
    model: str = "R2",
    sizes: Annotated[str, typer.Option(help="Numbers of simulated subjects.")] = "1024,16384,65536,1048576",
    worker: Annotated[str, typer.Option(hidden=True)] = "",
) -> None:
    """Measure and compare all platforms of this machine."""
    counts = [int(word) for word in sizes.split(",")]
    if worker:
        if worker not in ("cpu", PTX):
            counts = [one for one in counts if one <= DIFFERENT]  # XLA takes minutes for a million
            Kernel.__call__ = Kernel.by_jax  # otherwise a kernel runs as machine code, even with a GPU
        print(json.dumps(_measured(model, counts, out / f"{worker}.npy")))
        return
    out.mkdir(parents=True, exist_ok=True)
    platforms = ["cpu", *_accelerators()]
    found = {platform: _in_its_own_process(platform, model, sizes, out) for platform in platforms}
    results = {platform: np.load(out / f"{platform}.npy") for platform in platforms}
    off = {
        platform: _difference(results[platform], results["cpu"][:, : results[platform].shape[1]])
        for platform in platforms[1:]
    }
    text = _table(model, found, off)
    (out / "gpu.md").write_text(text)
    (out / "gpu.json").write_text(json.dumps({"platforms": found, "against_cpu": off}, indent=2) + "\n")
    print(text)
    if any(one["different"] for one in off.values()):
        raise typer.Exit(1)


def _accelerators() -> list[str]:
    """List the accelerators, asking JAX in a separate process so that the device is released."""
    code = "import jax; print(jax.default_backend())"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names = [name for name in ended.stdout.split() if name != "cpu"]
    return [*names, PTX] if names else []


def _in_its_own_process(platform: str, model: str, sizes: str, out: Path) -> dict[str, Any]:
    command = [sys.executable, __file__, "--worker", platform, "--model", model, "--sizes", sizes, "--out", str(out)]
    # Names of plugins and the platform names that they report differ; by default JAX takes the GPU.
    environment = os.environ | ({"JAX_PLATFORMS": "cpu"} if platform in ("cpu", PTX) else {})
    ended = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(ended.stdout.splitlines()[-1])


def _measured(model: str, counts: list[int], path: Path) -> dict[str, Any]:
    """Time the adaptation by number of subjects, the first run separately; save the last theta and convergence."""
    seconds, first, stages = {}, {}, {}
    start = time.perf_counter()
    on_gpu = run_on_gpu([subjects_kernel]) if path.stem == PTX else {}
    compilation_s = time.perf_counter() - start
    solved = None
    for count in counts:
        data = _simulated(model, count)
        start = time.perf_counter()
        solved_from_geometric_fit(data)
        first[count] = time.perf_counter() - start + compilation_s
        compilation_s = 0.0
        for one in on_gpu.values():
            one.seconds.clear()
        taken = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            solved = solved_from_geometric_fit(data)
            taken.append(time.perf_counter() - start)
        seconds[count] = {"median": float(np.median(taken)), "least": min(taken), "most": max(taken)}
        stages[count] = {stage: s / REPEATS for one in on_gpu.values() for stage, s in one.seconds.items()}
    assert solved is not None
    np.save(path, np.vstack([solved.theta, solved.converged]))
    devices = [str(device) for device in jax.devices()] if path.stem != PTX else ["GPU 0"]
    return {"devices": devices, "seconds": seconds, "first_s": first, "stages_s": stages, "cores": os.cpu_count()}


def _simulated(model: str, count: int) -> Problems:
    data = problems_of(posture_rows(simulate_subjects(min(count, DIFFERENT), seed=SEED)), [load_model(model)])
    return jax.tree.map(lambda x: np.tile(x, -(-count // DIFFERENT))[..., :count], data)


def _difference(found: np.ndarray, expected: np.ndarray) -> dict[str, Any]:
    """Summarise the relative differences of the parameters where both runs converged."""
    both = (found[-1] > 0) & (expected[-1] > 0)
    off = np.abs(found[:-1, both] / expected[:-1, both] - 1.0).max(axis=0)
    return {
        "subjects": int(both.sum()),
        "converged": [float(np.mean(found[-1])), float(np.mean(expected[-1]))],
        "median": float(np.median(off)),
        "largest": float(off.max()),
        "different": int((off > SAME).sum()),
    }


def _table(model: str, found: dict[str, Any], off: dict[str, Any]) -> str:
    lines = [
        f"Adaptation of simulated subjects (14 postures each) with {model}, float64, one start; seconds are the median "
        f"of {REPEATS} (least-most), without compilation.",
        "",
        "| platform | devices | subjects | seconds | subjects a second | kernel, s | transfers, s | first run, s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for platform, one in found.items():
        for count, s in one["seconds"].items():
            took = f"{s['median']:.2f} ({s['least']:.2f}-{s['most']:.2f})"
            rate = f"{int(count) / s['median']:.0f}"
            within = " | ".join(f"{x:.3f}" if (x := one["stages_s"][count].get(y)) else "" for y in STAGES)
            first = one["first_s"][count]
            devices = ", ".join(one["devices"])
            lines.append(f"| {platform} | {devices} | {count} | {took} | {rate} | {within} | {first:.1f} |")
    lines.append("")
    if not off:
        lines.append("JAX sees no GPU here: this is the CPU alone, and nothing was compared.")
    for platform, one in off.items():
        lines.append(
            f"{platform} against cpu, {one['subjects']} subjects: parameters differ by {one['median']:.1e} (median), "
            f"{one['largest']:.1e} (largest, relative); {one['different']} by more than {SAME:.0e}."
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    app()
