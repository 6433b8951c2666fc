"""Our fits and the peers side by side in one run, on the same simulated subjects and from the same start.

Peers in their best practical form: CasADi/IPOPT on the whole-subject problem with exact derivatives, its function built
once and warm, one process a core; SciPy's SLSQP with analytic derivatives, one process a core; SciPy's L-BFGS-B through
jaxopt on the nested objective, compiled. Every time excludes building, compilation and the preparation of inputs. E of
both is compared subject by subject. Ratios are medians over the repeats, beside the least and the most.

The machine code of ``adapt.engine`` has a peer of its own: XLA, given the same text of the subject sweep and the same
iterations (``machine_code_vs_xla``; CONTRIBUTING says at which ratio the compiler of ``adapt.engine`` goes).
"""

import json
import math
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "helpers")]

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import typer  # noqa: E402
from oracles import bones, ipopt_call, slsqp  # noqa: E402  # pyright: ignore[reportMissingImports]

from adapt.engine.compilation_cache import keep_compiled  # noqa: E402
from adapt.engine.kernel import Kernel  # noqa: E402
from adapt.solvers.adaptation import solved_from_geometric_fit  # noqa: E402
from adapt.solvers.batched.subject import Fixed, Start  # noqa: E402
from adapt.solvers.batched.subject_kernels import subjects_kernel  # noqa: E402
from adapt.solvers.differentiable import nested_objective  # noqa: E402
from adapt.solvers.objective import WEIGHT, jitted_geometric_fit, thorax_distance_mm2  # noqa: E402
from adapt.solvers.padded_batch import pack  # noqa: E402
from adapt.solvers.posture_fits import fit_batch  # noqa: E402
from adapt.solvers.problem_batch import fixed_problem, problem_batch, select_problems  # noqa: E402
from models import load_model  # noqa: E402
from motions.arrays import repeat  # noqa: E402
from motions.rhythm_subjects import simulate_subjects  # noqa: E402
from motions.rotations import DEG  # noqa: E402
from scripts import measure_float32 as float32  # noqa: E402
from scripts.reporting import timed  # noqa: E402

SAME_E = 1e-6
"""Relative: two optima are one. IPOPT stops at 1e-10 of its scaled conditions."""

SEED = 5

app = typer.Typer(add_completion=False)


def ipopt_share(model: str, subjects: int, total: int, first: int, step: int) -> tuple[float, list[float]]:
    """In a process of its own: seconds for every step-th subject from ``first``, and E of each (NaN: failed)."""
    calls = list(_ipopt_calls(model, subjects, total))[first::step]
    solver, arguments = calls[0]
    for _ in range(3):
        solver(**arguments)
    values = []
    start = time.perf_counter()
    for solver, arguments in calls:
        found = solver(**arguments)
        values.append(float(found["f"]) if solver.stats()["success"] else np.nan)
    return time.perf_counter() - start, values


def _ipopt_calls(model: str, subjects: int, total: int):
    chosen = load_model(model)
    girdle = jitted_geometric_fit(chosen.girdle, jnp.asarray(chosen.points_mm))
    motions = simulate_subjects(total, seed=SEED)
    points, bounds, theta = (np.asarray(x) for x in (chosen.points_mm, chosen.bounds_mm, girdle.adapted_mm))
    for name in motions.subjects[:subjects]:
        target = motions.angles_deg[motions.subject == name].T
        yield ipopt_call(bones(girdle), points, target, theta, target, bounds)


def slsqp_share(model: str, postures: int, total: int, first: int, step: int) -> tuple[float, list[float]]:
    """In a process of its own: seconds for every step-th posture, and J of each."""
    known = bones(load_model(model).girdle)
    targets = simulate_subjects(total, seed=SEED).angles_deg[:postures][first::step]
    slsqp(known, targets[0], targets[0])
    values = []
    start = time.perf_counter()
    for target in targets:
        found = slsqp(known, target, target)
        values.append(found.j_deg2 if found.success else np.nan)
    return time.perf_counter() - start, values


def on_all_cores(
    share: Callable[..., tuple[float, list[float]]], model: str, count: int, total: int
) -> tuple[float, np.ndarray]:
    """Seconds of the slowest core, and the values of the first ``count`` of ``total`` simulated subjects in order."""
    cores = os.cpu_count() or 1
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        parts = pool.starmap(share, [(model, count, total, first, cores) for first in range(cores)])
    values = np.empty(count)
    for first, (_, part) in enumerate(parts):
        values[first::cores] = part
    return max(seconds for seconds, _ in parts), values


def values_of(data: Any, solved: Any) -> np.ndarray:
    """E of each lane."""
    D = thorax_distance_mm2(data.girdle.with_adapted(jnp.asarray(solved.theta)), data.points_mm, data.point_weights)
    j = jnp.mean((jnp.asarray(solved.angles) - data.angles) ** 2, axis=0) * DEG**2
    return np.asarray(D + WEIGHT * jnp.sum(jnp.where(data.counted, j, 0.0), axis=0) / jnp.sum(data.counted, axis=0))


