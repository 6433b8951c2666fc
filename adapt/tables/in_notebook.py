"""Results as a notebook shows them: one line and a table."""

import math
from collections.abc import Iterable
from html import escape


def notebook_html(line: str, columns: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Write a line and a table as HTML; numbers have one digit after the point, and NaN is an empty cell."""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join(f"<tr>{''.join(f'<td>{escape(_cell(value))}</td>' for value in row)}</tr>" for row in rows)
    return f'<p>{escape(line)}</p><table class="dataframe"><tr>{head}</tr>{body}</table>'


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.1f}" if math.isfinite(value) else ""
