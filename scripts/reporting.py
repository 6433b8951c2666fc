"""Helpers that several scripts share: command-line input, tables, timing, Markdown, and Wilson intervals of rates."""

import argparse
import math
import time
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path

import pandas as pd
import typer

from motions import InputError, Motions, read_motions

NAMES = ("model", "subject", "motion")

CADAVER_SETS = ("breteler_dissection", "breteler_mri", "R2", "R4", "R6")
"""The shipped sets of whole cadavers. das3 is not one of them: it has contact points in place of TS and AI."""


def bone_pins(parser: argparse.ArgumentParser) -> tuple[Motions, argparse.Namespace]:
    """Add arguments for measured motions and parameter sets, parse the command line and read the motions; exit with a
    message where the files hold no motions."""
    parser.add_argument("motions", nargs="+", type=Path, help="motion files of bone-pin shoulders")
    sets = f"parameter sets; default: {', '.join(CADAVER_SETS)}"
    parser.add_argument("--model", action="append", default=[], help=sets)
    options = parser.parse_args()
    options.model = options.model or CADAVER_SETS
    return measured(parser, options.motions), options


def measured(parser: argparse.ArgumentParser, files: Sequence[Path]) -> Motions:
    """Read measured motions; exit with a message where the files hold no motions."""
    try:
        return read_motions(*files)
    except InputError as error:
        parser.error(f"{error} The measured motions are not part of the project: docs/evidence.md has their source.")


def read_table(path: Path, columns: Collection[str] = ()) -> pd.DataFrame:
    """Read a table that `girdle adapt` wrote. InputError unless it has these columns; names stay text, even digits."""
    try:
        table = pd.read_csv(path, converters=dict.fromkeys(NAMES, str))
    except (OSError, ValueError) as error:
        cause = "this is no table that can be read"
        raise InputError(str(path), None, cause, "Name what `girdle adapt` wrote, in its folder") from error
    if missing := [name for name in columns if name not in table.columns]:
        raise InputError(str(path), None, f"it has no column {missing[0]}", "Run `girdle adapt` anew")
    return table


def check_known(names: Iterable[str], known: Collection[str], what: str) -> None:
    """Raise BadParameter for the first name from the command line that is not known."""
    if unknown := [name for name in names if name not in known]:
        raise typer.BadParameter(f"no {what} is called '{unknown[0]}'. Take some of {', '.join(known)}")


def timed(run: Callable[[], object]) -> float:
    """Return the wall time of a call, in seconds."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table as Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *rows))


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Compute Wilson's score interval of a rate (J. Am. Stat. Assoc. 22, 1927); the default value of z gives 95 %."""
    centre, square = hits + 0.5 * z**2, z**2
    half = z * math.sqrt(hits * (n - hits) / n + 0.25 * square)
    return max(0.0, (centre - half) / (n + square)), min(1.0, (centre + half) / (n + square))
