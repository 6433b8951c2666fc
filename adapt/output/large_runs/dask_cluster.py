"""Chunk files made by the workers of a Dask cluster: one process per core or device, each with girdle installed.

The scheduler unpickles every task. A task is bytes and a function of this module, which imports neither JAX nor pandas.
So the scheduler imports neither, and needs a third of the memory.
"""

import pickle
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from adapt.engine.compilation_cache import keep_compiled
from motions.errors import InputError, pip_install

if TYPE_CHECKING:
    from adapt.output.large_runs.chunked_run import Chunks, Maker, Work

_CONNECT_S = 10.0

_WAITING = 2
"""Requested chunks per worker: one that it makes and one that it continues with; more would only fill its memory."""


def on_cluster(address: str) -> "Maker":
    """Build a maker of chunk files on the scheduler at this address; InputError without Dask or without an answer.

    If a worker is lost, another one makes its chunk file again: it depends on nothing but its chunk, and the process
    that requested the chunk files writes each once.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        cause = "Dask is not installed"
        remedy = f"Install it here and for the workers: {pip_install('distributed')}"
        raise InputError("--dask", None, cause, remedy) from error

    def make(work: "Work", chunks: "Chunks") -> Iterator[tuple[int, bytes]]:
        with _client(Client, address) as client:
            if not client.scheduler_info(n_workers=-1)["workers"]:
                raise InputError(
                    "--dask", None, f"the scheduler at {address} has no worker", "Start: dask worker ADDRESS"
                )
            shared = client.scatter(work, broadcast=True, hash=False)
            numbers: dict[Any, int] = {}
            ended = as_completed()

            def ask() -> None:
                for number, motions in chunks:
                    future = client.submit(_chunk_file, shared, pickle.dumps(motions), pure=False)
                    numbers[future] = number
                    ended.add(future)
                    if len(numbers) >= _WAITING * max(1, len(client.nthreads())):
                        return

            ask()
            for future in ended:
                yield numbers.pop(future), future.result()
                future.release()
                ask()

    return make


def _client(client: Any, address: str) -> Any:
    try:
        return client(address, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        cause = f"no Dask scheduler answers at {address}"
        raise InputError(
            "--dask", None, cause, "Give the address that `dask scheduler` says, as in tcp://host:8786"
        ) from error


def _chunk_file(work: "Work", motions: bytes) -> bytes:
    keep_compiled()
    return work.chunk_file(pickle.loads(motions))
