# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Tables as numpy arrays with a field a column: what a file without pickle holds, every number as it is."""

from collections.abc import Iterable

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


def as_table(parts: Iterable[Rows]) -> pd.DataFrame:
    """Turn arrays of the same columns into one table; a part without rows has no say in what its columns are."""
    tables: list[pd.DataFrame] = []
    names: tuple[str, ...] = ()
    for rows in parts:
        names = rows.dtype.names or ()
        tables.extend([pd.DataFrame(rows)] if len(rows) else [])
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(names))
