"""SciPy's SLSQP on the fit of one posture, with analytic derivatives, one process per core.

Fair in the problem, not in the language: Fortran calls a NumPy function in each iteration.
"""

import time

import numpy as np
from oracles import bones, slsqp  # pyright: ignore[reportMissingImports]

from models import load_model
from motions.rhythm_subjects import simulate_subjects
from scripts.research.speed.peers.cases import SEED
from scripts.research.speed.peers.shares import Share, on_all_cores


def run(model: str, postures: int, total: int) -> Share:
    """Compute J of the first ``postures`` postures of ``total`` subjects."""
    return on_all_cores(_share, model, postures, total)


def _share(model: str, postures: int, total: int, first: int, step: int) -> Share:
    known = bones(load_model(model).girdle)
    targets = simulate_subjects(total, seed=SEED).angles_deg[:postures][first::step]
    slsqp(known, targets[0], targets[0])
    wall, cpu = time.perf_counter(), time.process_time()
    found = [slsqp(known, target, target) for target in targets]
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Share(wall, cpu, np.array([one.j_deg2 if one.success else np.nan for one in found]))
