# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Tables as numpy arrays with a field a column: what a file without pickle holds, every number as it is."""

from collections.abc import Callable, Iterable

import numpy as np
import pandas as pd
from jaxtyping import Shaped

Rows = Shaped[np.ndarray, " rows"]
"""A structured array."""


def as_rows(table: pd.DataFrame) -> Rows:
    """Turn a table of numbers and text into an array; a column of neither is text."""
    columns = [table[name] for name in table]
    arrays = [column.to_numpy() if column.dtype.kind in "iuf" else _text(column) for column in columns]
    return np.rec.fromarrays(arrays, names=list(table))


def _text(column: pd.Series) -> Shaped[np.ndarray, " rows"]:
    return np.array(column.tolist(), dtype=str)


def as_table(parts: Callable[[], Iterable[Rows]]) -> pd.DataFrame:
    """Turn arrays of the same columns into one table; a part without rows has no say in what its columns are.

    ``parts`` gives them anew for each column: at once, they would be in memory beside the table.
    """
    columns: tuple[str, ...] = ()
    for rows in parts():
        columns = rows.dtype.names or ()
        if len(rows):
            break
    else:
        return pd.DataFrame(columns=list(columns))
    return pd.DataFrame({one: np.concatenate([rows[one] for rows in parts() if len(rows)]) for one in columns})
