"""The command with fits made by hand (tests/helpers/handmade.py): tests of its output files then take a second.

``python quick_girdle.py`` forks a process for each command that ``started_runs`` asks for on stdin, so that no command
imports everything anew. A run prints "fitting", "writing" or "publishing" when it reaches the stage it was given, and
waits there to be killed; with "never" it runs to its end.
"""

import json
import os
import signal
import sys
import time
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

from handmade import adaptations

from adapt import Adaptations
from adapt.cli import app as cli
from adapt.cli.commands import fit_runs
from adapt.output.large_runs import chunked_run
from models import ParameterSet
from motions import Motions

WAIT_S = 60.0
"""Longer than any test waits; a process that nobody ends stops by itself."""


def quick_adaptations(motions: Motions, models: list[ParameterSet], *_: object, **__: object) -> Adaptations:
    """Replacement for ``adapt_checked``."""
    return adaptations(motions, models)


def _waits(at: str, stage: str) -> None:
    if at == stage:
        print(stage, flush=True)
        time.sleep(WAIT_S)


def _main(at: str) -> None:
    write_run, replace = fit_runs.write_run, Path.replace

    def fitting(*arguments: object, **named: object) -> Adaptations:
        _waits(at, "fitting")
        return quick_adaptations(*arguments, **named)  # type: ignore[arg-type]

    def writing(*arguments) -> None:
        _waits(at, "writing")
        write_run(*arguments)

    def publishing(self: Path, target: Any) -> Path:
        if target.name == "parameters.csv":
            _waits(at, "publishing")
        return replace(self, target)

    chunked_run.adapt_checked, fit_runs.write_run, Path.replace = fitting, writing, publishing
    cli.main()


def _run(at: str, arguments: list[str], out: str, err: str) -> int:
    """Run the command with its output in two files, as a started process would, and return its exit status."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for path, number in ((out, 1), (err, 2)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600), number)
    sys.argv = ["girdle", *arguments]
    try:
        _main(at)
    except SystemExit as ended:
        return int(ended.code or 0)
    except BaseException:
        traceback.print_exc()
        return 1
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
    return 0


def _serve() -> None:
    """Answer each line of stdin: a command with the number of the process that it starts, a process number with its
    exit status."""
    for line in sys.stdin:
        told = json.loads(line)
        if isinstance(told, int):
            _, status = os.waitpid(told, 0)
            print(os.waitstatus_to_exitcode(status), flush=True)
            continue
        process = os.fork()
        if process == 0:
            os._exit(_run(*told))
        print(process, flush=True)


if __name__ == "__main__":
    _serve()
