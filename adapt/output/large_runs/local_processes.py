"""Chunk files made by several processes of this machine: tables and files of many chunks take as long as the fits."""

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
from adapt.output.large_runs.chunked_run import Chunks, Maker, Work, one_after_another
from motions.errors import InputError
from motions.table import Motions

MANY_CHUNKS = 8
"""Number of chunks from which several processes are used: the start of a process takes 3 s, a chunk 3 s."""

ENDED_BY_THE_SYSTEM = "the system ended a process, most likely because memory ran out"

_WAITING = 2
"""Requested chunks per process: one that it makes and one that it continues with; more would only fill memory."""


def on_this_machine(chunks: int) -> Maker:
    """Choose the maker for this number of chunks: processes if there are many, and cores to share."""
    return in_processes if chunks >= MANY_CHUNKS and cores() > 1 else one_after_another


def in_processes(work: Work, chunks: Chunks) -> Iterator[tuple[int, bytes]]:
    """Make the chunk files in one process per core, each on one core. InputError if the system ends a process."""
    processes = cores()
    asked: deque[tuple[int, Future[bytes]]] = deque()
    try:
        with processes_given(work, processes, cores_each=1) as pool:
            for number, motions in chunks:
                asked.append((number, pool.submit(_chunk_file, motions)))
                if len(asked) >= _WAITING * processes:
                    number, content = asked.popleft()
                    yield number, content.result()
            for number, content in asked:
                yield number, content.result()
    except BrokenProcessPool as error:
        remedy = "Start it again: it continues where it was. A smaller --chunk takes less memory"
        raise InputError("the adaptation", None, ENDED_BY_THE_SYSTEM, remedy) from error


def processes_given(something: Any, processes: int, cores_each: int) -> ProcessPoolExecutor:
    """Start this number of processes, which end with this one; each gets ``something`` (``given``)."""
    return ProcessPoolExecutor(processes, get_context("spawn"), _begin, (something, cores_each))


def given() -> Any:
    """Return the object that this process got when it started."""
    return _given


_given: Any = None


def _begin(something: Any, cores_each: int) -> None:
    global _given
    _given = something
    Thread(target=_end_with_parent, daemon=True).start()
    use_cores(cores_each)
    jax.config.update("jax_platforms", "cpu")  # each process would reserve most of a GPU's memory for itself
    keep_compiled()


def _end_with_parent() -> None:
    """End this process as soon as its parent has ended in any way: a killed parent notifies nobody.

    The parent's sentinel is the end of a pipe, on Windows a handle of the process; this thread gets its turn during the
    fits.
    """
    if parent := parent_process():
        parent.join()
        os._exit(1)


def _chunk_file(motions: Motions) -> bytes:
    return given().chunk_file(motions)
