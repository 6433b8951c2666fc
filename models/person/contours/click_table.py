"""Clicks as a CSV file, one row per click: slice, x_px, y_px and, if needed, use, surface, subject and posture."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from models.person.contours.image_slices import ImageSlice
from models.person.contours.slice_stack import SliceClicks
from motions.errors import InputError
from motions.files import atomic_write
from motions.formats.text import numbers
from motions.motion_csv.rows import Row, read_table
from motions.motion_csv.writing import csv_text

NEEDED = ("slice", "x_px", "y_px")

DRAW, CORRECT = "draw", "correct"
"""Uses of a click: a point of a contour; or, three clicks one after the other, from, to and via of a correction."""

DIGITS = 2
"""Decimals of the pixel coordinates that the file holds."""

_POINTS_OF_CORRECTION = 3


class Label(NamedTuple):
    """Subject, posture and surface of a contour: a surface of ``girdle model --points``, or another (a muscle)."""

    subject: str = ""
    posture: str = ""
    surface: str = "thorax"


class Click(NamedTuple):
    """One click, a row of the file."""

    label: Label
    slice: int
    """Index of the slice, from 0."""
    x_px: float
    y_px: float
    use: str = DRAW


def read_clicks(path: Path, slices: Sequence[ImageSlice]) -> list[Click]:
    """Read clicks. InputError, with the line, where a row is wrong."""
    table, file = read_table(path), str(path)
    missing = [name for name in NEEDED if name not in table.columns]
    if missing:
        remedy = "Give slice, x_px, y_px and, if need be, use, surface, subject, posture"
        raise InputError(file, 1, f"there is no column {' or '.join(missing)}", remedy)
    cells = np.array([[row.cells[name] for name in NEEDED[1:]] for row in table.rows], dtype=object).reshape(-1, 2)
    places = numbers(cells, [row.line for row in table.rows], file)
    return [_click(row, xy, slices) for row, xy in zip(table.rows, places, strict=True)]


def _click(row: Row, xy: np.ndarray, slices: Sequence[ImageSlice]) -> Click:
    use = row.cells.get("use", "").strip() or DRAW
    if use not in (DRAW, CORRECT):
        raise InputError(row.file, row.line, f"there is no use {use!r}", f"Write {DRAW} or {CORRECT}")
    words = {name: row.cells.get(name, "").strip() for name in Label._fields}
    label = Label(**{name: word for name, word in words.items() if word})
    number = _slice_number(row, slices)
    rows, columns = slices[number].grey.shape
    if not (-0.5 <= xy[0] <= columns - 0.5 and -0.5 <= xy[1] <= rows - 0.5):  # NaN, an empty cell, fails too
        cause = f"the click at ({xy[0]:g}, {xy[1]:g}) is not in the image of {columns} x {rows} pixels"
        raise InputError(row.file, row.line, cause, "Count pixels from 0, x along a row, y down a column")
    return Click(label, number, float(xy[0]), float(xy[1]), use)


def _slice_number(row: Row, slices: Sequence[ImageSlice]) -> int:
    """Return the index of a row's slice, given by file name with or without ending, else by its number from 1."""
    word = row.cells["slice"].strip()
    names = [Path(one.file) for one in slices]
    named = [k for k, name in enumerate(names) if word in (name.name, name.stem)]
    if len(named) == 1:
        return named[0]
    if not named and word.isdecimal() and 1 <= int(word) <= len(slices):
        return int(word) - 1
    cause = f"there {'are several slices' if named else 'is no slice'} {word!r}"
    raise InputError(row.file, row.line, cause, f"Write the name of its file, or a number from 1 to {len(slices)}")


def by_slice(clicks: Sequence[Click], file: str) -> dict[Label, dict[int, SliceClicks]]:
    """Collect the clicks of each contour in each slice, in the order of the rows.

    InputError where the number of clicks in a slice does not make a contour or corrections.
    """
    found: dict[Label, dict[int, SliceClicks]] = {}
    for label, k in dict.fromkeys((one.label, one.slice) for one in clicks):
        mine = [one for one in clicks if (one.label, one.slice) == (label, k)]
        drawn, others = (np.array([[c.x_px, c.y_px] for c in mine if c.use == use]).T for use in (DRAW, CORRECT))
        where = f"{label.surface} in slice {k + 1}"
        if drawn.size and drawn.shape[1] < _POINTS_OF_CORRECTION:
            cause = f"{drawn.shape[1]} clicks draw no closed contour ({where})"
            raise InputError(file, None, cause, "Give three or more; four do for a round one")
        if others.size and others.shape[1] % _POINTS_OF_CORRECTION:
            cause = f"{others.shape[1]} clicks are no corrections ({where})"
            raise InputError(file, None, cause, "A correction has three: from and to on the contour, and via")
        corrections = np.split(others, others.shape[1] // _POINTS_OF_CORRECTION, axis=1) if others.size else []
        found.setdefault(label, {})[k] = SliceClicks(drawn if drawn.size else None, tuple(corrections))
    return found


def write_clicks(path: Path, clicks: Sequence[Click], slices: Sequence[ImageSlice]) -> None:
    """Write clicks in the format that :func:`read_clicks` reads."""
    rows = [
        {**one.label._asdict(), "slice": Path(slices[one.slice].file).name, "x_px": f"{one.x_px:.{DIGITS}f}"}
        | {"y_px": f"{one.y_px:.{DIGITS}f}", "use": one.use}
        for one in clicks
    ]
    atomic_write(path, as_csv(rows, [*Label._fields, *NEEDED, "use"]))


def as_csv(rows: Sequence[Mapping[str, object]], columns: Sequence[str]) -> str:
    """Format rows as CSV."""
    return csv_text([columns, *([str(row[name]) for name in columns] for row in rows)])