def prepared(model: str, subjects: int):
    """The problems of simulated subjects."""
    return problem_batch(pack(simulate_subjects(subjects, seed=SEED)), [load_model(model)])


def nested_seconds(model: str, subjects: int) -> float:
    """Seconds a subject of L-BFGS-B on the nested objective (posture fits inside), from the geometric fit."""
    warnings.simplefilter("ignore", DeprecationWarning)
    import jaxopt

    chosen = load_model(model)
    points = jnp.asarray(chosen.points_mm)
    girdle = jitted_geometric_fit(chosen.girdle, points)

    def nested(theta, angles):
        return nested_objective(theta, girdle, points, angles, jnp.ones(angles.shape, bool), WEIGHT)

    both = jax.jit(jax.value_and_grad(nested))
    motions = simulate_subjects(subjects, seed=SEED)
    every = [jnp.asarray(motions.angles_deg[motions.subject == name].T / DEG) for name in motions.subjects]
    both(girdle.adapted_mm, every[0])
    bounds = tuple(jnp.asarray(b) for b in chosen.bounds_mm)

    def run():
        for angles in every:
            solver = jaxopt.ScipyBoundedMinimize(
                method="L-BFGS-B", fun=lambda theta, angles=angles: both(theta, angles), value_and_grad=True, jit=False
            )
            solver.run(girdle.adapted_mm, bounds=bounds)

    return timed(run) / subjects


def operations_of_iteration(postures: int, points: int) -> int:
    """Additions, multiplications, divisions and roots of one iteration of one subject, counted in its machine code."""
    lengths = {"posture": postures, "point": points, "while": 1}  # a second factor of a posture is seldom needed
    total = 0
    for path, count in subjects_kernel.build().count_operations().items():
        if path[:2] == ("block", "while"):
            times = [lengths[word] if word in lengths else int(word.split(".")[1]) for word in path[2:]]
            total += count * math.prod(times)
    return total


def _chains(x: Any) -> list[Any]:
    def longer(values: list[Any]) -> list[Any]:
        for _ in range(_LINKS):
            values = [0.999 * value + 0.5 for value in values]
        return values

    return repeat(_PEAK_ROUNDS, longer, [x + float(k) for k in range(_CHAINS)])


_CHAINS, _LINKS, _PEAK_ROUNDS = 12, 32, 1000
"""Independent multiply-adds, enough to hide that each takes four cycles; those between two looks at memory; and how
often."""

PEAK = Kernel("peak", _chains, ("",), str(_CHAINS), 64)
"""Nothing but multiply-adds of registers, by the compiler and the threads of the fits."""


def peak_gflops() -> float:
    """What this machine reaches at best, while the benchmark runs."""
    x = np.ones(64 * 8 * (os.cpu_count() or 1))
    PEAK.by_machine(x)
    return len(x) * _CHAINS * _LINKS * _PEAK_ROUNDS * 2 / timed(lambda: PEAK.by_machine(x)) / 1e9


def sweep_gflops(data: Any, operations: int) -> float:
    """Of the first iterations of every subject, of so many operations each; those of subjects that wait for others of
    their block are not counted."""
    given = first_iterations(data)
    done = subjects_kernel.by_machine(*given).iterations.sum()
    return float(done) * operations / timed(lambda: subjects_kernel.by_machine(*given)) / 1e9


def first_iterations(data: Any) -> tuple[Fixed, Start, np.ndarray]:
    """The arguments of the first round of the subject sweep: ten iterations from the geometric fit."""
    postures, count = data.counted.shape
    theta = np.clip(data.girdle.adapted_mm, *data.bounds_mm)
    start = Start(theta, data.angles, np.zeros((3, postures, count)), np.zeros(count, bool))
    return fixed_problem(data, np.full(count, WEIGHT)), start, np.full(count, 10.0)


def spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "least": min(values), "most": max(values)}


def warm_wall_s() -> tuple[float, float]:
    """Wall time of ``girdle adapt`` of the ten shipped subjects with three sets: the first run here, and the next."""
    command = [sys.executable, "-m", "adapt", "adapt", str(ROOT / "motions" / "data" / "simulated_subjects.csv")]
    command += [word for name in ("R2", "R4", "R6") for word in ("--model", name)]
    with tempfile.TemporaryDirectory() as folder:

        def run():
            subprocess.run([*command, "--out", folder], cwd=ROOT, check=True, capture_output=True)

        return timed(run), timed(run)


def against_ipopt(off: np.ndarray) -> dict[str, float]:
    """Shares of the subjects by the relative difference of E."""
    same = np.abs(off) <= SAME_E
    return {
        "same_as_ipopt": float(np.mean(same)),
        "lower": float(np.mean(off < -SAME_E)),
        "higher": float(np.mean(off > SAME_E)),
        "ipopt_failed": float(np.mean(np.isnan(off))),
        "largest_difference_of_the_same": float(np.nanmax(np.where(same, np.abs(off), 0.0))),
    }


