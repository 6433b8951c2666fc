"""Check of the landmarks of one shoulder before anything is computed: wrong positions are named and left out."""

from collections.abc import Iterable, Mapping

import numpy as np
from jaxtyping import Float, Int

from motions.checks.corner import REMEDY as CALL_IT_AA
from motions.checks.corner import looks_like_corner
from motions.checks.distances import MIDDLE, distances_mm
from motions.checks.misfits import misfit
from motions.checks.never_seen import Positions, never_seen
from motions.checks.outliers import RIGID, find_outliers, runs
from motions.checks.rigidity import check_rigidity
from motions.errors import InputError, warn_input

NEEDED = ("IJ", "PX", "C7", "T8", MIDDLE, "TS", "AI")
"""Landmarks without which there is no angle."""

MOST_POSTURES = 100
"""Maximum number of palpated postures in which outliers of millimetres are searched. A trial has more frames, among
which an outlier of less than ``motions.checks.outliers.RIGID_MM`` is lost."""

_MOST_NAMED = 8
"""Maximum number of runs of frames in a message."""


def sound_landmarks(lab_mm: Mapping[str, Float[np.ndarray, "3 frames"]], whose: str, file: str) -> Positions:
    """Return the landmarks with NaN where one was not seen or is an outlier, each named in an InputWarning.

    ``lab_mm`` are the landmarks of one shoulder, in any frame, mm; ``whose`` names the shoulder in messages. A landmark
    that is wrong in the whole trial is left out if angles can do without it. If they cannot, raise InputError, which
    names the landmarks to blame, or two swapped ones.
    """
    found = {name: np.array(place, float) for name, place in lab_mm.items()}
    ends = [name for name in ("PX", "T8") if name in found]
    middle = len(ends) == 2 and np.array_equal(found["PX"], found["T8"], equal_nan=True)
    if middle:
        found[MIDDLE] = found.pop("PX")
        del found["T8"]
    _leave_out_never_seen(found, whose, file)
    _check_swap(found, whose, file)
    _leave_outliers(found, whose, file)
    _leave_misfits(found, whose, file)
    if loose := _loose(found):
        remedy = "Is a marker on another segment, or are its rows those of another time? They are used as they are"
        warn_input(InputError(file, None, f"{whose}: {loose}", remedy))
    if corner := looks_like_corner(found):
        warn_input(InputError(file, None, f"{whose}: {corner}", CALL_IT_AA))
    if middle:
        found |= dict.fromkeys(ends, found.pop(MIDDLE))
    return {name: found[name] for name in lab_mm if name in found}


def _check_swap(found: Positions, whose: str, file: str) -> None:
    """Raise InputError if a whole trial is no person's and the exchange of two landmarks corrects it."""
    wrong = misfit(found)
    if wrong is None or wrong.swapped is None:
        return
    corner = looks_like_corner(found) if ("AC",) in wrong.blamed else None
    if corner:
        raise InputError(file, None, f"{whose}: {'; '.join(wrong.said)}; {corner}", CALL_IT_AA)
    raise InputError(file, None, f"{whose}: {wrong.cause}", wrong.remedy)


def _leave_out_never_seen(found: Positions, whose: str, file: str) -> None:
    """Set positions to NaN where they mean that a landmark was not seen."""
    for name, lost in never_seen(found).items():
        if not lost.any():
            continue
        x, y, z = found[name][:, np.flatnonzero(lost)[0]]
        was_seen = np.isfinite(found[name]).all(axis=0) & ~lost
        found[name][:, lost] = np.nan
        if not was_seen.any():
            cause = f"{whose}: landmark {name} was never seen: it is at ({x:g}, {y:g}, {z:g}) in every frame"
            _leave_whole(found, (name,), cause, "Reconstruct its marker, or use another trial", file)
        elif x or y or z:  # no warning about (0, 0, 0), with which every program marks a gap
            cause = f"{whose}: landmark {name} is at ({x:g}, {y:g}, {z:g}) in {frames_of(np.flatnonzero(lost))}"
            remedy = "It was not seen there and is left out: write gaps as empty cells, or reconstruct them"
            warn_input(InputError(file, None, cause, remedy))


def _leave_outliers(found: Positions, whose: str, file: str) -> None:
    """Set positions to NaN where a landmark is not at its place, with an InputWarning."""
    for one in find_outliers(found):
        named = " and ".join(one.landmarks) if one.swapped else " or ".join(one.landmarks)
        where = frames_of(one.frames)
        if one.swapped:
            cause = f"{whose}: the labels of {named} are exchanged in {where}"
            remedy = "These frames of both are left out: exchange the labels there"
            if 2 * len(one.frames) > found[one.landmarks[0]].shape[1]:
                remedy += ", or in all others"
        else:
            cause = f"{whose}: {named} is not in its place in {where}, by up to {one.size_mm:.0f} mm"
            remedy = f"{'It is' if len(one.landmarks) == 1 else 'They are'} left out there: look at the marker"
        warn_input(InputError(file, None, cause, remedy))
        for name in one.landmarks:
            found[name][:, one.frames] = np.nan


