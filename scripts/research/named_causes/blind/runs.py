"""Run cases on every core and append one JSON line per finished case; a rerun does only the missing cases."""

import hashlib
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from adapt.engine.compilation_cache import keep_compiled
from scripts.research.named_causes.blind.cases import ROOT, Case

Line = dict[str, Any]
"""Result of one case, as `blind_check.py` writes it to JSON."""

AnyCase = TypeVar("AnyCase", bound=Case)
"""A case, or a subclass with more fields."""

Examine = Callable[[AnyCase], Line]


def run_case(case: AnyCase, how: Examine[AnyCase]) -> Line:
    """Run a case and return its line; an exception is recorded in the line."""
    line = {"origin": "simulated", **asdict(case), "model": case.model, "code": code_state()}
    start = time.monotonic()
    try:
        return finite(line | how(case) | {"seconds": time.monotonic() - start})
    except Exception as error:  # a failure concerns one case only: the others go on
        return line | {"failed": f"{type(error).__name__}: {error}"}


def key(line: Line) -> tuple[str, str, int, int]:
    """Return the identity of a case."""
    return line["condition"], line["label"], line["seed"], line["repeat"]


def missing(cases: Sequence[AnyCase], lines: Sequence[Line]) -> list[AnyCase]:
    """List the cases that have no line yet or failed: the reason of the failure may be gone."""
    done = {key(line) for line in lines if "failed" not in line}
    return [case for case in cases if key(asdict(case)) not in done]


@cache
def code_state() -> str:
    """Return eight hex digits that change with the code and the parameter sets; a study needs lines of one state."""
    rooms = ("adapt", "models", "motions", "scripts/research/named_causes/synthetic_a")
    files = sorted(path for room in rooms for end in ("py", "toml") for path in (ROOT / room).rglob(f"*.{end}"))
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()[:8]


def finite(value: Any) -> Any:
    """Replace infinity and NaN by None, because JSON has neither."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def read_lines(path: Path) -> list[Line]:
    """Read the lines of a study, keeping the last of each case and ignoring an incomplete last line."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = [json.loads(line) for line in text.split("\n")[:-1]]
    return list({key(line): line for line in lines}.values())


def append_lines(path: Path, lines: Iterator[Line], progress: Callable[[Line], None]) -> None:
    """Append whole lines as soon as they are there, after removing an incomplete last line of an earlier run."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        for line in lines:
            file.write((json.dumps(line, allow_nan=False) + "\n").encode())
            file.flush()
            progress(line)


def run(cases: Sequence[AnyCase], jobs: int, how: Examine[AnyCase]) -> Iterator[Line]:
    """Yield the lines of the cases as they finish."""
    if jobs == 1:
        keep_compiled()
        yield from (run_case(case, how) for case in cases)
        return
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(threads, "1")  # there are as many worker processes as cores already
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), keep_compiled)
    try:
        for done in as_completed([pool.submit(run_case, case, how) for case in cases]):
            yield done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def run_missing(path: Path, cases: Sequence[AnyCase], jobs: int, how: Examine[AnyCase]) -> None:
    """Run all cases that are not yet in the file, with a progress bar on stderr."""
    left = missing(cases, read_lines(path))
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("simulated cases", total=len(cases), completed=len(cases) - len(left))

        def show(line: Line) -> None:
            bar.update(task, advance=1, description=f"{line['condition']} {line['label']}")
            if "failed" in line:
                bar.console.print(f"failed: {key(line)}: {line['failed']}", markup=False, highlight=False)

        append_lines(path, run(left, jobs, how), show)
