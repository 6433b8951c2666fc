"""Work that waits to be ended. Run as a program, the processes of a large run say that they work, and continue."""

import time

from adapt.output.large_runs.chunked_run import Work
from adapt.output.large_runs.local_processes import in_processes
from motions import Motions
from motions.rhythm_subjects import simulate_subjects

WAIT_S = 60.0
"""Longer than any test waits; a process that nobody ends stops by itself."""


class WaitingWork(Work):
    """Work that says that it works, and then takes long."""

    def chunk_file(self, motions: Motions) -> bytes:
        print("working", flush=True)
        time.sleep(WAIT_S)
        return b""


if __name__ == "__main__":
    work = WaitingWork((), 10.0, "mm2_deg2", frozenset(), frozenset())
    list(in_processes(work, enumerate([simulate_subjects(1, seed=0)])))
