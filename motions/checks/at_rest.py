"""The frames with the arm lowest: their angles, and whether those could be a person's at rest."""

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
    angles_of,
    copied_rows,
    motions_alike,
    not_read,
    nothing_of_bone,
    out_of_line,
    stands_still,
    still_arm,
    total_of_others,
    zero_or_radians,
)
from motions.checks.positions_and_angles import apart_from_angles, in_another_frame, still_places
from motions.checks.signs import (
    BACKWARD,
    courses_of,
    exchanged,
    likely_convention,
    protraction_runs_backward,
    runs_backward,
    turned_in_one_motion,
    wrong_signs,
)
from motions.errors import InputError, warn_input
from motions.rhythm import REST_DEG
from motions.table import ANGLES, Motions

CLAVICLE_X = ANGLES.index("clavicle_x")

LOWEST_SHARE = 0.01
"""Of the frames, those that may be lower than the lowest elevation: a marker that jumps. None of up to 100."""

NEAR_DEG = 2.0
"""Frames this much above the lowest elevation are at rest too: the scapula turns by 0.4 degrees a degree of the arm (de
Groot & Brand 2001), over it by less than a palpated frame scatters."""

FARTHEST_DEG: Float[np.ndarray, "6"] = np.array([30.0, 25.0, np.inf, 45.0, 30.0, 30.0])
"""How far ANGLES at rest may be from REST_DEG. Assumed, generous: eight measured shoulders with the arm at 50 degrees
or lower are at most 11, 7, 25, 37, 17 and 7 away. The zero of the axial rotation of the clavicle is a convention."""

HIGHEST_REST_DEG = 50.0
"""With the arm never lower than this, the angles at rest say nothing: the scapula alone turns by 20 degrees to here."""

Positions = dict[str, Float[np.ndarray, "3 frames"]]
FindUnlike = Callable[[Positions], list[str]]


class Rest(NamedTuple):
    """The frames with the arm lowest and the median over them; the elevation is NaN where it was not measured."""

    rows: Int[np.ndarray, " rows"]
    angles_deg: Float[np.ndarray, "6"]
    elevation_deg: float


def lowest_frames(angles_deg: Float[np.ndarray, "frames 6"], elevation_deg: Float[np.ndarray, " frames"]) -> Rest:
    """Find the frames with the arm lowest, among those in which most of clavicle and scapula is known.

    The first of them stands alone where the humerus was not measured. The axial rotation of the clavicle is not asked
    for, as it may be an estimate that starts here.
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
    """Say what of the angles with the arm lowest no person has at rest; and if AI is above TS or GH above AC."""
    found = []
    if not rest.elevation_deg > HIGHEST_REST_DEG:
        away = np.abs(rest.angles_deg - REST_DEG)
        for k in np.flatnonzero(away > FARTHEST_DEG):  # NaN was not measured
            low, high = REST_DEG[k] - FARTHEST_DEG[k], REST_DEG[k] + FARTHEST_DEG[k]
            found.append(f"{ANGLES[k]}_deg is {rest.angles_deg[k]:.0f}, at rest a person's is {low:.0f} to {high:.0f}")
    for above, below in (("TS", "AI"), ("AC", "GH")):
        if above in landmarks_mm and below in landmarks_mm:
            above_mm = (landmarks_mm[above] - landmarks_mm[below])[rest.rows, 1]
            if np.median(above_mm) < 0.0:
                found.append(f"{above} lies below {below}")
    return found


def likely_swap(lab_mm: Positions, find_unlike: FindUnlike) -> tuple[str, str] | None:
    """Find the two landmarks that leave nothing unlike rest when they are exchanged; None if not exactly one pair does.

    find_unlike: what is unlike rest in these landmarks; InputError if they are not those of a shoulder at all.
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
    """Say what is unlike rest, and name two landmarks that are likely swapped."""
    where = (
        "in the first posture" if np.isnan(rest.elevation_deg) else f"with the arm at {rest.elevation_deg:.0f} degrees"
    )
    remedy = "Check the names of the landmarks, the axes and the signs (docs/frames.md)"
    if swap is not None:
        remedy = f"Are {swap[0]} and {swap[1]} swapped? With them exchanged nothing of this is left"
    return InputError(file, None, f"{whose}: {where} {'; '.join(unlike)}", remedy)


