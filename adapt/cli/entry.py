"""Start of ``girdle``: a list of words answers shell completion, the checks alone answer ``girdle doctor``, and the
command line all else.

The command line, with the libraries that check its options, takes too long to import for these two.
``shell_words.txt`` holds its commands and options; ``scripts/shell_words.py`` writes it.
"""

import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

ASKED = "_GIRDLE_COMPLETE"
"""Environment variable by which typer's shell scripts ask for completion."""

WORDS = Path(__file__).with_name("shell_words.txt")
"""Lines of a command and its help, or of a command, an option and its help, separated by tabs."""


def main() -> None:
    """Answer a shell completion or ``girdle doctor``, or run the command line."""
    if ASKED in os.environ:
        words()(prog_name="girdle")
    if sys.argv[1:] == ["doctor"]:
        from adapt.cli.doctor import print_findings

        sys.exit(print_findings())
    from adapt.cli.app import main as run  # too slow for a shell completion

    run()


def words() -> typer.Typer:
    """Make a command line with the same commands and options, which only completes."""
    app, options = typer.Typer(), dict[str, dict[str, str]]()
    helps: dict[str, str] = {}
    for line in WORDS.read_text(encoding="utf-8").splitlines():
        command, *option, said = line.split("\t")
        options.setdefault(command, {}).update(dict.fromkeys(option, said))
        helps.setdefault(command, said)
    for command, its in options.items():
        app.command(command, help=helps[command])(_takes(its))
    return app


def _takes(options: dict[str, str]) -> Callable[..., None]:
    def command(**_: str) -> None: ...

    kinds = {
        f"option_{number}": Annotated[str, typer.Option(name, help=said)]
        for number, (name, said) in enumerate(options.items())
    }
    keyword = inspect.Parameter.KEYWORD_ONLY
    places = [inspect.Parameter(name, keyword, default="", annotation=kind) for name, kind in kinds.items()]
    command.__signature__ = inspect.Signature(places)  # type: ignore[attr-defined]
    command.__annotations__ = dict(kinds)
    return command
