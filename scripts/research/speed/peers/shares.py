"""Distribution of a solver's work over all cores: one process per core, each with its share of the subjects."""

import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from scripts.research.speed.peers.cases import Answer, Cases


class Share(NamedTuple):
    """Times of one process or of all, and the value of each subject or posture in order (NaN: failed)."""

    wall_s: float
    cpu_s: float
    values: np.ndarray
    library: float = 1.0
    """Share of the time in the solver's own library; the rest is our Python code that calls it."""


def timed_share(
    given: Cases, solve: Callable[[], Sequence[Answer]], library_s: Callable[[], float] | None = None
) -> Share:
    """Solve once to warm up and once with timing; compute E of the answers afterwards.

    ``library_s`` counts the seconds in the solver's library."""
    solve()
    before = library_s() if library_s else 0.0
    wall, cpu = time.perf_counter(), time.process_time()
    answers = solve()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Share(wall, cpu, given.E(answers), (library_s() - before) / wall if library_s else 1.0)


def on_all_cores(share: Callable[[str, int, int, int, int], Share], model: str, count: int, total: int) -> Share:
    """Return the slowest process's seconds, the CPU seconds of all and the values of the first ``count`` subjects."""
    cores = min(os.cpu_count() or 1, count)
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        parts = pool.starmap(share, [(model, count, total, first, cores) for first in range(cores)])
        pool.close()
        pool.join()  # Ceres would print a page of messages if it were terminated
    values = np.empty(count)
    for first, part in enumerate(parts):
        values[first::cores] = part.values
    library = float(np.mean([part.library for part in parts]))
    return Share(max(part.wall_s for part in parts), sum(part.cpu_s for part in parts), values, library)
