"""Settings of all tests: double precision, a shared cache of compiled programs, release of their memory, the order of
the files, the marker ``slow``, and the measured motions, which are not part of the project."""

import ctypes
import gc
import os
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

COMPILED = Path(__file__).parents[1] / ".pytest_cache" / "compiled"
"""Programs that XLA has compiled, kept for the other test process, for processes that tests start, and for the next
run. Their names hash the program, the compiler and its options, so that no stale program is used."""

# JAX reads these variables at import.
os.environ["JAX_COMPILATION_CACHE_DIR"] = str(COMPILED)
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"  # reading even the smallest takes a third of compiling

# XLA reads these flags when it first compiles. A third of the tests' time is compilation: the flags make the files that
# compile most a fifth faster, and the programs are as exact.
os.environ["XLA_FLAGS"] = (
    "--xla_backend_optimization_level=1 --xla_llvm_disable_expensive_passes=true"
    " --xla_cpu_parallel_codegen_split_count=1"
)
if version("jaxlib").startswith("0.10."):  # later versions lack the flag and abort at an unknown one
    os.environ["XLA_FLAGS"] += " --xla_cpu_use_fusion_emitters=false"

# JAX reads it at import. Source locations in programs take a tenth of the time of tests that mostly compile, and nobody
# reads them.
os.environ["JAX_TRACEBACK_IN_LOCATIONS_LIMIT"] = "0"

# Processes that tests start read it: threads of several processes wait for each other, and a search for causes takes
# eight times as long.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

# The C library reads it when a test process starts: with eight heaps per core a third of the memory is fragmented.
os.environ["MALLOC_ARENA_MAX"] = "2"

import pytest  # noqa: E402

TESTS = Path(__file__).parent

MEASURED_FOLDER = Path(__file__).parents[2] / "shared" / "motions"
"""Bone-pin shoulders and published means in this project's format; under GPL-3.0, so not shipped."""

SLOW = (TESTS / "slow.txt").read_text().split()
"""Files, and single tests of other files, that take longer than about two seconds; the longest first."""


def pytest_sessionstart(session: pytest.Session) -> None:
    """Switch JAX to double precision before any test makes an array, and limit BLAS to one thread, as above: NumPy is
    imported already. The process that only distributes tests skips this, because it would import JAX for nothing.
    """
    if session.config.getoption("numprocesses", None) and not hasattr(session.config, "workerinput"):
        return
    from threadpoolctl import threadpool_limits

    import motions  # noqa: F401

    threadpool_limits(1, "blas")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark ``slow`` tests, and put the files that take longest first, so that the test processes end together.

    Needs ``--no-loadscope-reorder``, because xdist would begin with the files that have the most tests otherwise.
    """
    place = {name: number for number, name in enumerate(SLOW)}

    def known(item: pytest.Item) -> list[str]:
        """Return the item's names in ``SLOW``: its file, or the test without its parameters."""
        file = item.path.relative_to(TESTS).as_posix()
        return [name for name in (file, f"{file}::{item.originalname}") if name in place]  # type: ignore[attr-defined]

    first: dict[Path, int] = {}
    for item in items:
        for name in known(item):
            item.add_marker("slow")
            first[item.path] = min(place[name], first.get(item.path, len(SLOW)))
    items.sort(key=lambda item: first.get(item.path, len(SLOW)))


def pytest_collection_finish() -> None:
    """Exclude the imports' objects from garbage collection, and collect a hundred times less often: tracing a program
    triggers a collection again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(70_000, 10, 10)


CGROUP_LIMIT = Path("/sys/fs/cgroup/memory.max")
"""Memory limit of a Linux container, which ``sysconf`` does not tell; "max" without a limit."""


def _memory_bytes() -> int:
    """Return the memory of this machine or container, where the system tells it, else 8 GB."""
    found = 8_000_000_000
    with suppress(AttributeError, OSError, ValueError):
        found = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    with suppress(OSError, ValueError):
        found = min(found, int(CGROUP_LIMIT.read_text()))
    return found


LARGE_BYTES = min(2_500_000_000, _memory_bytes() // 6)
"""Limit for each of the two test processes, beside which types are checked in 2 GB. With its imports a test process
takes 0.6 GB, with the compiled programs of all files 5 GB. With a limit of 1 GB, dropped programs that are loaded again
take a tenth of the tests' CPU time; with 4 GB they take as much as with 2.5."""


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Drop a file's compiled programs if the process has become large: few other files need them."""
    if nextitem is None or nextitem.path == item.path or _resident_bytes() < LARGE_BYTES:
        return
    import jax

    jax.clear_caches()
    gc.collect()
    with suppress(AttributeError):  # only GNU's C library has malloc_trim
        ctypes.CDLL(None).malloc_trim(0)


def _resident_bytes() -> int:
    """Return the memory of this process, where Linux reports it."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


@pytest.fixture(scope="session")
def measured_files() -> tuple[Path, ...]:
    """Return the measured motion files, or skip with a message about the missing ones."""
    files = tuple(sorted(MEASURED_FOLDER.glob("*.csv")))
    if not files:
        pytest.skip(f"no measured motions in {MEASURED_FOLDER}: they are licensed apart from the project")
    return files
