"""`girdle adapt` of many simulated subjects: time and peak memory against their number.

The motion file is made a block of subjects at a time, and the command runs in a process of its own, whose peak memory
is the system's count. Prints a line a number and the exponent of time against number (1 is linear).
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
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
            subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
            seconds.append(time.perf_counter() - start)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(
            f"{count} simulated subjects: {seconds[-1]:.0f} s ({count / seconds[-1]:.0f} a second), "
            f"peak {used.ru_maxrss / 1024.0:.0f} MiB (of this run or a smaller one), load {os.getloadavg()[0]:.1f}",
            flush=True,
        )
    if len(counts) > 1:
        print(f"exponent of time: {np.polyfit(np.log(counts), np.log(seconds), 1)[0]:.2f}")


if __name__ == "__main__":
    app()
