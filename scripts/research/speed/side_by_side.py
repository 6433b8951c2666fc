"""Our fits and other solvers side by side in one run, on the same simulated subjects and from the same start.

The other solvers run in their best practical form: ``peers`` has a file for each, whose docstring says whether the
comparison is fair. Every time excludes building, compilation and the preparation of inputs. Our solver gets all
subjects at once; another solver gets the first few, as many as its measurement needs. The comparison is by subjects per
second: of wall time, and of CPU time, which other work on the machine disturbs less. E is compared subject by subject.
Ratios are medians over the repeats, with minimum and maximum. A solver that is not installed is left out with a message
(``pip install '.[peers]'``).

``time_with_effect``: time of an adaptation with a known effect, relative to a plain one of ``girdle adapt``.
``machine_code_vs_xla``: speed of the machine code of ``adapt.engine`` relative to XLA, given the same text of the
subject sweep and the same iterations (CONTRIBUTING says at which ratio the compiler of ``adapt.engine`` goes).
"""

import importlib.util
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("GLOG_minloglevel", "3")  # else Ceres reports every step that it cannot evaluate
ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "helpers")]

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from adapt.engine.compilation_cache import keep_compiled  # noqa: E402
from adapt.solvers.adaptation import adapt_batch  # noqa: E402
from adapt.solvers.newton.subject import Start, SubjectProblem  # noqa: E402
from adapt.solvers.newton.subjects import subjects_kernel  # noqa: E402
from adapt.solvers.objective import WEIGHT  # noqa: E402
from adapt.solvers.posture_fits import fit_batch  # noqa: E402
from adapt.solvers.problems import Problems, problems_of, select_problems, subject_problem  # noqa: E402
from adapt.solvers.rows import posture_rows  # noqa: E402
from adapt.solvers.solution import SubjectSolution  # noqa: E402
from models import load_model  # noqa: E402
from models.effects.amplitudes import read_amplitudes  # noqa: E402
from models.girdle import Girdle  # noqa: E402
from models.person.thorax_ellipsoid import thorax_distance_mm2  # noqa: E402
from motions.rhythm_subjects import simulate_subjects  # noqa: E402
from motions.rotations import DEG  # noqa: E402
from scripts.reporting import timed  # noqa: E402
from scripts.research.speed import measure_float32 as float32  # noqa: E402
from scripts.research.speed.one_start import solved_from_geometric_fit  # noqa: E402
from scripts.research.speed.peers import casadi_compiled, ceres, ipopt, nested_jaxopt, proxqp, septal_sqp, slsqp  # noqa: E402
from scripts.research.speed.peers.cases import SEED  # noqa: E402
from scripts.research.speed.peers.shares import Share  # noqa: E402
from scripts.research.speed.roofline.counted import operations_of_iteration  # noqa: E402
from scripts.research.speed.roofline.reached import core_seconds, peak_gflops  # noqa: E402

EFFECT = "clavicle_frame_bias=10,5,-3"
"""Known effect of the adaptation that is timed with one; any other effect takes as long."""

SAME_E = 1e-6
"""Relative difference of E up to which two optima are equal. IPOPT stops at 1e-10 of its scaled conditions."""

SAME_TO_ROUNDING = 1e-9
"""Relative difference of E up to which two optima are equal to rounding."""


class Peer(NamedTuple):
    """A solver of the whole subject, its requirements, and the factor by which it gets fewer subjects than IPOPT."""

    run: Callable[[str, int, int], Share]
    package: str = "casadi"
    fewer: int = 1
    compiler: bool = False


PEERS = {
    "ipopt": Peer(ipopt.run),
    "ipopt_compiled": Peer(casadi_compiled.run_ipopt, compiler=True),
    "fatrop_compiled": Peer(casadi_compiled.run_fatrop, compiler=True),
    "proxqp": Peer(proxqp.run, "proxsuite"),
    "ceres": Peer(ceres.run, "pyceres", fewer=2, compiler=True),
    "septal": Peer(septal_sqp.run, "septal", fewer=4),
}


def installed_peers() -> dict[str, Peer]:
    """Return the solvers whose package and compiler are installed; print a line for each other one."""
    found = {}
    for name, peer in PEERS.items():
        if importlib.util.find_spec(peer.package) is None:
            print(f"{name} is left out: {peer.package} is not installed", file=sys.stderr)
        elif peer.compiler and casadi_compiled.COMPILER is None:
            print(f"{name} is left out: no gcc or clang on this machine", file=sys.stderr)
        else:
            found[name] = peer
    return found


def values_of(data: Any, solved: Any) -> np.ndarray:
    """Compute E of each lane."""
    D = thorax_distance_mm2(data.girdle.with_adapted(jnp.asarray(solved.theta)), data.points_mm, data.point_weights)
    j = jnp.mean((jnp.asarray(solved.angles) - data.angles) ** 2, axis=0) * DEG**2
    return np.asarray(D + WEIGHT * jnp.sum(jnp.where(data.counted, j, 0.0), axis=0) / jnp.sum(data.counted, axis=0))


