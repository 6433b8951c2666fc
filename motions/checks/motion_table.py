"""Checks of a table of postures by itself: copied cells or rows, radians, postures out of line, rows of totals."""

from collections.abc import Iterator, Sequence
from math import factorial

import numpy as np
from jaxtyping import Bool, Float, Int

from motions.checks.signs import LARGE_MOTION_DEG, LOW_DEG
from motions.table import ANGLES, BONES, Motions

SCAPULA_Z = ANGLES.index("scapula_z")

Doubt = tuple[str, str]
"""Cause and remedy."""

LARGEST_RADIANS = 1.0
"""Maximum of the elevation and axial rotation of a clavicle and of the tipping of a scapula, in radians. An angle in
degrees that stays below 1 while the arm rises by 60 changes by less than the noise of a measurement, and by less than a
tenth of its change in people."""

_IN_RADIANS: dict[str, float] = {
    **dict.fromkeys(("clavicle_z", "clavicle_x", "scapula_x"), LARGEST_RADIANS),
    **dict.fromkeys(("clavicle_y", "scapula_y", "scapula_z"), float(np.pi)),
}
"""Maximum of each angle in radians. Motion files with one of the last three in radians are refused
(``motions.motion_csv.unit_and_side``)."""

_FEWEST_VALUES = 3

FEWEST_STILL = 5
"""Minimum number of values: fewer may be equal by chance or by hand."""

OUT_OF_LINE_DEG, MOST_OUT_DEG = 20.0, 45.0
"""Maximum deviations in degrees of a posture from the mean of its two neighbours: the first in addition to the change
of elevation to a neighbour (no girdle turns faster than the arm), the second in any case. Measured motions have up to 2
in addition, simulated ones none."""

BESIDE_DEG, MOST_BESIDE_DEG = 50.0, 90.0
"""Maximum deviations in degrees, in the same sense, of a first or last posture with the arm low from its one neighbour.
Measured: up to 6; simulated girdles that jump to another branch: up to 47, and more with the arm high."""

COPIED_ELEVATION_DEG = 5.0
"""Change of elevation in degrees over which six measured angles never stay equal to the last digit."""

BEYOND_ARM_DEG = 25.0
"""Maximum excess, in degrees, of the scapula's lateral rotation over the arm's elevation in a motion. Measured: up to
13, in horizontal flexion and axial rotation."""

LOW_ARM_DEG, MOST_OF_LOW_ARM_DEG = 20.0, 20.0
"""Elevation in degrees that the arm never exceeds, and maximum change of lateral rotation with it. With the arm at the
side, measured scapulae turn by up to 3, and shrugs turn them by some 15. A tenth of the elevation stays below 18."""

ARM_OUT_DEG, LEAST_OF_GIRDLE = 30.0, 0.1
"""Minimum deviation in degrees of an elevation from the mean of its two neighbours, and minimum share of it by which
an angle of the girdle then deviates too. In a motion a scapula turns by a third of the arm or more, at its beginning by
a tenth."""

SMOOTH_DEG = 15.0
"""Maximum deviation in degrees of all other elevations of the motion; of postures in any order some exceed it."""

NEAR_LOWEST_DEG = 2.0
"""Height in degrees above the lowest elevation of a motion up to which an angle may be 0 by definition, such as the
estimated axial rotation of the clavicle."""

_COMMON_SHARE = 0.25
"""Share of the values of an angle that have no further digits: its number of digits. Random values have a tenth."""

_BESIDE_ZERO_DEG = 2.0
"""Minimum of the values before and after a 0 in degrees. They have one sign, for the angle not to pass through 0."""

_DIGITS_AWAY, _ROUND_ZERO_DEG, RARE = 10.0, 5.0, 1e-4
"""Distances from 0 without any other value, in last digits, and with few values, in degrees; and maximum probability of
the exact zeros of an angle that passes through 0, if its values lie as densely at 0 as about it."""

_TOTALS = frozenset(["mean", "average", "avg", "total", "totals", "sum", "sd", "std", "stdev", "median", "min", "max"])
"""Names, in upper or lower case, of rows that a spreadsheet computes."""

