"""Terminal output of ``girdle model``: the parameter sets that were made."""

from collections.abc import Sequence

from rich.console import Console

from adapt.cli.landmarks.person import Written
from adapt.cli.terminal.console import folding_table
from motions.files import printable

_PAIRS = (("SC", "AC"), ("AC", "TS"), ("AC", "AI"), ("TS", "AI"))


def print_persons(console: Console, written: Sequence[Written]) -> None:
    """Print the lengths of every person with their SDs, and notes on the measurements."""
    title = "Lengths, mm +- SD of the median (spread over the postures); posture taken for rest, where the chain closes"
    table = folding_table(title, ("subject", *("-".join(pair) for pair in _PAIRS), "at rest"))
    for one in written:
        sizes = [one.built.sizes[pair] for pair in _PAIRS]
        lengths = [
            f"{s.value_mm:.1f} +- {s.sd_mm:.1f}" + (f" ({s.spread_mm:.1f})" if s.postures > 1 else "") for s in sizes
        ]
        table.add_row(printable(one.subject), *lengths, printable(one.rest))
    console.print(table)
    for one in written:
        for line in (*one.contours, *one.built.notes):
            console.print(f"{printable(one.subject)}: {printable(line)}", soft_wrap=True)
    console.print(
        "An outlier that moves or turns all landmarks of a bone together does not show in their distances.",
        soft_wrap=True,
    )
    first = written[0].path
    where = str(first) if len(written) == 1 else f"{first.parent}, {len(written)} files"
    names = (
        f"; its name is {printable(written[0].subject)} (--subject is for files without names)"
        if len(written) == 1
        else ""
    )
    console.print(f"{where} written{names}", soft_wrap=True)
