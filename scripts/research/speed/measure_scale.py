"""`girdle adapt` of many simulated subjects: time and peak memory against their number.

The motion file is made a block of subjects at a time, and the command runs in processes of its own. Their memory is
looked at twice a second: the largest of one, and of all together, what they share counted once (Linux). Prints a line a
number and the exponent of time against number (1 is linear).

With ``--dask`` the parts are made by so many workers of a Dask cluster on this machine. ``--kill`` ends one of them as
a machine that fails would; every subject must be in the table of parameters once.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Annotated, Any

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
import typer  # noqa: E402

from motions.motion_csv.writing import write_motions  # noqa: E402
from motions.rhythm_subjects import simulate_subjects  # noqa: E402

BLOCK = 1000
"""Subjects simulated at a time, each block from a seed of its own."""

app = typer.Typer(add_completion=False)


def write_subjects(count: int, path: Path) -> None:
    """A motion file of so many simulated subjects."""
    block_file = path.with_suffix(".block")
    with path.open("w") as file:
        for number, first in enumerate(range(0, count, BLOCK)):
            write_motions(simulate_subjects(min(BLOCK, count - first), seed=number), block_file)
            header, *lines = block_file.read_text().splitlines(keepends=True)
            if not number:
                file.write(header)
            file.writelines(f"b{number}_{line}" for line in lines)
    block_file.unlink()


@contextmanager
def cluster(workers: int) -> Iterator[tuple[str, list[int]]]:
    """The address of a Dask scheduler on this machine, and its workers' processes."""
    from distributed import LocalCluster

    here: Any = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0")
    with here:
        yield here.scheduler_address, [nanny.pid for nanny in here.workers.values()]


def watched(
    run: subprocess.Popen, parent: int | None = None, kill: tuple[int, float] | None = None
) -> tuple[float, float]:
    """Wait for a run; the most memory of one process and of all that ``parent`` began (default: of the run), MiB.

    ``kill``: a process to end, and when, s. CalledProcessError if the run fails.
    """
    one = together = 0.0
    start = time.perf_counter()
    while run.poll() is None:
        if kill and time.perf_counter() - start > kill[1]:
            os.kill(kill[0], signal.SIGKILL)
            print(f"a worker was ended after {kill[1]:.0f} s", flush=True)
            kill = None
        sizes = [memory_mib(process) for process in family(parent or run.pid)]
        one, together = max(one, *sizes), max(together, sum(sizes))
        time.sleep(_LOOK_S)
    if run.returncode:
        raise subprocess.CalledProcessError(run.returncode, run.args)
    return one, together


def family(process: int) -> list[int]:
    """A process and all that it began, their own included."""
    found = [process]
    with suppress(OSError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            for child in (thread / "children").read_text().split():
                found += family(int(child))
    return found


def memory_mib(process: int) -> float:
    """What a process has in memory, a page of several processes in equal parts; 0 if it has ended."""
    with suppress(OSError):
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
        return float(next(line.split()[1] for line in lines if line.startswith("Pss:"))) / 1024.0
    return 0.0


_LOOK_S = 0.5


@app.command()
def measure(
    sizes: Annotated[str, typer.Option(help="Numbers of simulated subjects, smallest first.")] = "1000,10000,100000",
    model: str = "R2",
    dask: Annotated[int, typer.Option(help="Workers of a Dask cluster on this machine; 0 for none.")] = 0,
    kill: Annotated[float | None, typer.Option(help="End a worker so many seconds after the last size began.")] = None,
) -> None:
    """Measure."""
    if kill is not None and not dask:
        raise SystemExit("--kill: there is no worker to end. Give the number of workers with --dask.")
    counts = [int(word) for word in sizes.split(",")]
    seconds = []
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            motions = Path(folder) / "motions.csv"
            write_subjects(count, motions)
            command = [sys.executable, "-m", "adapt", "adapt", str(motions), "--model", model, "--out", f"{folder}/out"]
            with cluster(dask) if dask else nullcontext(("", [])) as (address, workers):
                start = time.perf_counter()
                run = subprocess.Popen(
                    [*command, *(["--dask", address] if dask else [])], cwd=ROOT, stdout=subprocess.DEVNULL
                )
                ended = (workers[0], kill) if kill is not None and count == counts[-1] else None
                one, together = watched(run, os.getpid() if dask else None, ended)
                seconds.append(time.perf_counter() - start)
            subjects = pd.read_csv(f"{folder}/out/parameters.csv", usecols=["subject"])["subject"]
            assert len(subjects) == subjects.nunique() == count, f"{subjects.nunique()} of {count} subjects"
        print(
            f"{count} simulated subjects: {seconds[-1]:.0f} s ({count / seconds[-1]:.0f} a second), peak {one:.0f} MiB "
            f"of a process, {together:.0f} of all, load {os.getloadavg()[0]:.1f}",
            flush=True,
        )
    if len(counts) > 1:
        print(f"exponent of time: {np.polyfit(np.log(counts), np.log(seconds), 1)[0]:.2f}")


if __name__ == "__main__":
    app()
