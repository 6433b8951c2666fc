"""Words and ranges in the source of a number of a parameter set, which say how far the number is the person's own."""

import re

MEASURED = "measured"
"""First word of the source of a number that was measured on the person."""

DOUBTFUL = ("assumed", "derived")
"""First words of the source of a number that was not measured."""

ADAPTED_TO = "adapted to "
"""First words of the source of an adapted number."""

_MARK = r"(?:±|\+ ?/? ?[-−])\s*"

_RANGE = re.compile(_MARK + r"(\d+(?:\.\d*)?|\.\d+)\s*mm\.?$")
"""Pattern of the range at the end of a source; earlier in the text, a source may cite ranges of other numbers."""

_OTHER_RANGE = re.compile(_MARK + r"[-−]?[.,\d][^\s()]*(?:\s+[^\s;,()]+){0,2}(?:\s*\([^()]*\))?\.?$")
"""Pattern of a range at the end in another unit, without one, or with a number that cannot be read. A source in the
parentheses of another is that of another number."""


def begins_with(source: str, words: str | tuple[str, ...]) -> bool:
    """Check whether a source begins with such words, in small letters or capitals."""
    return source.strip().casefold().startswith(words)


def range_mm(source: str) -> float | None:
    """Return the range or SD at the end of a source, mm; None if it states none."""
    stated = _RANGE.search(source.strip())
    return float(stated[1]) if stated else None


def unread_range(source: str) -> str:
    """Return the range at the end of a source that :func:`range_mm` cannot read; empty if there is none.

    The source of an adapted number is the text of a run, which may end with numbers of its options.
    """
    found = None if begins_with(source, ADAPTED_TO) else _OTHER_RANGE.search(source.strip())
    return found[0] if found and range_mm(source) is None else ""
