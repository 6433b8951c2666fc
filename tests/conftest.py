"""Double precision for every test, compiled programs shared between them, the order of the files, the marker ``slow``,
and the measured motions, which are not part of the project."""

import gc
import os
from pathlib import Path

COMPILED = Path(__file__).parents[1] / ".pytest_cache" / "compiled"
"""What XLA has compiled: for the other test process, for processes that tests start, and for the next run. Its names
hash the program, the compiler and its options, so that nothing stale can be taken from it."""

# JAX reads them when it is imported.
os.environ["JAX_COMPILATION_CACHE_DIR"] = str(COMPILED)
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.2"  # what is compiled faster is hardly faster to read

import pytest  # noqa: E402

import motions  # noqa: E402, F401  (switches JAX to double precision before any test makes an array)

TESTS = Path(__file__).parent

MEASURED_FOLDER = Path(__file__).parents[2] / "shared" / "motions"
"""Bone-pin shoulders and published means in this project's form; under GPL-3.0, so not shipped."""

SLOW = (TESTS / "slow.txt").read_text().split()
"""Files, and single tests of other files, that take longer than about two seconds; the longest first."""


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
    """Keep the garbage collector from what the imports made: tracing a program sets it off again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def measured_files() -> tuple[Path, ...]:
    """The measured motion files, or a skip that says what is missing."""
    files = tuple(sorted(MEASURED_FOLDER.glob("*.csv")))
    if not files:
        pytest.skip(f"no measured motions in {MEASURED_FOLDER}: they are licensed apart from the project")
    return files
