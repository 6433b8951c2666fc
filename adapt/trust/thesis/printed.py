"""Printed tables of the thesis (``printed.toml``), and numbers that follow from them. Degrees and mm."""

import functools
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions import ANGLES

SETS = ("R2", "R4", "R6")

STATISTICS = {
    "mean": lambda x: x.mean(axis=0),
    "std": lambda x: x.std(axis=0, ddof=1),
    "max": lambda x: x.max(axis=0),
    "min": lambda x: x.min(axis=0),
}
"""Statistics in the last rows of Tables 6.1-6.4; ``std`` has n - 1 in its denominator."""

_MM_PER_CM = 10.0


@dataclass(frozen=True)
class Printed:
    """One printed table."""

    title: str
    pages: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    values: Float[np.ndarray, "rows columns"]

    def cell(self, row: str, column: str) -> float:
        """Return one number."""
        return float(self.values[self.rows.index(row), self.columns.index(column)])

    @property
    def of_subjects(self) -> Float[np.ndarray, "subjects columns"]:
        """Numbered rows of the table, without its statistics."""
        return self.values[[row.isdigit() for row in self.rows]]


@dataclass(frozen=True)
class Misprint:
    """Printed statistic that differs from the statistic of the printed subjects."""

    table: str
    row: str
    column: str
    printed: float
    recomputed: float


@functools.cache
def _document() -> dict:
    return tomllib.loads(Path(__file__).with_name("printed.toml").read_text(encoding="utf-8"))


@functools.cache
def tables() -> dict[str, Printed]:
    """Return every table, by name."""
    return {
        name: Printed(
            one["title"], one["pages"], tuple(one["rows"]), tuple(one["columns"]), np.array(one["values"], float)
        )
        for name, one in _document().items()
        if name != "misprint"
    }


def misprints() -> list[Misprint]:
    """Return the known misprints."""
    return [Misprint(**one) for one in _document()["misprint"]]


@functools.cache
def gaps_deg(adapted: bool) -> Float[np.ndarray, "sets angles subjects"]:
    """Return the gaps of the ten subjects in Tables 6.1 and 6.2 or, if adapted, 6.3 and 6.4; in the order of
    ``ANGLES``."""
    names = ("Table 6.3", "Table 6.4") if adapted else ("Table 6.1", "Table 6.2")
    bones = [tables()[name].of_subjects for name in names]
    by_set = [np.concatenate([bone[:, 3 * k : 3 * k + 3] for bone in bones], axis=1) for k in range(len(SETS))]
    return np.stack([one.T for one in by_set])


@functools.cache
def sd_mm() -> Float[np.ndarray, "sets adapted"]:
    """Return the SDs over ten subjects in Table 6.5, printed to 1 mm, in the order of ``ADAPTED``."""
    return _MM_PER_CM * tables()["Table 6.5"].values[1:, 1::2].T


@functools.cache
def adapted_mm() -> Float[np.ndarray, "sets adapted"]:
    """Return the means over ten subjects in Table 6.5, printed to 1 mm, in the order of ``ADAPTED``."""
    return _MM_PER_CM * tables()["Table 6.5"].values[1:, 0::2].T


@functools.cache
def own_mm() -> Float[np.ndarray, "sets adapted"]:
    """Return the sets' own parameters in Table 6.6, fitted to the thorax points alone, printed to 1 mm."""
    return _MM_PER_CM * tables()["Table 6.6"].values[1:].T


def least_mean_j_deg2(
    gaps: Float[np.ndarray, "sets angles subjects"], angles: tuple[str, ...] = ANGLES
) -> Float[np.ndarray, "sets subjects"]:
    """Compute the mean over some angles of the squared mean gaps: a lower bound of the motion's mean(J) (Jensen)."""
    return (gaps[:, [ANGLES.index(angle) for angle in angles]] ** 2).mean(axis=1)
