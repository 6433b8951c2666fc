"""How anything comes to the terminal: the console, the line of progress, tables that fold. Needs no pandas."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.segment import Segment
from rich.table import Table

from motions.files import printable


class PlainConsole(Console):
    """Prints names from files as they are: neither read as markup nor able to command the terminal."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, highlight=False)

    def render(self, *arguments: Any, **options: Any) -> Iterable[Segment]:
        """Pass every printed text through ``printable``, all but the control codes of rich itself."""
        for segment in super().render(*arguments, **options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


PROGRESS_LINES = "GIRDLE_PROGRESS_LINES"
"""The environment variable with which a command prints each stage as a line on stderr, although that is no terminal."""

PROGRESS = "progress: "
"""How such a line begins."""


@contextmanager
def progress(errors: Console) -> Iterator[Callable[[str], None]]:
    """Show a line on stderr, if that is a terminal, that says what is being done and for how long.

    Where `girdle app` runs the command, each stage is a line of its own.
    """
    if os.environ.get(PROGRESS_LINES):
        yield lambda stage: print(f"{PROGRESS}{printable(stage)}", file=sys.stderr, flush=True)
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=errors, transient=True, disable=not errors.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        yield lambda stage: bar.update(task, description=stage)


def folding_table(title: str | None, names: Sequence[str], numbers: Sequence[str] = ()) -> Table:
    """Make an empty table: where the terminal is narrow names are folded, numbers never cut."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in names:
        table.add_column(name, overflow="fold")
    for name in numbers:
        table.add_column(name, no_wrap=True, justify="right")
    return table
