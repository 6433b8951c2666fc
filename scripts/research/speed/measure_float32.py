"""Compare the fits in float32 with those in float64, on simulated subjects or motion files: errors and speed.

Errors are of simulated angles, of parameters (also in units of their SD) and of E: the largest of each lane (a subject
or posture with a model). Times are of the same adaptations and posture fits, run alternately; ratios are medians.
"""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402
import typer  # noqa: E402

from adapt import adapt_subjects, fit_postures  # noqa: E402
from adapt.engine.batching import as_type, take_problems  # noqa: E402
from adapt.engine.compilation_cache import keep_compiled  # noqa: E402
from adapt.solvers import newton, status  # noqa: E402
from adapt.solvers.adaptation import adapt_batch  # noqa: E402
from adapt.solvers.objective import WEIGHT  # noqa: E402
from adapt.solvers.posture_fits import fit_batch  # noqa: E402
from adapt.solvers.problems import Problems, problems_of, subject_problem  # noqa: E402
from adapt.solvers.rows import posture_rows  # noqa: E402
from models import ParameterSet, load_model  # noqa: E402
from motions import Motions, read_motions, write_motions  # noqa: E402
from motions.rhythm import REST_DEG  # noqa: E402
from motions.rhythm_subjects import simulate_subjects  # noqa: E402
from motions.rotations import DEG  # noqa: E402
from scripts.reporting import timed  # noqa: E402

SEED = 11

SAME_E, SAME_DEG2, SAME_DEG = 1e-5, 1e-3, 0.1
"""Largest relative change of E, change of J and change of an angle between equal optima: at least ten times the
rounding error of float32. Where angles were not measured, another optimum may have the same objective."""

app = typer.Typer(add_completion=False)


def errors(motions: Motions, models: Sequence[ParameterSet]) -> dict[str, Any]:
    """Compare ``dtype=float32`` with float64, lane by lane.

    Returns the changes in lanes with equal optima, and the number of lanes with another optimum, of lower or higher E
    or J, or with another status.
    """
    results = [adapt_subjects(motions, models, dtype=dtype) for dtype in (np.float64, np.float32)]
    one, other = (_joined(result.adapted) for result in results)
    angle_deg = np.abs(other["angles"] - one["angles"]).max(axis=(0, 1)) * DEG
    same, E = _compared(one, other, other["E"] / one["E"] - 1.0, SAME_E, angle_deg)
    apart_mm = np.abs(other["theta_mm"] - one["theta_mm"])[:, same]
    sd_mm = results[0].uncertainty.sd_mm[:, same]
    adaptations = {
        "parameter_mm": _spread(apart_mm.max(axis=0)),
        "parameter_in_sd": _spread((apart_mm / sd_mm).max(axis=0)),
        "E_relative": _spread(np.abs(other["E"] / one["E"] - 1.0)[same]),
        "angle_deg": _spread(angle_deg[same]),
        **E,
    }
    one, other = (_joined(fit_postures(motions, models, dtype=dtype).by_model) for dtype in (np.float64, np.float32))
    angle_deg = np.abs(other["angles"] - one["angles"]).max(axis=0) * DEG
    same, J = _compared(one, other, other["j_deg2"] - one["j_deg2"], SAME_DEG2, angle_deg)
    return {"adaptations": adaptations, "posture_fits": {"angle_deg": _spread(angle_deg[same]), **J}}


