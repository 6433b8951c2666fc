"""Writing of a table of postures as a motion file."""

import os
from collections.abc import Iterable, Iterator

import numpy as np

from motions.files import atomic_write
from motions.motion_csv.columns import REQUIRED, landmark_columns
from motions.table import Motions


def write_motions(motions: Motions, path: str | os.PathLike[str]) -> None:
    """Write the postures to a CSV file, whole or not at all; reading it gives bitwise equal arrays.

    Numbers have as many digits as their value needs, NaN is an empty cell, and extra columns are unchanged. The file
    holds a right shoulder. Raise InputError if the file cannot be written.
    """
    landmarks = [column for name in motions.landmarks_mm for column in landmark_columns(name)]
    header = [*REQUIRED, *landmarks, *motions.extra.columns]
    atomic_write(path, csv_text((header, *_rows(motions))))


def csv_text(rows: Iterable[Iterable[str]]) -> str:
    """Format rows of cells as CSV."""
    return "\n".join(",".join(map(_quoted_if_needed, cells)) for cells in rows) + "\n"


def _rows(motions: Motions) -> Iterator[list[str]]:
    """Yield the cells of each posture, in the order of the columns."""
    numbers = np.column_stack([motions.humerus_elevation_deg, motions.angles_deg, *motions.landmarks_mm.values()])
    extra = motions.extra.astype(str).to_numpy()
    for place, number in enumerate(motions.posture.tolist()):
        names = [str(motions.subject[place]), str(motions.motion[place]), str(number)]
        yield [*names, *map(_number, numbers[place].tolist()), *extra[place].tolist()]


def _number(value: float) -> str:
    """Write the shortest text that reads back as the same number; empty if not measured."""
    return "" if np.isnan(value) else repr(value)


def _quoted_if_needed(cell: str) -> str:
    """Quote a cell for CSV where needed.

    ``csv.writer`` is not used: in some versions of Python it leaves a carriage return without quotation marks.
    """
    if any(character in cell for character in ',"\r\n'):
        return '"' + cell.replace('"', '""') + '"'
    return cell