_MOST_SAID = 3
"""Maximum number of postures in a message."""


def zero_or_radians(mine: Motions) -> Doubt | None:
    """Find angles that are 0 in every posture, or small while the arm moves."""
    known = _known_angles(mine, _FEWEST_VALUES)
    zero = [f"{angle}_deg" for angle, values in known.items() if not values.any()]
    if zero and len(zero) < len(known):
        return (
            f"{' and '.join(zero)} is 0 in every posture",
            "Empty its cells if it was not measured: 0 counts as measured",
        )
    if not arm_moves(mine):
        return None
    most = {angle: float(np.abs(values).max()) for angle, values in known.items()}
    small = [f"{angle}_deg" for angle in most if 0.0 < most[angle] <= _IN_RADIANS[angle]]
    if not small:
        return None
    limit = max(_IN_RADIANS[name.removesuffix("_deg")] for name in small)
    cause = f"{' and '.join(small)} never exceeds {limit:.3g} while the arm moves: it looks like radians"
    return cause, "Give degrees"


def zero_for_gap(mine: Motions) -> Doubt | None:
    """Find angles that are exactly 0 in some postures, more often than an angle that passes through 0."""
    for angle, values in zip(ANGLES, mine.angles_deg.T, strict=True):
        zeros, others = np.flatnonzero(values == 0.0), np.abs(values[np.isfinite(values) & (values != 0.0)])
        if len(zeros) < 2 or len(others) < FEWEST_STILL:
            continue
        zeros = [row for _, rows in in_order(mine) for row in _steps_to_zero(mine, rows, angle)]
        digit, few = _last_digit(others), min(len(zeros), FEWEST_STILL)
        expected = (np.sum(others <= _ROUND_ZERO_DEG) + 1) * digit / (2.0 * _ROUND_ZERO_DEG)
        is_rare = few > 1 and expected**few < RARE * factorial(few)
        if is_rare and digit < 1.0 and others.min() > _DIGITS_AWAY * digit:
            cause = f"{angle}_deg is exactly 0 in {len(zeros)} postures, first {posture_of(mine, zeros[0])}"
            return cause, "Empty its cells if it was not measured: 0 counts as measured"
    return None


def _steps_to_zero(mine: Motions, rows: Int[np.ndarray, " rows"], angle: str) -> list[int]:
    """List the rows of a motion in which an angle is 0, while the values before and after are not about 0.

    The axial rotation of the clavicle may begin at 0, by its definition: neither the first posture counts, nor those
    with the arm lowest.
    """
    elevation, values = mine.humerus_elevation_deg[rows], mine.angles_deg[rows, ANGLES.index(angle)]
    zeros, others = values == 0.0, np.flatnonzero(values)
    if angle == "clavicle_x":
        lowest = np.min(elevation, where=np.isfinite(elevation), initial=np.inf)
        zeros &= np.logical_not(elevation <= lowest + NEAR_LOWEST_DEG) & (np.arange(len(rows)) > 0)
    found = []
    for n in np.flatnonzero(zeros):
        beside = values[[*others[others < n][-1:], *others[others > n][:1]]]
        if np.min(np.abs(beside), initial=np.inf) > _BESIDE_ZERO_DEG and len(set(np.sign(beside))) < 2:
            found.append(int(rows[n]))
    return found


def _last_digit(values: Float[np.ndarray, " n"]) -> float:
    """Return the unit of the last digit that most values have, at most 1."""
    for decimals in range(6):
        if np.mean(np.abs(values - np.round(values, decimals)) <= _ROUNDING) >= _COMMON_SHARE:
            return 10.0**-decimals
    return 1e-6