def _joined(results: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Concatenate the lanes of all models."""
    every = [one._asdict() | {"status": one.status} for one in results.values()]
    return {name: np.concatenate([one[name] for one in every], axis=-1) for name in every[0]}


def _compared(one, other, change, least: float, angle_deg) -> tuple[np.ndarray, dict[str, int]]:
    """Return a mask of the lanes with equal optima, and counts of the other lanes."""
    near = angle_deg <= SAME_DEG
    both = (one["status"] == status.OK) & (other["status"] == status.OK)
    counts = {
        "lanes": len(both),
        "lower_optimum": int((both & (change < -least)).sum()),
        "higher_optimum": int((both & (change > least)).sum()),
        "other_as_low": int((both & ~near & (np.abs(change) <= least)).sum()),
        "other_status": int((one["status"] != other["status"]).sum()),
    }
    return both & near & (np.abs(change) <= least), counts


def _spread(values: np.ndarray) -> dict[str, float]:
    return {"median": float(np.median(values)), "most": float(values.max())}


def shares_in_float64(data: Problems) -> dict[str, float]:
    """Return the shares of posture fits (with unadapted models) and of adaptations that do not converge in float32."""
    single = as_type(data, np.float32)
    girdle, angles, measured = of_postures(single)
    fits = newton.fit_postures(girdle, angles, measured)
    theta = np.clip(single.girdle.adapted_mm, *single.bounds_mm)
    problem = subject_problem(single, np.full(data.counted.shape[1], WEIGHT))
    solved = newton.fit_subjects(problem, theta, single.angles)
    return {"posture_fits": float(1.0 - fits.converged.mean()), "adaptations": float(1.0 - solved.converged.mean())}


def of_postures(data: Problems) -> tuple[Any, np.ndarray, np.ndarray]:
    """Return girdle, angles (rest posture where not measured) and mask of measured angles of each counted posture."""
    posture, problem = np.nonzero(data.counted)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    rest = (REST_DEG[:, None] / DEG).astype(angles.dtype)
    return take_problems(data.girdle, problem), np.where(measured, angles, rest), measured


def speeds(data: Problems, repeats: int) -> dict[str, float]:
    """Compute how many times as fast float32 is: posture fits, and adaptations with all their starts and rounds."""

    def ratio(run: Callable[[Problems], Any]) -> float:
        both = [as_type(data, dtype) for dtype in (np.float64, np.float32)]
        for one in both:
            run(one)
        times = np.array([[timed(lambda one=one: run(one)) for one in both] for _ in range(repeats)])
        return float(np.median(times[:, 0] / times[:, 1]))

    return {
        "posture_fits": ratio(lambda one: fit_batch(*of_postures(one))),
        "adaptations": ratio(lambda one: adapt_batch(one)),
    }


def command_speed(motions: Motions, models: Sequence[str], repeats: int) -> float:
    """Compute the ratio for ``girdle adapt`` from CPU times, which other work on the machine disturbs less."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "motions.csv"
        write_motions(motions, file)
        command = [sys.executable, "-m", "adapt", "adapt", str(file), "--out", f"{folder}/out"]
        command += [word for name in models for word in ("--model", name)]

        def cpu_s(*options: str) -> float:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([*command, *options], cwd=ROOT, check=True, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

        return float(np.median([cpu_s() / cpu_s("--float32") for _ in range(repeats)]))


@app.command()
def measure(
    motions: Annotated[list[Path] | None, typer.Argument(help="Motion files; else simulated subjects.")] = None,
    model: Annotated[list[str], typer.Option()] = ["R2"],  # noqa: B006 (typer reads it, never changes it)
    subjects: Annotated[int, typer.Option(min=1, help="How many are simulated.")] = 1000,
    repeats: Annotated[int, typer.Option(min=1)] = 5,
    command: Annotated[bool, typer.Option(help="Time girdle adapt too.")] = True,
) -> None:
    """Measure errors and speed of float32, and print them."""
    keep_compiled()
    table = read_motions(*motions) if motions else simulate_subjects(subjects, seed=SEED)
    models = [load_model(name) for name in model]
    data = problems_of(posture_rows(table), models)
    of_what = "motions of files" if motions else "simulated"
    print(f"{len(table.subjects)} subjects, {of_what}, {', '.join(model)}")
    print(f"float32 against float64: {errors(table, models)}")
    print(f"shares that float64 did again: {shares_in_float64(data)}")
    print(f"times as fast: {speeds(data, repeats)}")
    if command:
        print(f"times as fast, CPU time of girdle adapt: {command_speed(table, model, repeats):.2f}")


if __name__ == "__main__":
    app()
