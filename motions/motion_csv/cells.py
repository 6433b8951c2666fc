"""Conversion of a cell of text to a name, a whole number, a measured value or a side; InputError for a bad cell."""

import math
import re
from typing import Literal

from motions.motion_csv.columns import ANGLES_FROM_LANDMARKS, ESTIMATED, SIDE, SLIPPED
from motions.motion_csv.rows import Row
from motions.table import LANDMARKS

Side = Literal["left", "right"]

NOT_MEASURED = frozenset(
    [
        *("", "nan", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind", "na", "n/a", "#n/a", "#nv", "<na>"),
        *("null", "none", "-", "--", "---"),
    ]
)
"""Texts of a cell, in any case, that mean 'not measured': nothing, or the word of some program for a missing value."""

_MINUS = "\u2212"
"""Typographic minus sign, which a spreadsheet writes in some languages."""

SIDES: dict[str, Side] = {"": "right", "right": "right", "r": "right", "left": "left", "l": "left"}
"""Side of the shoulder for each word that a file may use."""

_YES = frozenset(["yes", "y", "true", "1", "1.0"])
_NO = NOT_MEASURED | frozenset(["no", "n", "false", "0", "0.0"])
"""Texts of a cell, in any case, that say yes or no: words, and the truth values of programs."""

_NAMED = frozenset((*LANDMARKS, "IJ", "PX", "C7", "T8"))
"""Landmarks that may have slipped."""

LARGEST_ANGLE_DEG = 180.0
"""Maximum absolute angle in degrees: an angle is a rotation by at most half a turn."""

ANGLE_REMEDY = "Give angles in degrees between -180 and 180"

ELEVATION_REMEDY = (
    "Elevation is the angle of the humerus with the vertical, 0 to 180 degrees; ISB's beta of the humerus is its "
    "negative (elevation = -beta): turn its sign round"
)
"""Remedy for a negative elevation."""

LARGEST_POSTURE = 2**53
"""Maximum number of a posture: larger whole numbers have no exact float, so two of them could be taken for one."""


def name_in(row: Row, column: str) -> str:
    """Read the text of a cell that must not be empty."""
    text = row.cells[column]
    if not text:
        raise row.error(f"the cell of {column} is empty", f"Write the {column}'s name in every row")
    return text


def whole_number_in(row: Row, column: str) -> int:
    """Read the whole number in a cell; "3.0" is 3."""
    value = measured_in(row, column)
    if math.isnan(value):
        raise row.error(f"the cell of {column} is empty", "Number the postures of a motion 1, 2, 3, ...")
    if value != round(value) or abs(value) > LARGEST_POSTURE:
        cause = f"{column} is {_quoted(row.cells[column])}, not a whole number"
        raise row.error(cause, "Number the postures of a motion 1, 2, 3, ...")
    return round(value)


def measured_in(row: Row, column: str) -> float:
    """Read the finite number in a cell; NaN if the cell says 'not measured' (NOT_MEASURED)."""
    text = row.cells[column]
    try:
        value = to_number(text)
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    if text.lower() in NOT_MEASURED:
        return math.nan
    if math.isinf(value):
        raise row.error(f"{column} is infinite ({_quoted(text)})", "Empty the cell if it was not measured")
    remedy = "Write a number with a decimal point, or empty the cell if it was not measured"
    raise row.error(f"{column} is {_quoted(text)}, not a number", remedy)


def to_number(text: str) -> float:
    """Convert as ``float()`` does, but refuse what no file of numbers means: 1_000, and digits of other scripts.

    A typographic minus counts as a minus. Raise ValueError if the text is no number.
    """
    text = text.replace(_MINUS, "-")
    if "_" in text or not text.isascii():
        raise ValueError
    return float(text)


def angle_in(row: Row, column: str) -> float:
    """Read the angle in degrees in a cell, at most half a turn; NaN if not measured."""
    value_deg = measured_in(row, column)
    if abs(value_deg) > LARGEST_ANGLE_DEG:
        cause = f"{column} is {_quoted(row.cells[column])}, more than {LARGEST_ANGLE_DEG:.0f} degrees"
        raise row.error(cause, ANGLE_REMEDY)
    return value_deg


def elevation_in(row: Row) -> float:
    """Read the elevation of the humerus in degrees, 0 to 180; NaN if not measured."""
    value_deg = angle_in(row, "humerus_elevation_deg")
    if value_deg < 0.0:
        raise row.error(f"humerus_elevation_deg is {value_deg:g}, below 0", ELEVATION_REMEDY)
    return value_deg


def side_in(row: Row) -> Side:
    """Read the measured side: right unless the cell says left."""
    text = row.cells.get(SIDE, "")
    if text.lower() not in SIDES:
        raise row.error(f"{SIDE} is {_quoted(text)}", "Write left or right")
    return SIDES[text.lower()]


def says_yes(text: str) -> bool | None:
    """Read yes or no, or nothing, which is no; None for any other text."""
    word = text.strip().lower()
    return True if word in _YES else False if word in _NO else None


def landmarks_named(text: str) -> tuple[str, ...]:
    """Read names of landmarks, separated by blanks, commas or semicolons; none if the text says no."""
    return () if says_yes(text) is False else tuple(filter(None, re.split(r"[\s,;]+", text.upper())))


def check_marks(row: Row) -> None:
    """Raise InputError if a cell that says yes or no, or names landmarks that slipped, has another word."""
    for column in (ESTIMATED, ANGLES_FROM_LANDMARKS):
        if (text := row.cells.get(column)) and says_yes(text) is None:
            raise row.error(f"{column} is {_quoted(text)}", "Write yes or no")
    if (text := row.cells.get(SLIPPED)) and not _NAMED.issuperset(landmarks_named(text)):
        remedy = "Name the landmarks that slipped, such as AC TS, or empty the cell"
        raise row.error(f"{SLIPPED} is {_quoted(text)}, no landmark", remedy)


def _quoted(text: str, longest: int = 40) -> str:
    """Quote the text on one line, shortened to ``longest`` characters."""
    return repr(text if len(text) <= longest else text[:longest] + "...")