@app.command()
def benchmark(
    model: str = "R2",
    subjects: Annotated[int, typer.Option(min=8, help="Subjects of the throughput.")] = 1000,
    peers: Annotated[int, typer.Option(min=2, help="Of these, how many the peers solve in a repeat.")] = 100,
    repeats: Annotated[int, typer.Option(min=1)] = 3,
    largest: Annotated[int, typer.Option(help="Largest number of subjects of the scaling.")] = 8000,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object instead of lines.")] = False,
) -> None:
    """Measure and compare."""
    keep_compiled()
    data = prepared(model, subjects)
    one = select_problems(data, np.arange(1))
    ours = solved_from_geometric_fit(data)
    solved_from_geometric_fit(one)
    measured = np.asarray(simulate_subjects(subjects, seed=SEED).angles_deg.T) / DEG
    girdle = load_model(model).girdle
    count = measured.shape[1]
    girdles = jax.tree.map(lambda x: np.broadcast_to(np.asarray(x)[..., None], (*x.shape, count)), girdle)
    known = np.isfinite(measured)
    fitted = fit_batch(girdles, measured, known)

    keys = ("adapt", "ipopt", "single", "fit", "slsqp", "gflops", "peak_gflops", "sweep", "sweep_by_xla")
    rows: dict[str, list[float]] = {key: [] for key in keys}
    operations = operations_of_iteration(data.counted.shape[0], data.point_weights.shape[0])
    sweep = first_iterations(data)
    subjects_kernel.by_jax(*sweep)  # compiles
    E_ipopt, J_slsqp = np.empty(0), np.empty(0)
    for _ in range(repeats):
        rows["adapt"].append(subjects / timed(lambda: solved_from_geometric_fit(data)))
        seconds, E_ipopt = on_all_cores(ipopt_share, model, peers, subjects)
        rows["ipopt"].append(peers / seconds)
        rows["single"].append(1.0 / timed(lambda: solved_from_geometric_fit(one)))
        rows["fit"].append(count / timed(lambda: fit_batch(girdles, measured, known)))
        seconds, J_slsqp = on_all_cores(slsqp_share, model, 2 * peers, subjects)
        rows["slsqp"].append(2 * peers / seconds)
        rows["gflops"].append(sweep_gflops(data, operations))
        rows["peak_gflops"].append(peak_gflops())
        rows["sweep"].append(subjects / timed(lambda: subjects_kernel.by_machine(*sweep)))
        rows["sweep_by_xla"].append(subjects / timed(lambda: subjects_kernel.by_jax(*sweep)))
    cores = os.cpu_count() or 1
    sizes = [n for n in (250, 1000, 4000, 16000, 64000) if n < largest] + [largest]
    seconds = {n: _seconds(model, n) for n in sizes}
    cold, warm = warm_wall_s()
    ratio = {
        "adapt_vs_ipopt": [a / b for a, b in zip(rows["adapt"], rows["ipopt"], strict=True)],
        "adapt_single_vs_ipopt": [a / (b / cores) for a, b in zip(rows["single"], rows["ipopt"], strict=True)],
        "fit_vs_slsqp": [a / b for a, b in zip(rows["fit"], rows["slsqp"], strict=True)],
        "share_of_peak": [a / b for a, b in zip(rows["gflops"], rows["peak_gflops"], strict=True)],
        "machine_code_vs_xla": [a / b for a, b in zip(rows["sweep"], rows["sweep_by_xla"], strict=True)],
    }
    result = {
        **{key: float(np.median(values)) for key, values in ratio.items()},
        "subjects_per_second": float(np.median(rows["adapt"])),
        "peak_memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "scaling_exponent": float(np.polyfit(np.log(sizes), np.log(list(seconds.values())), 1)[0]),
        "warm_wall_s": warm,
        "first_wall_s": cold,
        "spread": {key: spread(values) for key, values in (ratio | rows).items()},
        "subjects_vs_nested_jaxopt": float(np.median(rows["adapt"])) * nested_seconds(model, 3),
        "seconds_of_subjects": seconds,
        "operations_of_one_iteration": operations,
        "agreement": {
            "converged": float(np.mean(ours.converged)),
            **against_ipopt(values_of(data, ours)[:peers] / E_ipopt - 1.0),
            "fits_not_above_slsqp": float(np.mean(~(fitted.j_deg2[: 2 * peers] > J_slsqp + 1e-6))),
        },
        "float32": {
            "times_as_fast": float32.speeds(data, repeats),
            "again_in_float64": float32.shares_in_float64(data),
            "changes": float32.errors(simulate_subjects(subjects, seed=SEED), [load_model(model)]),
        },
        "machine": {"cores": cores, "devices": [str(d) for d in jax.devices()], "load": os.getloadavg()},
        "model": model,
        "subjects": subjects,
    }
    if as_json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key}: {value}")


def _seconds(model: str, subjects: int) -> float:
    data = prepared(model, subjects)
    return timed(lambda: solved_from_geometric_fit(data))


if __name__ == "__main__":
    app()
