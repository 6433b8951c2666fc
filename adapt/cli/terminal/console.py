"""Basics of the terminal output: console, progress line, and tables that fold. Needs no pandas."""

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
    """Console that prints names from files literally: no markup, and no codes that control the terminal."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, highlight=False)

    def render(self, *arguments: Any, **options: Any) -> Iterable[Segment]:
        """Pass every printed text through ``printable``, except the control codes of rich itself."""
        for segment in super().render(*arguments, **options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


PROGRESS_LINES = "GIRDLE_PROGRESS_LINES"
"""Environment variable that makes a command print each stage as a line on stderr, even if stderr is no terminal."""

PROGRESS = "progress: "
"""Prefix of a progress line on stderr."""


@contextmanager
def progress(errors: Console) -> Iterator[Callable[[str], None]]:
    """Show a line on stderr, if that is a terminal, with the present stage and the elapsed time.

    Where ``girdle app`` runs the command, each stage is a line of its own.
    """
    if os.environ.get(PROGRESS_LINES):
        yield lambda stage: print(f"{PROGRESS}{printable(stage)}", file=sys.stderr, flush=True)
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=errors, transient=True, disable=not errors.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        yield lambda stage: bar.update(task, description=stage)


def folding_table(title: str | None, names: Sequence[str], numbers: Sequence[str] = ()) -> Table:
    """Make an empty table; in a narrow terminal names are folded, and numbers are never cut."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in names:
        table.add_column(name, overflow="fold")
    for name in numbers:
        table.add_column(name, no_wrap=True, justify="right")
    return table