def columns_alike(mine: Motions) -> Doubt | None:
    """Find two angles with the same values to the last digit in every posture."""
    one, other = mine.angles_deg[:, :, None], mine.angles_deg[:, None, :]
    same = ((one == other) | np.isnan(one + other)).all(axis=0)
    for a, b in np.argwhere(np.triu(same, 1)):
        values = mine.angles_deg[np.isfinite(mine.angles_deg[:, [a, b]]).all(axis=1), a]
        if len(np.unique(values)) >= FEWEST_STILL and _has_digits(values[:, None], 0).any():
            cause = f"{ANGLES[a]}_deg and {ANGLES[b]}_deg are the same in every posture"
            return cause, "Is one column a copy of the other?"
    return None


def stands_still(mine: Motions) -> Doubt | None:
    """Find angles other than 0 that are equal in every posture while the arm moves."""
    if not arm_moves(mine):
        return None
    known = _known_angles(mine, FEWEST_STILL)
    still = [f"{angle}_deg" for angle, values in known.items() if values.any() and not np.ptp(values)]
    if not still:
        return None
    cause = f"{', '.join(still)} is the same in every posture while the arm moves"
    return cause, "Was a cell copied down? Empty its cells if it was not measured"


def _known_angles(mine: Motions, fewest: int) -> dict[str, Float[np.ndarray, " known"]]:
    """Return the measured values of each angle that has at least ``fewest`` of them."""
    known = {angle: values[np.isfinite(values)] for angle, values in zip(ANGLES, mine.angles_deg.T, strict=True)}
    return {angle: values for angle, values in known.items() if len(values) >= fewest}


def arm_moves(mine: Motions) -> bool:
    """Check whether the elevations of a subject span ``LARGE_MOTION_DEG``."""
    elevation = mine.humerus_elevation_deg[np.isfinite(mine.humerus_elevation_deg)]
    return bool(len(elevation)) and bool(np.ptp(elevation) >= LARGE_MOTION_DEG)


def out_of_line(mine: Motions) -> Doubt | None:
    """Find angles far from their neighbours in a motion: from two alike ones, or from one at an end with the arm low.

    The cause is a wrong sign, digit or marker.
    """
    found = []
    for motion, rows in in_order(mine):
        if len(rows) < 3:  # no posture has two neighbours
            continue
        angles, steps = mine.angles_deg[rows], np.abs(np.diff(mine.humerus_elevation_deg[rows]))
        steps = np.where(np.isnan(steps), np.inf, steps)
        before, here, after = (angles[k : len(rows) - 2 + k] for k in range(3))
        most = np.minimum(OUT_OF_LINE_DEG + (steps[1:] + steps[:-1]) / 2.0, MOST_OUT_DEG)
        away, apart = np.abs(here - (before + after) / 2.0), np.abs(after - before) / 2.0
        found += [
            f"{ANGLES[k]}_deg is {here[n, k]:.0f} in posture {mine.posture[rows[n + 1]]} of {motion!r}, "
            f"{before[n, k]:.0f} before and {after[n, k]:.0f} after it"
            for n, k in np.argwhere((away > most[:, None]) & (apart < away / 2.0))
        ]
        for end, beside, then, step in ((0, 1, 2, steps[0]), (-1, -2, -3, steps[-1])):
            if not mine.humerus_elevation_deg[rows[end]] <= LOW_DEG:
                continue
            away, apart = np.abs(angles[end] - angles[beside]), np.abs(angles[beside] - angles[then])
            most_beside = min(BESIDE_DEG + step, MOST_BESIDE_DEG)
            found += [
                f"{ANGLES[k]}_deg is {angles[end, k]:.0f} in posture {mine.posture[rows[end]]} of {motion!r}, "
                f"{angles[beside, k]:.0f} beside it"
                for k in np.flatnonzero((away > most_beside) & (apart < away / 2.0))
            ]
    return (some_of(found), "Look at its sign and digits, or delete the row") if found else None


