"""Runs of the command in separate processes, which tests kill, interrupt or hold (``quick_girdle``)."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TextIO

from command import Ended

QUICK_GIRDLE = Path(__file__).with_name("quick_girdle.py")


class StartedRuns:
    """One process that has imported the command and forks another for each run."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(QUICK_GIRDLE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def asked(self, what: object) -> int:
        """Write a line and read the number that answers it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())

    def close(self) -> None:
        """End the process, which stops at the end of its stdin."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


class StartedRun:
    """A run that has reached a stage ("never": a run that has begun)."""

    def __init__(self, runs: StartedRuns, at: str, arguments: tuple[object, ...], folder: Path) -> None:
        self._runs, self._err = runs, folder / "err"
        folder.mkdir()
        os.mkfifo(folder / "out")
        self._pid = runs.asked([at, [*map(str, arguments)], str(folder / "out"), str(self._err)])
        self._out: TextIO = (folder / "out").open()
        if at != "never":
            assert self._out.readline() == f"{at}\n", self.ended()

    def signal(self, number: int) -> None:
        """Send a signal to the run."""
        os.kill(self._pid, number)

    def ended(self) -> Ended:
        """Wait for the end of the run, and return its exit status and output."""
        with self._out:
            out = self._out.read()
        return Ended(self._runs.asked(self._pid), out, self._err.read_text())
