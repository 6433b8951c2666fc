"""The command with fits that no solver made (tests/helpers/handmade.py): for what happens to its files, in a second.

``python quick_girdle.py`` makes a process of its own of each command that ``started_runs`` asks for on stdin, without
importing all anew. A run says "fitting", "writing" or "publishing" when it comes to the stage that it was told, and
waits there to be killed; told "never" it runs through.
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
from adapt.output.large_runs import parts
from models import ParameterSet
from motions import Motions

WAIT_S = 60.0
"""Longer than any test waits; a process left alone ends."""


def quick_adaptations(motions: Motions, models: list[ParameterSet], *_: object, **__: object) -> Adaptations:
    """In place of ``adapt_subjects``."""
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

    parts.adapt_subjects, fit_runs.write_run, Path.replace = fitting, writing, publishing
    cli.main()


def _run(at: str, arguments: list[str], out: str, err: str) -> int:
    """Run the command with its words in two files, as a started process would; its exit status."""
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
    """Answer each line of stdin: with the number of the process that it starts, or the status of one that ended."""
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
