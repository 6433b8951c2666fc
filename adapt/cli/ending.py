"""How a command ends: its exit statuses, and what it says at last."""

from pathlib import Path

import typer

from adapt.cli.options import console, errors
from adapt.output.result_files import REPORT, raise_without_report
from motions import Motions

EXIT_BAD_INPUT = 2
EXIT_SOME_NOT_HANDLED = 3
EXIT_INTERRUPTED = 130


def say_report(folder: Path, wrong: Exception | None) -> None:
    """Say which page to open; raise what went wrong with it, if anything did."""
    raise_without_report(folder, wrong)
    console.print(f"Open {folder / REPORT}", soft_wrap=True)


def finish(motions: Motions, failed: dict[str, str]) -> None:
    """Name who was not handled on stderr and end with the exit status."""
    for error in motions.rejected:
        errors.print(f"left out: {error}", soft_wrap=True)
    for subject, why in failed.items():
        errors.print(f"not handled: {subject}: {why}", soft_wrap=True)
    if motions.rejected or failed:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)
