"""Figures of worlds with several causes from the result lines of their cases: precision and recall, as Markdown.

A named cause is right if one of its names is active. An active cause is found if it is among the names of a named
cause. Every candidate of every world has an inclusion probability; the calibration error is over all of them.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from scripts.reporting import markdown
from scripts.research.named_causes.blind.report import (
    CAUSES,
    at_work,
    calibration,
    intervals_that_cover,
    mean_of,
    named,
    names_of,
    rate,
    surely_at_work,
)
from scripts.research.named_causes.blind.runs import Line


def several_report(lines: Sequence[Line]) -> str:
    """Tabulate the figures by number of active causes, and by cause."""
    sound = [line for line in lines if "failed" not in line and not line["label"].startswith("outside")]
    counts = sorted({_count(line) for line in sound})
    by_count = {f"{count} at work": [line for line in sound if _count(line) == count] for count in counts}
    columns = {**by_count, "all": sound}
    measures: dict[str, Callable[[list[Line]], str]] = {
        "worlds": lambda chosen: str(len(chosen)),
        "causes named that are at work (precision)": lambda chosen: rate(map(_right, *_flat(chosen))),
        "causes at work that are found (recall)": lambda chosen: rate(_found(chosen)),
        "names of a cause that is right": _names,
        "nothing at work: one blamed": lambda chosen: rate(named(line) for line in chosen if not _count(line)),
        "calibration error of 'at work'": calibration,
        "at work, of those that are with 0.9 or more": surely_at_work,
        "amplitude intervals that cover": lambda chosen: rate(intervals_that_cover(chosen)),
        "share left over: told": lambda chosen: mean_of([told for told, _ in _shares(chosen)]),
        "share left over: true": lambda chosen: mean_of([true for _, true in _shares(chosen)]),
        "share left over: told within 20 % of the true": lambda chosen: rate(
            abs(told - true) <= 0.2 * true for told, true in _shares(chosen)
        ),
    }
    by_measure = [[name, *(measure(chosen) for chosen in columns.values())] for name, measure in measures.items()]
    by_cause = [[name, *_of_cause(name, sound)] for name in CAUSES if any(name in at_work(line) for line in sound)]
    header = ["cause", "found where at work", "first names that are right", "other names that are right"]
    return "\n\n".join([markdown(["", *columns], by_measure), markdown(header, by_cause)])


def _count(line: Line) -> int:
    return len(at_work(line) - {"none"})


def _flat(lines: Iterable[Line]) -> tuple[list[Line], list[list[str]]]:
    """Return every named cause together with its world's line."""
    pairs = [(line, names) for line in lines if named(line) for names in line["causes"]]
    return [line for line, _ in pairs], [names for _, names in pairs]


def _right(line: Line, names: Sequence[str]) -> bool:
    return bool(at_work(line) & set(names))


def _finds(line: Line, cause: str) -> bool:
    return named(line) and cause in names_of(line)


def _found(lines: Iterable[Line]) -> list[bool]:
    return [_finds(line, cause) for line in lines if _count(line) for cause in at_work(line)]


def _names(lines: list[Line]) -> str:
    sizes = [len(names) for line, names in zip(*_flat(lines), strict=True) if _right(line, names)]
    return mean_of(sizes)


def _shares(lines: Iterable[Line]) -> list[tuple[float, float]]:
    """List the share of the gap that no cause explains, as the diagnosis reports it and the true one."""
    pairs = [(line["left_over_share"], line.get("true_left_over_share")) for line in lines]
    return [(told, true) for told, true in pairs if true is not None and np.isfinite([told, true]).all()]


def _of_cause(name: str, lines: list[Line]) -> list[str]:
    worlds, causes = _flat(lines)
    first = [name in at_work(line) for line, names in zip(worlds, causes, strict=True) if names[0] == name]
    other = [name in at_work(line) for line, names in zip(worlds, causes, strict=True) if name in names[1:]]
    return [rate(_finds(line, name) for line in lines if name in at_work(line)), rate(first), rate(other)]
