"""Numbers in text files."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from motions.errors import InputError
from motions.motion_csv.cells import NOT_MEASURED, to_number


def numbers(cells: np.ndarray, rows: Sequence[int], file: str) -> Float[np.ndarray, "rows columns"]:
    """Read the cells as numbers, NaN where one is empty or says nan. InputError at the first that is none.

    rows: the line of the file in which each row of the cells stands.
    """
    table = np.empty(cells.shape)
    for place, line in enumerate(cells):
        for column, cell in enumerate(line):
            text = str(cell).strip()
            try:
                table[place, column] = np.nan if text.lower() in NOT_MEASURED else to_number(text)
            except ValueError:
                remedy = "Write numbers with a decimal point; a gap is an empty cell or nan"
                raise InputError(file, rows[place], f"{text!r} is not a number", remedy) from None
            if np.isinf(table[place, column]):
                raise InputError(file, rows[place], f"{text!r} is infinite", "Empty the cell of what was not measured")
    return table
