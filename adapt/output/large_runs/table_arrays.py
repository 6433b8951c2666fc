# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Tables as numpy arrays with one field per column, as a file without pickle can hold them, every number unchanged."""

from collections.abc import Callable, Iterable

import numpy as np
import pandas as pd
from jaxtyping import Shaped

Rows = Shaped[np.ndarray, " rows"]
"""Structured array with one element per row."""


def as_rows(table: pd.DataFrame) -> Rows:
    """Convert a table of numbers and text to an array; a column of neither becomes text."""
    columns = [table[name] for name in table]
    arrays = [column.to_numpy() if column.dtype.kind in "iuf" else _text(column) for column in columns]
    return np.rec.fromarrays(arrays, names=list(table))


def _text(column: pd.Series) -> Shaped[np.ndarray, " rows"]:
    return np.array(column.tolist(), dtype=str)


def as_table(chunks: Callable[[], Iterable[Rows]]) -> pd.DataFrame:
    """Convert arrays of the same columns to one table; a chunk without rows has no influence on the column types.

    ``chunks`` yields the arrays anew for each column: all arrays at once would take as much memory as the table again.
    """
    columns: tuple[str, ...] = ()
    for rows in chunks():
        columns = rows.dtype.names or ()
        if len(rows):
            break
    else:
        return pd.DataFrame(columns=list(columns))
    # copies: a view of one column would hold all columns of its chunk
    found = {one: np.concatenate([rows[one].copy() for rows in chunks() if len(rows)]) for one in columns}
    return pd.DataFrame(found, copy=False)  # no second table in one block
