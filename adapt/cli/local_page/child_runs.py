"""Commands of girdle in child processes: a command that hangs or crashes harms nothing else, and can be cancelled."""

import asyncio
import os
import signal
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from adapt.cli.ending import ENDS_WITH_STDIN, EXIT_SOME_NOT_HANDLED
from adapt.cli.terminal.console import PROGRESS, PROGRESS_LINES

_ROOT = Path(__file__).parents[3]
_LONGEST_LINE_BYTES = 1_000_000


@dataclass(frozen=True)
class Ended:
    """Command that ended. ``said``: its lines on stderr, without progress lines."""

    status: int
    out: str
    said: tuple[str, ...]
    cancelled: bool = False

    @property
    def useful(self) -> bool:
        """True where the command wrote results."""
        return self.status in (0, EXIT_SOME_NOT_HANDLED)

    @property
    def message(self) -> str:
        """Last lines of the command on stderr, or a note that the command said nothing."""
        if self.cancelled:
            return "Cancelled. Nothing was kept of this run."
        return "\n".join(self.said[-3:]) or f"The command ended with status {self.status} and said nothing."


class Children:
    """Running commands of a session, all in its folder."""

    def __init__(self, folder: Path) -> None:
        """Store the folder in which the commands run, which is also the folder of their temporary files."""
        self._folder = folder
        self._running: set[Process] = set()
        self._cancelled: set[Process] = set()

    async def girdle(self, arguments: Sequence[str], progress: Callable[[str], None] = lambda _: None) -> Ended:
        """Run ``girdle ARGUMENTS`` and wait for its end; ``progress`` is called with each of its stages."""
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "adapt", *arguments),
            cwd=self._folder,
            env=self._environment(),
            stdin=PIPE,  # nothing is written to it: it closes, and the command ends, with this process
            stdout=PIPE,
            stderr=PIPE,
            start_new_session=True,  # so that processes started by the command end with it
            limit=_LONGEST_LINE_BYTES,
        )
        self._running.add(process)
        try:
            out, said = await asyncio.gather(_all(process.stdout), _lines(process.stderr, progress))
            status = await process.wait()
        finally:
            self._running.discard(process)
        return Ended(status, out, tuple(said), process in self._cancelled)

    def cancel(self) -> None:
        """Kill all running commands at once."""
        for process in tuple(self._running):
            self._cancelled.add(process)
            try:
                if hasattr(os, "killpg"):
                    os.killpg(process.pid, signal.SIGKILL)
                else:
                    process.kill()
            except ProcessLookupError:
                continue  # the command has just ended by itself

    def _environment(self) -> dict[str, str]:
        """Return the page's environment, changed to import the same code and keep temporary files in the session."""
        path = os.pathsep.join(filter(None, (str(_ROOT), os.environ.get("PYTHONPATH", ""))))
        own = {"PYTHONPATH": path, "TMPDIR": str(self._folder), "COLUMNS": "200"}
        return {**os.environ, **own, PROGRESS_LINES: "1", ENDS_WITH_STDIN: "1"}


async def _all(stream: asyncio.StreamReader | None) -> str:
    return (await stream.read()).decode(errors="replace") if stream else ""


async def _lines(stream: asyncio.StreamReader | None, progress: Callable[[str], None]) -> list[str]:
    """Return the lines that are no progress lines, which go to ``progress``."""
    said = []
    while stream and (line := (await stream.readline()).decode(errors="replace")):
        if line.startswith(PROGRESS):
            progress(line.removeprefix(PROGRESS).strip())
        elif line.strip():
            said.append(line.rstrip())
    return said