def arm_out_of_line(mine: Motions) -> Doubt | None:
    """Find elevations far from those of two alike neighbours in a motion, while no angle of the girdle is.

    Without them the elevation changes smoothly: postures in any order are no motion.
    """
    found = []
    for motion, rows in in_order(mine):
        table = np.column_stack([mine.humerus_elevation_deg[rows], mine.angles_deg[rows]])
        before, here, after = table[:-2], table[1:-1], table[2:]
        away, apart = np.abs(here - (before + after) / 2.0), np.abs(after - before)[:, 0] / 2.0
        if not (away[:, 0] > ARM_OUT_DEG).any():
            continue
        girdle = np.max(away[:, 1:], axis=1, where=np.isfinite(away[:, 1:]), initial=0.0)
        off = (away[:, 0] > ARM_OUT_DEG) & (apart < away[:, 0] / 2.0) & (girdle < LEAST_OF_GIRDLE * away[:, 0])
        off &= np.isfinite(away[:, 1:]).any(axis=1)
        smooth = np.delete(table[:, 0], np.flatnonzero(off) + 1)
        if len(smooth) < FEWEST_STILL or not (np.abs(np.diff(smooth, 2)) / 2.0 <= SMOOTH_DEG).all():
            continue
        found += [
            f"humerus_elevation_deg is {here[n, 0]:.0f} in posture {mine.posture[rows[n + 1]]} of {motion!r}, "
            f"{before[n, 0]:.0f} before and {after[n, 0]:.0f} after it, and the girdle does not follow"
            for n in np.flatnonzero(off)
        ]
    return (some_of(found), "Correct it, or empty the cell if it was not measured") if found else None


def nothing_of_bone(mine: Motions) -> Doubt | None:
    """Find postures in which no angle of a bone exceeds pi: zeros, radians, or angles from rest.

    In every measured and simulated posture, one angle of the clavicle exceeds 9 degrees and one of the scapula 13.
    """
    found = []
    for bone, part in BONES.items():
        angles = np.abs(mine.angles_deg[:, part])
        known = np.isfinite(angles)
        small = known[:, 0] & (known.sum(axis=1) > 1) & (np.where(known, angles, 0.0).max(axis=1) <= np.pi)
        found += [
            f"{posture_of(mine, row)} all angles of the {bone} are within 3.14"
            for row in np.flatnonzero(small).tolist()
        ]
    if not found:
        return None
    return some_of(found), "Give degrees from the thorax, not radians and not from rest; empty what was not measured"


def copied_rows(mine: Motions) -> Doubt | None:
    """Find postures with all angles of the previous one although the arm moved, and motions of one constant posture."""
    found = []
    for motion, rows in in_order(mine):
        angles, elevation = np.nan_to_num(mine.angles_deg[rows], nan=np.inf), mine.humerus_elevation_deg[rows]
        same = (angles[1:] == angles[:-1]).all(axis=1)
        if not same.any():
            continue
        if len(rows) >= _FEWEST_VALUES and same.all():
            found.append(f"all {len(rows)} postures of {motion!r} are the same")
            continue
        moved = np.abs(np.diff(elevation)) >= COPIED_ELEVATION_DEG  # NaN compares false
        moved &= _has_digits(mine.angles_deg[rows[1:]], 0)  # angles in whole degrees may stay equal
        frozen = same & _has_digits(mine.angles_deg[rows[1:]], 2)
        if frozen.sum() + 1 >= FEWEST_STILL and not (same & moved).any():
            found.append(f"{frozen.sum()} postures of {motion!r} are the same as the one before")
        found += [
            f"{posture_of(mine, row)} all angles are those of the posture before" for row in rows[1:][same & moved]
        ]
    if not found:
        return None
    return some_of(found), "Were cells copied down, or did the recording stand still? Each row counts as a measurement"


def _has_digits(angles_deg: Float[np.ndarray, "n 6"], decimals: int) -> Bool[np.ndarray, " n"]:
    """Check which postures have an angle with more than ``decimals`` decimals.

    Such an angle differs between postures even for a person who stands still.
    """
    off = np.nan_to_num(np.abs(angles_deg - np.round(angles_deg, decimals)))
    return off.max(axis=1) > _ROUNDING


_ROUNDING = 1e-9
"""Rounding error, in degrees, of a decimal number as a float."""


