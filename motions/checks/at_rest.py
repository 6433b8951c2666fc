"""Comparison of the frames with the arm lowest with people at rest, and warnings about doubtful subjects."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from motions.checks.corner import REMEDY as CALL_IT_AA
from motions.checks.corner import looks_like_corner
from motions.checks.misfits import misfit
from motions.checks.motion_table import (
    arm_out_of_line,
    columns_alike,
    copied_rows,
    motions_alike,
    nothing_of_bone,
    numbers_of_postures,
    out_of_line,
    stands_still,
    still_arm,
    total_of_others,
    zero_for_gap,
    zero_or_radians,
)
from motions.checks.positions_and_angles import (
    along_clavicle,
    apart_from_angles,
    at_origin,
    in_another_frame,
    still_places,
)
from motions.checks.signs import (
    BACKWARD,
    exchanged,
    likely_convention,
    protraction_runs_backward,
    rest_and_change,
    runs_backward,
    turned_in_one_motion,
    wrong_signs,
)
from motions.errors import InputError, warn_input
from motions.rhythm import REST_DEG
from motions.table import ANGLES, Motions

CLAVICLE_X = ANGLES.index("clavicle_x")

LOWEST_SHARE = 0.01
"""Maximum share of the frames that are below the elevation taken as the lowest, because a marker may have jumped there;
of up to 100 frames, none is."""

NEAR_DEG = 2.0
"""Height in degrees above the lowest elevation up to which frames count as rest: within it the scapula, which turns by
0.4 degrees per degree of the arm (de Groot & Brand 2001), turns by less than the scatter of a palpated frame."""

FARTHEST_DEG: Float[np.ndarray, "6"] = np.array([30.0, 25.0, np.inf, 45.0, 30.0, 30.0])
"""Maximum deviation of ANGLES at rest from REST_DEG, in degrees. Assumed, generous: eight measured shoulders with the
arm at 50 degrees or lower deviate by at most 11, 7, 25, 37, 17 and 7. The zero of the clavicle's axial rotation is a
convention."""

HIGHEST_REST_DEG = 50.0
"""Limit of the elevation with the arm lowest, in degrees: above it the angles are not compared with rest, because the
scapula alone has turned by 20 degrees there."""

Positions = dict[str, Float[np.ndarray, "3 frames"]]
FindUnlike = Callable[[Positions], list[str]]


class Rest(NamedTuple):
    """Frames with the arm lowest, and the medians over them; the elevation is NaN where it was not measured."""

    rows: Int[np.ndarray, " rows"]
    angles_deg: Float[np.ndarray, "6"]
    elevation_deg: float


def lowest_frames(angles_deg: Float[np.ndarray, "frames 6"], elevation_deg: Float[np.ndarray, " frames"]) -> Rest:
    """Find the frames with the arm lowest, among the frames in which most angles of clavicle and scapula are known.

    If the humerus was not measured, return only the first of these frames. The axial rotation of the clavicle does not
    count as known, because it may be an estimate that starts here.
    """
    known = np.isfinite(np.delete(angles_deg, CLAVICLE_X, axis=1)).sum(axis=1)
    rows = np.flatnonzero(known == known.max())
    measured = rows[np.isfinite(elevation_deg[rows])]
    if not len(measured):
        return Rest(rows[:1], angles_deg[rows[0]], np.nan)
    ordered = np.sort(elevation_deg[measured])
    lowest = ordered[int(np.ceil(LOWEST_SHARE * len(ordered))) - 1]
    rows = measured[elevation_deg[measured] <= lowest + NEAR_DEG]
    return Rest(rows, np.median(angles_deg[rows], axis=0), float(np.median(elevation_deg[rows])))


def unlike_rest(rest: Rest, landmarks_mm: Mapping[str, Float[np.ndarray, "frames 3"]]) -> list[str]:
    """List what no person has with the arm lowest: angles far from rest, AI above TS, or GH above AC."""
    found = []
    if not rest.elevation_deg > HIGHEST_REST_DEG:
        away = np.abs(rest.angles_deg - REST_DEG)
        for k in np.flatnonzero(away > FARTHEST_DEG):  # NaN compares false
            low, high = REST_DEG[k] - FARTHEST_DEG[k], REST_DEG[k] + FARTHEST_DEG[k]
            found.append(f"{ANGLES[k]}_deg is {rest.angles_deg[k]:.0f}, at rest a person's is {low:.0f} to {high:.0f}")
    for above, below in (("TS", "AI"), ("AC", "GH")):
        if above in landmarks_mm and below in landmarks_mm:
            above_mm = (landmarks_mm[above] - landmarks_mm[below])[rest.rows, 1]
            if np.median(above_mm) < 0.0:
                found.append(f"{above} lies below {below}")
    return found


def likely_swap(lab_mm: Positions, find_unlike: FindUnlike) -> tuple[str, str] | None:
    """Find the two landmarks whose exchange leaves nothing unlike rest; None unless exactly one pair does.

    ``find_unlike`` lists what is unlike rest in given landmarks, or raises InputError if they are no shoulder's at all.
    """

    def mends(a: str, b: str) -> bool:
        try:
            return not find_unlike(lab_mm | {a: lab_mm[b], b: lab_mm[a]})
        except InputError:
            return False

    found = [pair for pair in combinations(lab_mm, 2) if mends(*pair)]
    return found[0] if len(found) == 1 else None


def doubt_of_rest(
    file: str, whose: str, rest: Rest, unlike: list[str], swap: tuple[str, str] | None = None
) -> InputError:
    """Make an error about what is unlike rest, which names the two landmarks of ``swap`` as likely swapped."""
    where = (
        "in the first posture" if np.isnan(rest.elevation_deg) else f"with the arm at {rest.elevation_deg:.0f} degrees"
    )
    remedy = "Check the names of the landmarks, the axes and the signs (docs/frames.md)"
    if swap is not None:
        remedy = f"Are {swap[0]} and {swap[1]} swapped? With them exchanged nothing of this is left"
    return InputError(file, None, f"{whose}: {where} {'; '.join(unlike)}", remedy)


_OF_TABLE = (
    zero_or_radians,
    zero_for_gap,
    nothing_of_bone,
    stands_still,
    columns_alike,
    copied_rows,
    motions_alike,
    out_of_line,
    arm_out_of_line,
    still_arm,
    total_of_others,
)
"""Checks of the postures of one subject; each returns cause and remedy of a doubt, or None."""

_OF_PLACES = (at_origin, still_places, in_another_frame, along_clavicle, apart_from_angles)
"""Checks of the positions of one subject against the angles; the first doubt counts."""

MOST_NAMED = 10
"""Maximum number of subjects that are warned of by name."""

_MOST_KEPT = 200_000
"""Maximum number of postures, some 20 MB, with which later ones are compared: a run has any number of subjects."""

_OF_COPY = 0.5
"""Share of equal postures above which two subjects are copies: measured postures are never equal to 0.01 degree."""


class SubjectDoubts:
    """Warnings, once per subject, about angles that are likely not what their names say. Beyond MOST_NAMED subjects,
    only their number is given."""

    def __init__(self) -> None:
        self._seen: set[str] = set()
        self._postures: dict[int, str] = {}
        self._more = 0
        self._named = 0

    def look_at(self, motions: Motions, files: Mapping[str, str]) -> None:
        """Warn of subjects with angles or landmarks that no person has.

        Angles are unlike a person's with the arm lowest, or change otherwise (another sign, radians, another frame).
        ``files``: the file of each subject.
        """
        read = replace(motions, extra=motions.extra[[]])  # unchecked extra columns would take a fifth of the time
        for subject, mine in zip(motions.subjects, motions.rows_by_subject(), strict=True):
            if subject in self._seen:
                continue
            self._seen.add(subject)
            table = read.take(mine)
            warnings = _doubts(table, subject, files[subject])
            if same := self._copied(subject, numbers_of_postures(table)):
                remedy = "Is one a copy of the other? Two subjects with the same angles count as two people"
                warnings.append(InputError(files[subject], None, f"{subject} has the angles of {same}", remedy))
            if warnings and self._named >= MOST_NAMED:
                self._more += 1
            elif warnings:
                self._named += 1
                for one in warnings:
                    warn_input(one)

    def _copied(self, subject: str, numbers: list[int]) -> str | None:
        """Return the earlier subject with most of these postures, and keep them for later subjects."""
        counts = Counter(self._postures[number] for number in numbers if number in self._postures)
        if len(self._postures) < _MOST_KEPT:
            self._postures |= {number: subject for number in numbers if number not in self._postures}
        same, count = counts.most_common(1)[0] if counts else ("", 0)
        return same if count > _OF_COPY * len(numbers) else None

    def end(self, file: str) -> None:
        """Warn of the number of doubtful subjects that were not named."""
        if self._more:
            cause = f"{self._more} more subjects are like this"
            warn_input(InputError(file, None, cause, "Check signs and units"))
            self._more = 0


def warn_of_subjects(motions: Motions, file: str) -> None:
    """Warn of the subjects of one file, as ``SubjectDoubts`` does."""
    doubts = SubjectDoubts()
    doubts.look_at(motions, dict.fromkeys(motions.subjects, file))
    doubts.end(file)


def _doubts(mine: Motions, subject: str, file: str) -> list[InputError]:
    """List the doubts about the postures of one subject."""
    rest = lowest_frames(mine.angles_deg, mine.humerus_elevation_deg)
    low_and_change, found = rest_and_change(mine), []
    signs = wrong_signs(low_and_change)
    exchange = exchanged(low_and_change, signs)
    of_exchange = () if exchange is None else exchange.columns
    signs = [one for one in signs if one.angle not in of_exchange]
    named = tuple(f"{angle}_deg" for angle in (*(one.angle for one in signs), *of_exchange))
    if unlike := [text for text in unlike_rest(rest, mine.landmarks_mm) if not text.startswith(named)]:
        found.append(doubt_of_rest(file, subject, rest, unlike))
    positions = {name: place.T for name, place in mine.landmarks_mm.items()}
    wrong = misfit(positions)
    of_places = () if wrong or not positions else _OF_PLACES
    frame = next(filter(None, (check(mine, positions) for check in of_places)), None)
    backward = None if signs or exchange else protraction_runs_backward(mine)
    doubts = (*(check(mine) for check in _OF_TABLE), turned_in_one_motion(low_and_change), backward, frame)
    found += [InputError(file, None, f"{subject}: {doubt[0]}", doubt[1]) for doubt in doubts if doubt]
    if exchange is not None:
        remedy = f"Are the {'two' if len(exchange.columns) == 2 else 'three'} columns exchanged (docs/frames.md)?"
        found.append(InputError(file, None, f"{subject}: {exchange.said}", remedy))
    if wrong:
        found.append(InputError(file, None, f"{subject}: {wrong.cause}", wrong.remedy))
    elif corner := looks_like_corner(positions):
        found.append(InputError(file, None, f"{subject}: {corner}", CALL_IT_AA))
    if signs:
        cause = f"{subject}: {'; '.join(one.said for one in signs)}"
        remedy = BACKWARD if runs_backward(low_and_change) else likely_convention(signs)
        found.append(InputError(file, None, cause, remedy))
    return found