def slipped(found: Positions) -> dict[str, list[int]]:
    """Find the landmarks of clavicle and scapula that slipped by millimetres, and their palpated postures, from 0."""
    if next(iter(found.values())).shape[1] > MOST_POSTURES:
        return {}
    outliers: dict[str, list[int]] = {}
    for outlier in check_rigidity({name: place.T for name, place in found.items()}).outliers:
        outliers.setdefault(outlier.landmark, []).append(outlier.posture)
    return outliers


def without_outliers(found: Positions, outliers: Mapping[str, list[int]], whose: str, file: str) -> Positions:
    """Set positions to NaN where a landmark slipped, with an InputWarning."""
    left = dict(found)
    for name, frames in outliers.items():
        where = frames_of(np.array(frames))
        remedy = "It is left out there: look at the marker"
        warn_input(InputError(file, None, f"{whose}: {name} slipped in {where}", remedy))
        left[name] = left[name].copy()
        left[name][:, frames] = np.nan
    return left


def _leave_misfits(found: Positions, whose: str, file: str) -> None:
    """Leave out the landmarks that may be to blame for a misfit. Raise InputError if one of them is needed."""
    for _ in range(len(found)):
        wrong = misfit(found)
        if wrong is None:
            return
        corner = looks_like_corner(found) if ("AC",) in wrong.blamed else None
        cause, remedy = (f"{wrong.cause}; {corner}", CALL_IT_AA) if corner else (wrong.cause, wrong.remedy)
        _leave_whole(found, wrong.landmarks, f"{whose}: {cause}", remedy, file)


LOOSE_MM = 50.0
"""Maximum change of a distance between landmarks of a bone, in mm: skin slides by up to 40 (assumed), and a spine that
bends moves C7 and T8 by less."""


def _loose(found: Positions) -> str:
    """Write a message about the two landmarks of a bone that move apart most, so slowly that no frame is an outlier."""
    pairs = [pair for pair in RIGID if set(pair) <= found.keys()]
    rows = distances_mm(found, pairs) if pairs else np.empty((0, 0))
    known = [row[np.isfinite(row)] for row in rows]
    changes = [float(np.ptp(np.percentile(row, [5.0, 95.0]))) if row.size >= FEWEST_LOOSE else 0.0 for row in known]
    if max(changes, default=0.0) <= LOOSE_MM:
        return ""
    one, other = pairs[int(np.argmax(changes))]
    return f"the distance between {one} and {other} changes by {max(changes):.0f} mm, in people by what skin does alone"


FEWEST_LOOSE = 10
"""Minimum number of frames, so that no single one makes the range."""


def _leave_whole(found: Positions, names: Iterable[str], cause: str, remedy: str, file: str) -> None:
    """Leave out landmarks that are wrong throughout, with a warning. Raise InputError if one of them is needed."""
    names = tuple(names)
    acromion = {"AC", "AA"} & set(found)
    if set(names) & set(NEEDED) or acromion <= set(names):
        raise InputError(file, None, cause, remedy)
    for name in names:
        del found[name]
    warn_input(InputError(file, None, f"{cause}. {'It is' if len(names) == 1 else 'They are'} left out", remedy))


LEAST_TURNED_DEG = 60.0
"""Minimum angle in degrees, for a warning, between an axis of the thorax and the global axis of the same name. A trunk
leans by 10 to 20 and may be turned by some 30; if a mapping names a wrong axis of the file, two angles are about 90 or
180."""


def against_global(thorax_deg: Float[np.ndarray, "frames 3"]) -> tuple[str, str] | None:
    """Find a thorax that does not stand upright and face forward in the global frame (``frames.thorax_angles``)."""
    x, y, z = np.radians(thorax_deg[np.isfinite(thorax_deg).all(axis=1)].T)
    along = (np.cos(y) * np.cos(z), np.cos(x) * np.cos(z) - np.sin(x) * np.sin(y) * np.sin(z), np.cos(x) * np.cos(y))
    away = np.degrees(np.arccos(np.clip([np.median(one) for one in along], -1.0, 1.0))) if x.size else np.zeros(3)
    off = np.flatnonzero(away > LEAST_TURNED_DEG)
    if not off.size:
        return None
    said = " and ".join(f"{('right', 'up', 'back')[k]} by {away[k]:.0f}" for k in off)
    cause = f"against the global frame of the mapping the thorax is turned: its {said} degrees"
    return cause, "global names the axes of the file that point right, up and backward of the person: name others"


def frames_of(frames: Int[np.ndarray, " frames"]) -> str:
    """Write frames, given from 0, as 'frames 21-30, 45', from 1; after many runs, the rest as a number."""
    flags = np.zeros(int(frames.max()) + 1, bool)
    flags[frames] = True
    found = runs(flags)
    words = [str(a + 1) if a == b else f"{a + 1}-{b + 1}" for a, b in found]
    more = sum(b - a + 1 for a, b in found[_MOST_NAMED:])
    listed = ", ".join(words[:_MOST_NAMED]) + (f" and {more} more" if more else "")
    return f"frame{'s' if len(frames) > 1 else ''} {listed}"
