"""The work of a peer on all cores: one process a core, each with its share of the subjects."""

import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from scripts.research.speed.peers.cases import Answer, Cases


class Share(NamedTuple):
    """What a process, or all of them, took, and the value of each subject or posture in order (NaN: failed)."""

    wall_s: float
    cpu_s: float
    values: np.ndarray
    library: float = 1.0
    """The part of the time in the peer's own library, where the rest is Python of ours that calls it."""


def timed_share(
    given: Cases, solve: Callable[[], Sequence[Answer]], library_s: Callable[[], float] | None = None
) -> Share:
    """Solves once unmeasured, to be warm, and once measured; E of the answers is computed afterwards.

    ``library_s`` counts the seconds in the peer's library."""
    solve()
    before = library_s() if library_s else 0.0
    wall, cpu = time.perf_counter(), time.process_time()
    answers = solve()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Share(wall, cpu, given.E(answers), (library_s() - before) / wall if library_s else 1.0)


def on_all_cores(share: Callable[[str, int, int, int, int], Share], model: str, count: int, total: int) -> Share:
    """The slowest process's seconds, the CPU seconds of all and the values of the first ``count`` of ``total``."""
    cores = min(os.cpu_count() or 1, count)
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        parts = pool.starmap(share, [(model, count, total, first, cores) for first in range(cores)])
        pool.close()
        pool.join()  # to be terminated makes Ceres print a page
    values = np.empty(count)
    for first, part in enumerate(parts):
        values[first::cores] = part.values
    library = float(np.mean([part.library for part in parts]))
    return Share(max(part.wall_s for part in parts), sum(part.cpu_s for part in parts), values, library)
