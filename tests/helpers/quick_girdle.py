"""The command with fits that no solver made (tests/helpers/handmade.py): for what happens to its files, in a second.

``python quick_girdle.py STAGE ARGUMENTS`` says "fitting", "writing" or "publishing" when it comes to that stage, and
waits there to be killed; STAGE "never" runs through.
"""

import sys
import time
from pathlib import Path
from typing import Any

from handmade import adaptations

from adapt import Adaptations
from adapt.cli import app as cli
from adapt.cli.commands import fit_commands
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
    write_run, replace = fit_commands.write_run, Path.replace

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

    parts.adapt_subjects, fit_commands.write_run, Path.replace = fitting, writing, publishing
    cli.main()


if __name__ == "__main__":
    _main(sys.argv.pop(1))