def prepared(model: str, subjects: int, effects: tuple[str, ...] = ()):
    """Make the problems of simulated subjects, with known effects as options of the command line."""
    motions = simulate_subjects(subjects, seed=SEED)
    return problems_of(posture_rows(motions, read_amplitudes(effects)), [load_model(model)])


def sweep_gflops(data: Any, operations: int) -> float:
    """Measure GFLOP/s of the first iterations of all subjects, with so many operations each.

    Iterations of subjects that only wait for others of their block are not counted.
    """
    given = first_iterations(data)
    done = subjects_kernel.native(*given).iterations.sum()
    return float(done) * operations / core_seconds(lambda: subjects_kernel.native(*given)) / 1e9


def first_iterations(data: Any) -> tuple[SubjectProblem, Start, np.ndarray]:
    """Return the arguments of the first round of the subject sweep: ten iterations from the geometric fit."""
    postures, count = data.counted.shape
    theta = np.clip(data.girdle.adapted_mm, *data.bounds_mm)
    start = theta, data.angles, np.zeros((3, postures, count)), np.zeros(count, bool)
    return subject_problem(data, np.full(count, WEIGHT)), start, np.full(count, 10.0)


def quotients(ours: list[float], theirs: list[float]) -> list[float]:
    """Divide the values of each repeat."""
    return [a / b for a, b in zip(ours, theirs, strict=True)]


def spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "least": min(values), "most": max(values)}


def warm_wall_s() -> tuple[float, float]:
    """Time ``girdle adapt`` of the ten shipped subjects with three sets: the first run here, and the next."""
    command = [sys.executable, "-m", "adapt", "adapt", str(ROOT / "motions" / "data" / "simulated_subjects.csv")]
    command += [word for name in ("R2", "R4", "R6") for word in ("--model", name)]
    with tempfile.TemporaryDirectory() as folder:

        def run():
            subprocess.run([*command, "--out", folder], cwd=ROOT, check=True, capture_output=True)

        return timed(run), timed(run)


def compared(E: np.ndarray, peer: np.ndarray) -> dict[str, float]:
    """Compute shares of the other solver's subjects by the relative difference of our E from its E."""
    off = E[: len(peer)] / peer - 1.0
    return {
        "subjects": float(len(peer)),
        "same": float(np.mean(np.abs(off) <= SAME_E)),
        "same_to_rounding": float(np.mean(np.abs(off) <= SAME_TO_ROUNDING)),
        "ours_lower": float(np.mean(off < -SAME_E)),
        "ours_higher": float(np.mean(off > SAME_E)),
        "peer_failed": float(np.mean(np.isnan(off))),
    }


def rates(run: Callable[[], object], subjects: int) -> tuple[float, float]:
    """Measure subjects per second of wall time, and of CPU time of all threads."""
    wall, cpu = time.perf_counter(), time.process_time()
    run()
    return subjects / (time.perf_counter() - wall), subjects / (time.process_time() - cpu)


class Cases(NamedTuple):
    """Input of our solvers, with everything compiled, and their results."""

    model: str
    data: Problems
    extended: Problems
    """The problems with a known effect."""
    one: Problems
    """The problem of the first subject alone."""
    postures: tuple[Girdle, np.ndarray, np.ndarray]
    """Girdles, measured angles (rad) and mask of known angles, of all posture fits."""
    sweep: tuple[SubjectProblem, Start, np.ndarray]
    operations: int
    """Operations of one iteration of a subject."""
    solved: SubjectSolution
    fitted_j_deg2: np.ndarray


def prepared_cases(model: str, subjects: int) -> Cases:
    """Prepare and compile everything, and solve it once."""
    data = prepared(model, subjects)
    angles = np.asarray(simulate_subjects(subjects, seed=SEED).angles_deg.T) / DEG
    postures = load_model(model).girdle.repeated(angles.shape[1]), angles, np.isfinite(angles)
    cases = Cases(
        model,
        data,
        prepared(model, subjects, (EFFECT,)),
        select_problems(data, np.arange(1)),
        postures,
        first_iterations(data),
        operations_of_iteration(data.counted.shape[0], data.point_weights.shape[0]),
        solved_from_geometric_fit(data),
        fit_batch(*postures).j_deg2,
    )
    solved_from_geometric_fit(cases.one)
    adapt_batch(cases.extended)
    subjects_kernel.by_jax(*cases.sweep)
    return cases


