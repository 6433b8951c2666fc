"""End of a command: exit statuses, last messages, and the end together with the parent process."""

import os
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import typer

from adapt.cli.options import console, errors
from motions import InputError

if TYPE_CHECKING:
    from motions import Motions

EXIT_BAD_INPUT = 2
EXIT_SOME_NOT_HANDLED = 3
EXIT_INTERRUPTED = 130


ENDS_WITH_STDIN = "GIRDLE_ENDS_WITH_STDIN"
"""Environment variable that makes a command end as soon as no process holds the other end of its standard input."""


def watch_stdin() -> None:
    """End this process when its parent process ends for any reason, if the environment asks for that."""
    if os.environ.get(ENDS_WITH_STDIN):
        Thread(target=_end_with_stdin, daemon=True).start()


def _end_with_stdin() -> None:
    while os.read(0, 1):  # not sys.stdin: its lock would be held when the interpreter ends
        pass
    os._exit(1)


_NO_MEMORY = ("RESOURCE_EXHAUSTED", "failed to map segment", "annot allocate memory", "can't start new thread")
"""Parts of the messages of XLA, the loader of libraries, the operating system and threads when memory runs out."""


def is_out_of_memory(error: Exception) -> bool:
    """Check whether an error says that memory ran out, whatever raised the error."""
    return isinstance(error, MemoryError) or any(word in str(error) for word in _NO_MEMORY)


def out_of_memory() -> InputError:
    """Create the error of a run for which there is too little memory."""
    remedy = (
        "Close other programs, give fewer subjects or parameter sets at a time, or use a machine with more; "
        "girdle adapt takes less with a smaller --chunk. Results that were there are as they were"
    )
    return InputError("this run", None, "there is too little memory for it", remedy)


def say_report(folder: Path, wrong: Exception | None) -> None:
    """Print the path of the report page; raise the error that prevented the report, if there is one."""
    from adapt.output.result_files import REPORT, raise_without_report  # slow import: pandas

    raise_without_report(folder, wrong)
    console.print(f"Open {folder / REPORT}", soft_wrap=True)


def finish(motions: "Motions", failed: dict[str, str]) -> None:
    """Print on stderr what was left out and who was not handled; if anything, exit with ``EXIT_SOME_NOT_HANDLED``."""
    for error in motions.rejected:
        errors.print(f"left out: {error}", soft_wrap=True)
    for subject, why in failed.items():
        errors.print(f"not handled: {subject}: {why}", soft_wrap=True)
    if motions.rejected or failed:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)