_OF_TABLE = (
    zero_or_radians,
    nothing_of_bone,
    stands_still,
    copied_rows,
    motions_alike,
    out_of_line,
    still_arm,
    total_of_others,
)
"""What is doubtful of the postures of one subject, each a cause and a remedy."""

MOST_NAMED = 10
"""Subjects that are warned of by name."""

_MOST_KEPT = 100_000
"""Subjects that later ones are compared with, some 20 MB: a run has any number."""


class SubjectDoubts:
    """Warns of subjects whose angles are likely not what their names say, each once; beyond MOST_NAMED by number."""

    def __init__(self) -> None:
        self._seen: set[str] = set()
        self._columns: set[str] = set()
        self._angles: dict[int | None, str] = {}
        self._more = 0
        self._named = 0

    def look_at(self, motions: Motions, files: Mapping[str, str]) -> None:
        """Warn of subjects with angles that no person has with the arm lowest, with a sign that nobody's course has
        (another sign, radians, another frame), or with landmarks that are no person's. files: where each stands."""
        new = [name for name in motions.extra.columns if name not in self._columns]
        self._columns.update(new)
        if doubt := not_read(new):
            warn_input(InputError(next(iter(files.values())), None, *doubt))
        read = replace(motions, extra=motions.extra[[]])  # what is not read takes a fifth of the time
        for subject, mine in zip(motions.subjects, motions.rows_by_subject(), strict=True):
            if subject in self._seen:
                continue
            self._seen.add(subject)
            table = read.take(mine)
            warnings = _doubts(table, subject, files[subject])
            key = angles_of(table)
            same = self._angles.get(key, subject)
            if key is not None and len(self._angles) < _MOST_KEPT:
                self._angles.setdefault(key, subject)
            if same != subject:
                remedy = "Is one a copy of the other? Two subjects with the same angles count as two people"
                warnings.append(InputError(files[subject], None, f"{subject} has all angles of {same}", remedy))
            if warnings and self._named >= MOST_NAMED:
                self._more += 1
            elif warnings:
                self._named += 1
                for one in warnings:
                    warn_input(one)

    def end(self, file: str) -> None:
        """Warn of the number of those that were not named."""
        if self._more:
            cause = f"{self._more} more subjects are like this"
            warn_input(InputError(file, None, cause, "Check signs and units"))
            self._more = 0


def warn_of_subjects(motions: Motions, file: str) -> None:
    """Warn of subjects as ``SubjectDoubts`` does, of one file."""
    doubts = SubjectDoubts()
    doubts.look_at(motions, dict.fromkeys(motions.subjects, file))
    doubts.end(file)


def _doubts(mine: Motions, subject: str, file: str) -> list[InputError]:
    """What is doubtful in the postures of one subject."""
    rest = lowest_frames(mine.angles_deg, mine.humerus_elevation_deg)
    courses, found = courses_of(mine), []
    signs = wrong_signs(courses)
    exchange = exchanged(courses, signs)
    of_exchange = () if exchange is None else exchange.columns
    signs = [one for one in signs if one.angle not in of_exchange]
    named = tuple(f"{angle}_deg" for angle in (*(one.angle for one in signs), *of_exchange))
    if unlike := [text for text in unlike_rest(rest, mine.landmarks_mm) if not text.startswith(named)]:
        found.append(doubt_of_rest(file, subject, rest, unlike))
    positions = {name: place.T for name, place in mine.landmarks_mm.items()}
    wrong = misfit(positions)
    of_places = () if wrong or not positions else (in_another_frame, still_places, apart_from_angles)
    frame = next(filter(None, (check(mine, positions) for check in of_places)), None)
    backward = None if signs or exchange else protraction_runs_backward(mine)
    doubts = (*(check(mine) for check in _OF_TABLE), turned_in_one_motion(courses), backward, frame)
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
        remedy = BACKWARD if runs_backward(courses) else likely_convention(signs)
        found.append(InputError(file, None, cause, remedy))
    return found
