"""Several processes of this machine: where a run has many parts, tables and files take as long as the fits."""

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any

import jax

from adapt.engine.batching import cores, use_cores
from adapt.engine.compilation_cache import keep_compiled
from adapt.output.large_runs.parts import Chunks, Maker, Work, one_after_another
from motions.errors import InputError
from motions.table import Motions

MANY_PARTS = 8
"""From so many on: a process takes 3 s to start, a part 3 s."""

ENDED_BY_THE_SYSTEM = "the system ended a process, most likely because memory ran out"

_WAITING = 2
"""Parts asked for, a process: one that it makes and one that it goes on with; more would only fill memory."""


def on_this_machine(parts: int) -> Maker:
    """Choose how to make so many parts: by processes where there are many, and cores to share."""
    return in_processes if parts >= MANY_PARTS and cores() > 1 else one_after_another


def in_processes(work: Work, chunks: Chunks) -> Iterator[tuple[int, bytes]]:
    """Make the parts in one process a core, each on one core. InputError if the system ends one of them."""
    processes = cores()
    asked: deque[tuple[int, Future[bytes]]] = deque()
    try:
        with processes_given(work, processes, cores_each=1) as pool:
            for number, motions in chunks:
                asked.append((number, pool.submit(_part, motions)))
                if len(asked) >= _WAITING * processes:
                    number, part = asked.popleft()
                    yield number, part.result()
            for number, part in asked:
                yield number, part.result()
    except BrokenProcessPool as error:
        remedy = "Start it again: it continues where it was. A smaller --chunk takes less memory"
        raise InputError("the adaptation", None, ENDED_BY_THE_SYSTEM, remedy) from error


def processes_given(something: Any, processes: int, cores_each: int) -> ProcessPoolExecutor:
    """Start so many processes, which end with this one; each knows what it was given (``given``)."""
    return ProcessPoolExecutor(processes, get_context("spawn"), _begin, (something, cores_each))


def given() -> Any:
    """Return what this process was given as it began."""
    return _given


_given: Any = None


def _begin(something: Any, cores_each: int) -> None:
    global _given
    _given = something
    Thread(target=_end_with_parent, daemon=True).start()
    use_cores(cores_each)
    jax.config.update("jax_platforms", "cpu")  # on a GPU each process would take most of its memory for itself
    keep_compiled()


def _end_with_parent() -> None:
    """End this process as soon as the one that asks for parts has ended, however: killed, it tells nobody.

    Its sentinel is the end of a pipe, on Windows a handle of the process; the fits leave this thread its turn.
    """
    if parent := parent_process():
        parent.join()
        os._exit(1)


def _part(motions: Motions) -> bytes:
    return given().part(motions)