def measured(
    cases: Cases, solvers: dict[str, Peer], peers: int, repeats: int
) -> tuple[dict[str, list[float]], dict[str, Share], Share]:
    """Measure rates (subjects, posture fits or GFLOP per second) in every repeat.

    Returns the rates, the last results of the other solvers, and those of SLSQP.
    """
    subjects, rows = cases.data.counted.shape[1], defaultdict[str, list[float]](list)
    last: dict[str, Share] = {}
    fits = Share(0.0, 0.0, np.empty(0))
    for _ in range(repeats):
        wall, cpu = rates(lambda: solved_from_geometric_fit(cases.data), subjects)
        rows["adapt"].append(wall)
        rows["adapt_cpu"].append(cpu)
        for name, peer in solvers.items():
            few = max(2, peers // peer.fewer)
            last[name] = peer.run(cases.model, few, subjects)
            rows[name].append(few / last[name].wall_s)
            rows[f"{name}_cpu"].append(few / last[name].cpu_s)
        rows["adapted"].append(subjects / timed(lambda: adapt_batch(cases.data)))
        rows["adapted_with_effect"].append(subjects / timed(lambda: adapt_batch(cases.extended)))
        rows["single"].append(1.0 / timed(lambda: solved_from_geometric_fit(cases.one)))
        postures = len(cases.fitted_j_deg2)
        rows["fit"].append(postures / timed(lambda: fit_batch(*cases.postures)))
        rows["fit_from_one_start"].append(postures / timed(lambda: fit_batch(*cases.postures, start=cases.postures[1])))
        fits = slsqp.run(cases.model, 2 * peers, subjects)
        rows["slsqp"].append(2 * peers / fits.wall_s)
        rows["gflops"].append(sweep_gflops(cases.data, cases.operations))
        rows["peak_gflops"].append(peak_gflops())
        rows["sweep"].append(subjects / timed(lambda: subjects_kernel.native(*cases.sweep)))
        rows["sweep_by_xla"].append(subjects / timed(lambda: subjects_kernel.by_jax(*cases.sweep)))
    return dict(rows), last, fits


def ratios(rows: dict[str, list[float]], solvers: list[str], cores: int) -> dict[str, list[float]]:
    """Divide our rates by those of the other solvers, repeat by repeat."""
    found = {f"adapt_vs_{name}": quotients(rows["adapt"], rows[name]) for name in solvers}
    found |= {f"adapt_vs_{name}_by_cpu": quotients(rows["adapt_cpu"], rows[f"{name}_cpu"]) for name in solvers}
    return found | {
        "adapt_single_vs_ipopt": [a / (b / cores) for a, b in zip(rows["single"], rows["ipopt"], strict=True)],
        "time_with_effect": quotients(rows["adapted"], rows["adapted_with_effect"]),
        "fit_vs_slsqp": quotients(rows["fit_from_one_start"], rows["slsqp"]),
        "fit_from_all_places_vs_slsqp": quotients(rows["fit"], rows["slsqp"]),
        "share_of_peak": quotients(rows["gflops"], rows["peak_gflops"]),
        "machine_code_vs_xla": quotients(rows["sweep"], rows["sweep_by_xla"]),
    }


def side_by_side(model: str, subjects: int, peers: int, repeats: int, largest: int) -> dict[str, Any]:
    """Measure and compare; return all figures by name. largest: the largest number of subjects of the scaling."""
    keep_compiled()
    solvers = installed_peers()
    cases = prepared_cases(model, subjects)
    rows, last, fits = measured(cases, solvers, peers, repeats)
    cores = os.cpu_count() or 1
    sizes = [n for n in (250, 1000, 4000, 16000, 64000) if n < largest] + [largest]
    took_s = {n: _seconds(model, n) for n in sizes}
    cold, warm = warm_wall_s()
    ratio = ratios(rows, list(solvers), cores)
    return {
        **{key: float(np.median(values)) for key, values in ratio.items()},
        "subjects_per_second": float(np.median(rows["adapt"])),
        "peak_memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "scaling_exponent": float(np.polyfit(np.log(sizes), np.log(list(took_s.values())), 1)[0]),
        "warm_wall_s": warm,
        "first_wall_s": cold,
        "spread": {key: spread(values) for key, values in (ratio | rows).items()},
        "subjects_vs_nested_jaxopt": float(np.median(rows["adapt"])) * nested_jaxopt.seconds_a_subject(model, 3),
        "seconds_of_subjects": took_s,
        "operations_of_one_iteration": cases.operations,
        "agreement": {
            "converged": float(np.mean(cases.solved.converged)),
            **{name: compared(values_of(cases.data, cases.solved), share.values) for name, share in last.items()},
            "fits_not_above_slsqp": float(np.mean(~(cases.fitted_j_deg2[: len(fits.values)] > fits.values + 1e-6))),
        },
        "time_in_the_library": {name: share.library for name, share in last.items()},
        "float32": {
            "times_as_fast": float32.speeds(cases.data, repeats),
            "again_in_float64": float32.shares_in_float64(cases.data),
            "changes": float32.errors(simulate_subjects(subjects, seed=SEED), [load_model(model)]),
        },
        "machine": {"cores": cores, "devices": [str(d) for d in jax.devices()], "load": os.getloadavg()},
        "model": model,
        "subjects": subjects,
    }


def _seconds(model: str, subjects: int) -> float:
    data = prepared(model, subjects)
    return timed(lambda: solved_from_geometric_fit(data))
