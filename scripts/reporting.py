"""What the printed results of several studies share: Markdown tables, and how sure a rate is."""

import math
from collections.abc import Iterable, Sequence


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *rows))


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """The interval of a rate within z standard deviations (Wilson, J. Am. Stat. Assoc. 22, 1927): 95 %."""
    centre, square = hits + 0.5 * z**2, z**2
    half = z * math.sqrt(hits * (n - hits) / n + 0.25 * square)
    return max(0.0, (centre - half) / (n + square)), min(1.0, (centre + half) / (n + square))
