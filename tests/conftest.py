"""Double precision for every test, compiled programs shared between them, what they take given back, the order of the
files, the marker ``slow``, and the measured motions, which are not part of the project."""

import ctypes
import gc
import os
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

COMPILED = Path(__file__).parents[1] / ".pytest_cache" / "compiled"
"""What XLA has compiled: for the other test process, for processes that tests start, and for the next run. Its names
hash the program, the compiler and its options, so that nothing stale can be taken from it."""

# JAX reads them when it is imported.
os.environ["JAX_COMPILATION_CACHE_DIR"] = str(COMPILED)
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"  # the smallest is read in a third of the time

# XLA reads them when it first compiles. A third of the tests' time is compilation: with these the files that compile
# most take a fifth less, and the programs are as exact.
os.environ["XLA_FLAGS"] = (
    "--xla_backend_optimization_level=1 --xla_llvm_disable_expensive_passes=true"
    " --xla_cpu_parallel_codegen_split_count=1"
)
if version("jaxlib").startswith("0.10."):  # a later one has no others, and ends a process that names them
    os.environ["XLA_FLAGS"] += " --xla_cpu_use_fusion_emitters=false"

# JAX reads it when it is imported. The places in the source that a program came from take a tenth of the time of what
# is mostly compiled, and nobody looks at them.
os.environ["JAX_TRACEBACK_IN_LOCATIONS_LIMIT"] = "0"

# Processes that tests start read it: threads of several processes wait for each other, and a search for causes takes
# eight times as long.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

# The C library reads it when a test process starts: with eight heaps a core a third of the memory is holes.
os.environ["MALLOC_ARENA_MAX"] = "2"

import pytest  # noqa: E402

TESTS = Path(__file__).parent

MEASURED_FOLDER = Path(__file__).parents[2] / "shared" / "motions"
"""Bone-pin shoulders and published means in this project's form; under GPL-3.0, so not shipped."""

SLOW = (TESTS / "slow.txt").read_text().split()
"""Files, and single tests of other files, that take longer than about two seconds; the longest first."""


def pytest_sessionstart(session: pytest.Session) -> None:
    """Switch JAX to double precision before any test makes an array, and BLAS to one thread, as above: NumPy is there
    already. Not in the process that only hands out tests, which would import all this for nothing.
    """
    if session.config.getoption("numprocesses", None) and not hasattr(session.config, "workerinput"):
        return
    from threadpoolctl import threadpool_limits

    import motions  # noqa: F401

    threadpool_limits(1, "blas")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is ``slow``, and put the files that take longest first: the processes then end together.

    Needs ``--no-loadscope-reorder``, or xdist would begin with the files that have the most tests.
    """
    place = {name: number for number, name in enumerate(SLOW)}

    def known(item: pytest.Item) -> list[str]:
        """The item's names in ``SLOW``: its file, or itself without its parameters."""
        file = item.path.relative_to(TESTS).as_posix()
        return [name for name in (file, f"{file}::{item.originalname}") if name in place]  # type: ignore[attr-defined]

    first: dict[Path, int] = {}
    for item in items:
        for name in known(item):
            item.add_marker("slow")
            first[item.path] = min(place[name], first.get(item.path, len(SLOW)))
    items.sort(key=lambda item: first.get(item.path, len(SLOW)))


def pytest_collection_finish() -> None:
    """Keep the garbage collector from what the imports made, and let it look a hundred times more seldom: tracing a
    program sets it off again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(70_000, 10, 10)


LARGE_BYTES = 1_000_000_000
"""Of a test process: with what it has imported it takes 0.6 GB, with the programs of all files 5 GB."""


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Give back the programs of a file if the process has become large: few other files need them."""
    if nextitem is None or nextitem.path == item.path or _resident_bytes() < LARGE_BYTES:
        return
    import jax

    jax.clear_caches()
    gc.collect()
    with suppress(AttributeError):  # another C library than GNU's
        ctypes.CDLL(None).malloc_trim(0)


def _resident_bytes() -> int:
    """What this process has in memory, where Linux tells."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


@pytest.fixture(scope="session")
def measured_files() -> tuple[Path, ...]:
    """The measured motion files, or a skip that says what is missing."""
    files = tuple(sorted(MEASURED_FOLDER.glob("*.csv")))
    if not files:
        pytest.skip(f"no measured motions in {MEASURED_FOLDER}: they are licensed apart from the project")
    return files
