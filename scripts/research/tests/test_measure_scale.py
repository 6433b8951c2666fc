"""Measured memory of a run: it includes the child processes, and ended processes count as 0."""

import os
import subprocess
import sys

import pytest

from scripts.research.speed.measure_scale import family, measure, memory_mib, watched

HOLDS = "import time; x = b'x' * 60_000_000; time.sleep(1.5)"
FAMILY = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {HOLDS!r}])"


@pytest.mark.skipif(not os.path.exists("/proc/self/smaps_rollup"), reason="Linux alone tells")  # noqa: PTH110
def test_the_memory_of_a_child_counts():
    one, together = watched(subprocess.Popen([sys.executable, "-c", FAMILY]))
    assert 57.0 < one < together < 200.0


def test_a_run_that_fails_is_an_error_and_what_has_ended_has_nothing():
    with pytest.raises(subprocess.CalledProcessError):
        watched(subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"]))
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    assert (family(ended.pid), memory_mib(ended.pid)) == ([ended.pid], 0.0)


def test_without_workers_there_is_none_to_end():
    with pytest.raises(SystemExit, match="--dask"):
        measure(kill=1.0)
