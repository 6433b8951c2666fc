"""Time a diagnosis, stage by stage: the first run of a process with empty caches, then later runs.

    python scripts/research/speed/measure_diagnosis.py                                  ten simulated subjects, R2
    python scripts/research/speed/measure_diagnosis.py ../shared/motions/*.csv --model breteler_mri

Prints Markdown. Cold: nothing has been compiled yet on this machine. Warm: the shortest of three runs in one process.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from adapt.diagnosis import diagnose
from adapt.engine.compilation_cache import keep_compiled
from models import load_model
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE
from scripts.reporting import markdown

WARM_RUNS = 3

SEARCH, GAPS = "search for causes", "gaps of girdle adapt, and with the causes"
"""The stages; the diagnosis reports the beginning of the second one."""

app = typer.Typer(add_completion=False)


def stages_s(files: list[Path], model: str) -> dict[str, float]:
    """Diagnose once; return the seconds of each stage."""
    motions, parameters, said = read_motions(*files), load_model(model), {}
    begun = time.perf_counter()
    diagnose(motions, parameters, progress=lambda stage: said.setdefault(stage, time.perf_counter()))
    ended, between = time.perf_counter(), said[f"{model}: gaps of girdle adapt"]
    return {SEARCH: between - begun, GAPS: ended - between, "all": ended - begun}


def cold_s(files: list[Path], model: str) -> dict[str, float]:
    """Diagnose once in a separate process with an empty cache folder; return the seconds of each stage."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, *map(str, files), "--model", model, "--once"]
        environment = os.environ | {"XDG_CACHE_HOME": folder, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@app.command()
def main(
    files: Annotated[list[Path] | None, typer.Argument(metavar="MOTION.csv...", help="Default: ten simulated.")] = None,
    model: Annotated[str, typer.Option(help="Parameter set.")] = "R2",
    once: Annotated[bool, typer.Option("--once", help="Time this process alone; print JSON.")] = False,
) -> None:
    """Print how long a diagnosis takes, stage by stage."""
    keep_compiled()
    chosen = files or [DATA_FILE]
    if once:
        print(json.dumps(stages_s(chosen, model)))
        return
    cold = cold_s(chosen, model)
    warm = min((stages_s(chosen, model) for _ in range(WARM_RUNS)), key=lambda one: one["all"])
    print(
        markdown(
            ["stage", "cold, s", "warm, s"], [[stage, f"{cold[stage]:.1f}", f"{warm[stage]:.1f}"] for stage in cold]
        )
    )


if __name__ == "__main__":
    app()
