"""Measure time and peak memory of `girdle adapt` against the number of simulated subjects.

The motion file is written one block of subjects at a time, and the command runs in separate processes. Their memory is
read twice a second: the largest of one process, and the sum of all, shared pages counted once (Linux). The memory of
this script is not included. Prints a line per number and the exponent of time against number (1 is linear).

With ``--dask`` so many workers of a Dask cluster on this machine adapt the parts. ``--kill`` ends one of them, like a
machine that fails; every subject must then appear exactly once in the table of parameters.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Annotated

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
import typer  # noqa: E402

from motions.motion_csv.writing import write_motions  # noqa: E402
from motions.rhythm_subjects import simulate_subjects  # noqa: E402

BLOCK = 1000
"""Subjects simulated at a time, each block from its own seed."""

NO_PROFILE = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
"""Setting of Dask's workers in docs/large_runs.md: their profile grows with the run."""

app = typer.Typer(add_completion=False)


def write_subjects(count: int, path: Path) -> None:
    """Write a motion file of so many simulated subjects."""
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
def cluster(workers: int, folder: Path) -> Iterator[tuple[str, list[int]]]:
    """Start a Dask scheduler and workers on this machine, as in docs/large_runs.md.

    Yields the scheduler's address and the process ids of the scheduler and the workers.
    """
    from distributed import Client

    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    of_file = ["--scheduler-file", str(file), "--no-dashboard"]
    commands = [
        [*dask, "scheduler", "--port", "0", *of_file],
        *[[*dask, "worker", "--nthreads", "1", *of_file]] * workers,
    ]
    with ExitStack() as stack:
        processes = []
        for command in commands:
            how = {"cwd": folder, "env": os.environ | NO_PROFILE, "stderr": subprocess.DEVNULL}
            one = stack.enter_context(subprocess.Popen(command, **how))
            stack.callback(one.terminate)
            processes.append(one.pid)
        while not file.exists():
            time.sleep(_LOOK_S)
        with Client(scheduler_file=str(file)) as client:
            client.wait_for_workers(workers)
            address = client.scheduler_info()["address"]
        yield address, processes


def watched(
    run: subprocess.Popen, others: Sequence[int] = (), kill: tuple[int, float] | None = None
) -> tuple[float, float]:
    """Wait for a run; return the peak memory in MiB of one process and of all together.

    The sum includes ``others`` and all their descendants. ``kill``: a process to end, and after how many seconds.
    CalledProcessError if the run fails.
    """
    one = together = 0.0
    start = time.perf_counter()
    while run.poll() is None:
        if kill and time.perf_counter() - start > kill[1]:
            os.kill(kill[0], signal.SIGKILL)
            print(f"a worker was ended after {kill[1]:.0f} s", flush=True)
            kill = None
        sizes = [memory_mib(process) for root in (run.pid, *others) for process in family(root)]
        one, together = max(one, *sizes), max(together, sum(sizes))
        time.sleep(_LOOK_S)
    if run.returncode:
        raise subprocess.CalledProcessError(run.returncode, run.args)
    return one, together


def family(process: int) -> list[int]:
    """List a process and all its descendants."""
    found = [process]
    with suppress(OSError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            for child in (thread / "children").read_text().split():
                found += family(int(child))
    return found


def memory_mib(process: int) -> float:
    """Read the proportional memory of a process (shared pages divided between processes); 0 if it has ended."""
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
    """Measure time and memory for each number of subjects, and print."""
    if kill is not None and not dask:
        raise SystemExit("--kill: there is no worker to end. Give the number of workers with --dask.")
    counts = [int(word) for word in sizes.split(",")]
    seconds = []
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            motions = Path(folder) / "motions.csv"
            write_subjects(count, motions)
            command = [sys.executable, "-m", "adapt", "adapt", str(motions), "--model", model, "--out", f"{folder}/out"]
            with cluster(dask, Path(folder)) if dask else nullcontext(("", [])) as (address, others):
                start = time.perf_counter()
                run = subprocess.Popen(
                    [*command, *(["--dask", address] if dask else [])], cwd=ROOT, stdout=subprocess.DEVNULL
                )
                ended = (
                    (max(family(others[-1]), key=memory_mib), kill)
                    if kill is not None and count == counts[-1]
                    else None
                )
                one, together = watched(run, others, ended)
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
