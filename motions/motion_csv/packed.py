"""Compact storage of rows and postures: two million postures take 5 GB as objects, and 0.4 GB as columns."""

from array import array
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import repeat
from math import nan
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from motions.errors import InputError
from motions.motion_csv.posture_rows import Posture
from motions.motion_csv.rows import Row
from motions.table import ANGLES, LANDMARKS, Motions

_BETWEEN = "\0"
"""Separator of joined cells. No cell contains it, because a file with a null character is refused as binary
(``motions.motion_csv.rows``)."""


class PackedRow(NamedTuple):
    """Row whose cells are joined into one text; the rows of a file share the names of their columns."""

    file: str
    line: int
    names: tuple[str, ...]
    cells: str

    def unpacked(self) -> Row:
        """Return the original row."""
        return Row(self.file, self.line, dict(zip(self.names, self.cells.split(_BETWEEN), strict=True)))


def packed(row: Row) -> PackedRow:
    """Pack a row into a sixth of its memory."""
    return PackedRow(row.file, row.line, _shared(tuple(row.cells)), _BETWEEN.join(row.cells.values()))


@lru_cache
def _shared(names: tuple[str, ...]) -> tuple[str, ...]:
    return names


class PostureColumns:
    """Columns of a table of postures, filled one subject at a time; the place of each posture gives the final order."""

    def __init__(self) -> None:
        """Create empty columns."""
        self._places, self._posture = array("q"), array("q")
        self._subject: list[str] = []
        self._motion: list[str] = []
        self._elevation_deg, self._angles_deg = array("d"), array("d")
        self._landmarks_mm: dict[str, array[float]] = {}
        self._extra: dict[str, list[str]] = {}
        self._first: dict[str, tuple[int, int]] = {}

    def __len__(self) -> int:
        return len(self._places)

    def add(self, places: Iterable[int], postures: Sequence[Posture]) -> None:
        """Add the postures of one subject, each with its place in the files."""
        for place, posture in zip(places, postures, strict=True):
            self._add_landmarks(posture)
            self._add_extra(posture, place)
            self._places.append(place)
            self._posture.append(posture.number)
            self._subject.append(postures[0].subject)
            self._motion.append(_same(self._motion, posture.motion))
            self._elevation_deg.append(posture.humerus_elevation_deg)
            self._angles_deg.extend(posture.angles_deg)

    def _add_landmarks(self, posture: Posture) -> None:
        for name, position_mm in posture.landmarks_mm.items():
            column = self._landmarks_mm.setdefault(name, array("d"))
            column.extend(repeat(nan, 3 * len(self) - len(column)))
            column.extend(position_mm)

    def _add_extra(self, posture: Posture, place: int) -> None:
        for number, (name, cell) in enumerate(posture.extra.items()):
            column = self._extra.setdefault(name, [])
            column.extend(repeat("", len(self) - len(column)))
            column.append(_same(column, cell))
            self._first[name] = min(self._first.get(name, (place, number)), (place, number))

    def table(self, rejected: Sequence[InputError]) -> Motions:
        """Make the table of all postures in the order of their places.

        Each column is emptied when its array is made, so that only one column at a time is in memory twice.
        """
        self._fill_up()
        order = np.argsort(np.frombuffer(self._places, np.int64), kind="stable")
        return Motions(
            subject=np.array(_in_order(self._subject, order)),
            motion=np.array(_in_order(self._motion, order)),
            posture=np.frombuffer(self._posture, np.int64)[order],
            humerus_elevation_deg=np.frombuffer(self._elevation_deg)[order],
            angles_deg=_vectors(self._angles_deg, len(ANGLES), order),
            landmarks_mm={
                name: _vectors(self._landmarks_mm[name], 3, order) for name in LANDMARKS if name in self._landmarks_mm
            },
            extra=self._extra_table(order),
            rejected=tuple(rejected),
        )

    def _fill_up(self) -> None:
        """Fill columns that the last file lacks with NaN (landmarks) or empty text (extra columns)."""
        for column in self._landmarks_mm.values():
            column.extend(repeat(nan, 3 * len(self) - len(column)))
        for column in self._extra.values():
            column.extend(repeat("", len(self) - len(column)))

    def _extra_table(self, order: Int[np.ndarray, " postures"]) -> pd.DataFrame:
        """Return the columns that are not interpreted, as text, in the order of the files."""
        names = sorted(self._extra, key=self._first.__getitem__)
        columns = {name: _in_order(self._extra[name], order) for name in names}
        return pd.DataFrame(columns, index=pd.RangeIndex(len(order)), dtype=str)


def _same(earlier: Sequence[str], text: str) -> str:
    """Return the text, as the same object as the previous text if they are equal, to save memory."""
    return earlier[-1] if earlier and earlier[-1] == text else text


def _in_order(column: list[str], order: Int[np.ndarray, " postures"]) -> list[str]:
    """Return the texts in the given order, and empty the column."""
    ordered = [column[k] for k in order.tolist()]
    column.clear()
    return ordered


def _vectors(column: array, components: int, order: Int[np.ndarray, " postures"]) -> Float[np.ndarray, "postures n"]:
    """Return the vectors in the given order, and empty the column."""
    ordered = np.frombuffer(column).reshape(-1, components)[order]
    del column[:]
    return ordered
