"""Check of motions given as arrays, by the rules of a motion file."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from motions.errors import InputError, did_you_mean
from motions.motion_csv.cells import ANGLE_REMEDY, ELEVATION_REMEDY, LARGEST_ANGLE_DEG
from motions.motion_csv.unit_and_side import (
    FAR,
    LARGEST_METRES,
    SMALLEST_REACH_MM,
    Finding,
    not_in_mm,
    radians_in,
    radians_of,
)
from motions.table import ANGLES, LANDMARKS, Motions

_NUMBERS = "fiuO"
"""Kinds of arrays that are numbers: floats, whole numbers, and objects that convert to them."""


def check_motions(motions: object) -> Motions:
    """Return the motions with every number as a float, NaN where it is masked or infinite.

    Raise InputError if they are no Motions, have no posture, have a field of another shape, or break a rule of motion
    files about units, ranges, and postures that are there twice.
    """
    if not isinstance(motions, Motions):
        cause = f"this is a {type(motions).__name__}, not Motions"
        raise InputError("motions", None, cause, "Read a motion file: motions.read_motions(file)")
    number = _whole_numbers(motions.posture)
    count = len(number)
    if not count:
        raise InputError("motions", None, "there is no posture in them", "Select one at least")
    if not isinstance(motions.extra, pd.DataFrame) or len(motions.extra) != count:
        its = f"{len(motions.extra)} rows" if isinstance(motions.extra, pd.DataFrame) else "no rows"
        cause = f"extra has {its}, and posture has {count}"
        raise InputError("motions", None, cause, "Give a DataFrame with one row per posture")
    found = replace(
        motions,
        subject=_names(motions.subject, "subject", count),
        motion=_names(motions.motion, "motion", count),
        posture=number,
        humerus_elevation_deg=_numbers(motions.humerus_elevation_deg, "humerus_elevation_deg", (count,)),
        angles_deg=_numbers(motions.angles_deg, "angles_deg", (count, len(ANGLES))),
        landmarks_mm=_landmarks(motions.landmarks_mm, count),
    )
    _check_ranges(found)
    _check_rows(found)
    return found


def _error(cause: str, remedy: str) -> InputError:
    return InputError("motions", None, cause, remedy)


def _check_shape(shape: tuple[int, ...], field: str, wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        cause = f"{field} has the shape {shape}"
        raise _error(cause, f"Give {wanted}: one row per posture, as many as posture has")


def _numbers(values: object, field: str, wanted: tuple[int, ...]) -> Float[np.ndarray, "..."]:
    """Return the values as floats, NaN where masked or infinite. Raise InputError for another shape or for texts."""
    array = np.ma.asarray(values)
    _check_shape(array.shape, field, wanted)
    try:
        if array.dtype.kind not in _NUMBERS:
            raise TypeError
        floats = np.ma.filled(array.astype(float), np.nan)
    except (TypeError, ValueError):
        raise _error(f"{field} has entries of type {array.dtype}", "Give numbers, and NaN where not measured") from None
    return np.where(np.isfinite(floats), floats, np.nan)


def _whole_numbers(values: object) -> Int[np.ndarray, " postures"]:
    array = np.asarray(values)
    if array.ndim == 1 and array.dtype.kind in "iu":
        return array
    floats = _numbers(values, "posture", (array.size,))
    if not (floats == np.round(floats)).all():  # NaN compares false
        raise _error("posture has numbers that are not whole", "Number the postures of a motion 1, 2, 3, ...")
    return floats.astype(np.int64)


def _names(values: object, field: str, count: int) -> np.ndarray:
    """Return the names, as text if they are objects. Raise InputError where one is missing."""
    array = np.asarray(values)
    _check_shape(array.shape, field, (count,))
    if array.dtype.kind in "US":
        return array
    if (missing := np.asarray(pd.isna(array))).any():
        row = int(np.argmax(missing))
        raise _error(f"{field} is {array[row]} in row {row + 1}", f"Give the {field}'s name in every row")
    return array.astype(str) if array.dtype.kind == "O" else array


def _landmarks(positions: object, count: int) -> dict[str, Float[np.ndarray, "postures 3"]]:
    if not isinstance(positions, Mapping):
        cause = f"landmarks_mm is a {type(positions).__name__}"
        raise _error(cause, "Give a dict of positions by landmark; {} where none was measured")
    for name in positions:
        if name not in LANDMARKS:
            known = f"{did_you_mean(str(name), LANDMARKS)}The landmarks are {', '.join(LANDMARKS)}"
            raise _error(f"landmarks_mm has {name!r}, which is no landmark", known)
    return {name: _numbers(xyz, f"landmarks_mm[{name!r}]", (count, 3)) for name, xyz in positions.items()}


def _check_ranges(motions: Motions) -> None:
    """Raise InputError for an angle beyond half a turn or an elevation below 0."""
    for field in ("angles_deg", "humerus_elevation_deg"):
        values = getattr(motions, field)
        if (np.abs(values) > LARGEST_ANGLE_DEG).any():  # NaN compares false
            most = values.ravel()[np.nanargmax(np.abs(values))]
            cause = f"{field} goes to {most:g}, more than {LARGEST_ANGLE_DEG:.0f} degrees"
            raise _error(cause, ANGLE_REMEDY)
    if (motions.humerus_elevation_deg < 0.0).any():
        cause = f"humerus_elevation_deg goes to {np.nanmin(motions.humerus_elevation_deg):g}, below 0"
        raise _error(cause, ELEVATION_REMEDY)


def _check_rows(motions: Motions) -> None:
    """Raise InputError for a posture that is there twice, and for a subject with another unit.

    A million postures take three seconds: only subjects with small numbers are looked at one by one.
    """
    order = np.lexsort((motions.posture, motions.motion, motions.subject))
    subject, motion, number = (values[order] for values in (motions.subject, motions.motion, motions.posture))
    other_subject = np.append(True, subject[1:] != subject[:-1])
    other_motion = other_subject | np.append(True, motion[1:] != motion[:-1])
    again = np.flatnonzero(~other_motion[1:] & (number[1:] == number[:-1]))
    if len(again):
        row = int(again[0])
        cause = f"posture {number[row]} of motion {str(motion[row])!r} of {str(subject[row])!r} is there twice"
        raise _error(cause, "Leave one of them out, or give it another number, motion or subject")
    subjects, kinds = np.flatnonzero(other_subject), np.flatnonzero(other_motion)
    angles, elevation = motions.angles_deg[order], motions.humerus_elevation_deg[order]
    reach = {name: np.abs(xyz[order]).max(axis=1) for name, xyz in motions.landmarks_mm.items()}

    def look(groups, doubtful, rule: Callable[[int, slice], Finding | None]) -> None:
        ends = np.append(groups[1:], len(order))
        for k in np.flatnonzero(doubtful).tolist():
            if finding := rule(k, slice(groups[k], ends[k])):
                raise _error(f"subject {str(subject[groups[k]])!r}: {finding.cause}", finding.remedy)

    largest = np.fmax.reduceat(np.fmax.reduce(np.abs(angles), axis=1), subjects)
    look(subjects, largest <= np.pi, lambda _, rows: radians_in(angles[rows]))
    highest = np.fmax.reduceat(elevation, kinds)
    look(kinds, highest <= np.pi, lambda k, rows: radians_of(elevation[rows], str(motion[kinds[k]])))
    if reach:
        farthest = {name: np.fmax.reduceat(far, subjects) for name, far in reach.items()}
        near = np.fmax.reduce(list(farthest.values()), axis=0) < LARGEST_METRES
        near |= np.any([farthest[name] < SMALLEST_REACH_MM for name in FAR if name in farthest], axis=0)
        look(subjects, near, lambda k, _: not_in_mm({name: far[k] for name, far in farthest.items()}))
