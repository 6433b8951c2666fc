"""`girdle adapt` of many simulated subjects: time and peak memory against their number.

The motion file is made a block of subjects at a time, and the command runs in processes of its own. Their memory is
looked at twice a second: the largest of one, and of all together, what they share counted once (Linux). Prints a line a
number and the exponent of time against number (1 is linear).
"""

import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402
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


def watched(run: subprocess.Popen) -> tuple[float, float]:
    """Wait for a run; the most memory of one process and of all together, MiB. CalledProcessError if it fails."""
    one = together = 0.0
    while run.poll() is None:
        sizes = [memory_mib(process) for process in family(run.pid)]
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
) -> None:
    """Measure."""
    counts = [int(word) for word in sizes.split(",")]
    seconds = []
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            motions = Path(folder) / "motions.csv"
            write_subjects(count, motions)
            command = [sys.executable, "-m", "adapt", "adapt", str(motions), "--model", model, "--out", f"{folder}/out"]
            start = time.perf_counter()
            one, together = watched(subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL))
            seconds.append(time.perf_counter() - start)
        print(
            f"{count} simulated subjects: {seconds[-1]:.0f} s ({count / seconds[-1]:.0f} a second), peak {one:.0f} MiB "
            f"of a process, {together:.0f} of all, load {os.getloadavg()[0]:.1f}",
            flush=True,
        )
    if len(counts) > 1:
        print(f"exponent of time: {np.polyfit(np.log(counts), np.log(seconds), 1)[0]:.2f}")


if __name__ == "__main__":
    app()