def motions_alike(mine: Motions) -> Doubt | None:
    """Find two motions with the same angles to the last digit: if one is held out, the other one predicts it."""
    first: dict[bytes, str] = {}
    for motion, rows in in_order(mine):
        angles = mine.angles_deg[rows]
        if len(rows) < _FEWEST_VALUES or not (angles != angles[0]).any():
            continue
        if (earlier := first.setdefault(angles.tobytes(), motion)) != motion:
            return f"{earlier!r} and {motion!r} have the same angles", "Is one a copy of the other? Delete it"
    return None


_SAMPLE = 8
"""Number of postures of a subject with which other subjects are compared."""

_MIX = np.array([2654435761, 40503, 2246822519, 3266489917, 668265263, 374761393], np.uint64) * np.uint64(2**31 + 11)


def numbers_of_postures(mine: Motions) -> list[int]:
    """Return a number for each of some postures, which is equal for equal angles to 0.01 degree; none for few postures.

    The smallest numbers are taken: copies in any order, and without some postures, have most of them in common. Angles
    in whole degrees have one number for all postures together, because single postures of two people may be equal.
    """
    if len(mine.posture) < FEWEST_STILL:
        return []
    whole = np.round(np.nan_to_num(mine.angles_deg, nan=1000.0) * 100.0).astype(np.int64).view(np.uint64)
    numbers = np.unique((whole * _MIX).sum(axis=1, dtype=np.uint64))  # sums of large numbers overflow to a remainder
    return numbers[:_SAMPLE].tolist() if _has_digits(mine.angles_deg, 0).mean() > 0.5 else [hash(numbers.tobytes())]


def still_arm(mine: Motions) -> Doubt | None:
    """Find motions in which the scapula turns laterally by far more than the arm rises, or the arm never rises."""
    for motion, rows in in_order(mine):
        turns, rises = (_range(values[rows]) for values in (mine.angles_deg[:, SCAPULA_Z], mine.humerus_elevation_deg))
        if turns > rises + BEYOND_ARM_DEG:
            cause = f"in {motion!r} scapula_z_deg changes by {turns:.0f} and humerus_elevation_deg by {rises:.0f}"
            return cause, _OF_ARM
    turns, highest = _range(mine.angles_deg[:, SCAPULA_Z]), np.max(mine.humerus_elevation_deg, initial=0.0)
    if turns > MOST_OF_LOW_ARM_DEG and highest <= LOW_ARM_DEG:  # NaN compares false
        cause = f"scapula_z_deg changes by {turns:.0f} and humerus_elevation_deg never exceeds {highest:.0f}"
        return cause, _OF_ARM
    return None


_OF_ARM = "Is that the elevation of the arm in degrees? Empty its cells if it was not measured"


def total_of_others(mine: Motions) -> Doubt | None:
    """Find a subject or a motion with the name of a row of totals."""
    found = [name for name in (*mine.subjects, *dict.fromkeys(mine.motion.tolist())) if name.lower() in _TOTALS]
    return (f"{found[0]!r} reads like a row of totals", "Delete it: it counts as measured") if found else None


def in_order(mine: Motions) -> Iterator[tuple[str, Int[np.ndarray, " rows"]]]:
    """Yield each motion with its rows, in the order of its postures."""
    for motion in dict.fromkeys(mine.motion.tolist()):
        rows = np.flatnonzero(mine.motion == motion)
        yield motion, rows[np.argsort(mine.posture[rows], kind="stable")]


def posture_of(mine: Motions, row: int) -> str:
    """Write which posture this is, for a message."""
    return f"in posture {mine.posture[row]} of {mine.motion.item(row)!r}"


def some_of(found: Sequence[str]) -> str:
    """Join the first messages, and add the number of the others."""
    more = f"; and {len(found) - _MOST_SAID} more" if len(found) > _MOST_SAID else ""
    return "; ".join(found[:_MOST_SAID]) + more


def _range(values: Float[np.ndarray, " n"]) -> float:
    """Compute the range of the known values; NaN if fewer than three are known."""
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) >= _FEWEST_VALUES else np.nan
