"""CasADi and IPOPT on the whole-subject problem, one process per core.

Fair: exact first and second derivatives; the closest points are variables, which keeps everything sparse; the function
is built once and warm. CasADi's virtual machine evaluates it, as by default; ``casadi_compiled`` compiles it.
"""

import time

import numpy as np
from oracles import ipopt_call  # pyright: ignore[reportMissingImports]

from scripts.research.speed.peers.cases import cases
from scripts.research.speed.peers.shares import Share, on_all_cores


def run(model: str, count: int, total: int) -> Share:
    """Compute E of the first ``count`` subjects."""
    return on_all_cores(_share, model, count, total)


def _share(model: str, count: int, total: int, first: int, step: int) -> Share:
    given = cases(model, count, total, first, step)
    calls = [
        ipopt_call(given.bones, given.points_mm, target, given.theta_mm, target, given.bounds_mm)
        for target in given.targets_deg
    ]
    solver, arguments = calls[0]
    for _ in range(3):
        solver(**arguments)
    values = []
    wall, cpu = time.perf_counter(), time.process_time()
    for solver, arguments in calls:
        found = solver(**arguments)
        values.append(float(found["f"]) if solver.stats()["success"] else np.nan)
    return Share(time.perf_counter() - wall, time.process_time() - cpu, np.array(values))
