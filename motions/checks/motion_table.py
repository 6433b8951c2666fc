"""What a table of postures shows by itself: cells copied down, a posture out of line, positions in another frame."""

import re
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from motions.checks.distances import RANGES
from motions.checks.misfits import BEYOND_MM, SC_BEYOND_MM, SHOULDER
from motions.checks.signs import LARGE_MOTION_DEG
from motions.rotations import rotation_from_cardan
from motions.table import ANGLES, LANDMARKS, Motions

Doubt = tuple[str, str]
"""Cause and remedy."""

LARGEST_RADIANS = 1.0
"""No clavicle is elevated or turned, and no scapula tipped, by more. In degrees, an angle that stays below it while the
arm rises by 60 has less than the noise of a measurement and a tenth of its course in people."""

_SMALL = ("clavicle_z", "clavicle_x", "scapula_x")
"""Angles that a check of larger values (``motions.motion_csv.unit_and_side``) does not see in radians."""

_FEWEST_VALUES = 3

FEWEST_STILL = 5
"""Values; fewer may be alike by chance or by hand."""

OUT_OF_LINE_DEG = 45.0
"""Of a posture from the middle of its neighbours: measured motions have up to 3, simulated ones in steps of 25 degrees
of the arm up to 25."""

_MOST_SAID = 3
"""Postures in a message."""

ALONG_BONE_DEG, ALONG_BORDER_DEG = 30.0, 45.0
"""Between a bone by its landmarks and by its angles. Measured: SC to AA and the clavicle 9-13; TS to AI and the
scapula's y axis are apart by some 15 in every set, and by more with the angles of AA."""

THORAX_FRAME = "Positions are in mm in the thorax frame: origin IJ, x lateral, y up, z backward (docs/frames.md)"

_NEARLY = re.compile(rf"({'|'.join(LANDMARKS)})[ _]?[xyz]([ _]?[(\[]?(mm|cm|m|inch)[)\]]?)?", re.IGNORECASE)
"""A column of a position that is not named ``SC_x_mm``."""


def not_read(columns: Iterable[str]) -> Doubt | None:
    """Find columns that are kept as they are and were likely meant as positions."""
    found = [name for name in columns if _NEARLY.fullmatch(name.strip())]
    if not found:
        return None
    return f"column {', '.join(found)} is not read", "Positions are SC_x_mm, SC_y_mm, SC_z_mm and so on, in mm"


def zero_or_radians(mine: Motions) -> Doubt | None:
    """Find angles that are 0 throughout, or small while the arm moves."""
    known = _known_angles(mine, _FEWEST_VALUES)
    zero = [f"{angle}_deg" for angle, values in known.items() if not values.any()]
    if zero and len(zero) < len(known):
        return (
            f"{' and '.join(zero)} is 0 in every posture",
            "Empty its cells if it was not measured: 0 counts as measured",
        )
    if not _arm_moves(mine):
        return None
    small = [
        f"{angle}_deg" for angle in _SMALL if angle in known and 0.0 < np.abs(known[angle]).max() <= LARGEST_RADIANS
    ]
    if not small:
        return None
    return (
        f"{' and '.join(small)} never exceeds {LARGEST_RADIANS:g} while the arm moves: it looks like radians",
        "Give degrees",
    )


def stands_still(mine: Motions) -> Doubt | None:
    """Find angles other than 0 that are the same in every posture while the arm moves."""
    if not _arm_moves(mine):
        return None
    known = _known_angles(mine, FEWEST_STILL)
    still = [f"{angle}_deg" for angle, values in known.items() if values.any() and not np.ptp(values)]
    if not still:
        return None
    cause = f"{', '.join(still)} is the same in every posture while the arm moves"
    return cause, "Was a cell copied down? Empty its cells if it was not measured"


def _known_angles(mine: Motions, fewest: int) -> dict[str, Float[np.ndarray, " known"]]:
    """What was measured of each angle of which there are so many values."""
    known = {angle: values[np.isfinite(values)] for angle, values in zip(ANGLES, mine.angles_deg.T, strict=True)}
    return {angle: values for angle, values in known.items() if len(values) >= fewest}


def _arm_moves(mine: Motions) -> bool:
    elevation = mine.humerus_elevation_deg[np.isfinite(mine.humerus_elevation_deg)]
    return bool(len(elevation)) and bool(np.ptp(elevation) >= LARGE_MOTION_DEG)


def out_of_line(mine: Motions) -> Doubt | None:
    """Find angles far from both neighbours in the motion, which are alike: a sign, a digit, or a marker."""
    found = []
    for motion in dict.fromkeys(mine.motion.tolist()):
        rows = np.flatnonzero(mine.motion == motion)
        rows = rows[np.argsort(mine.posture[rows], kind="stable")]
        if len(rows) < 3:  # none has two neighbours
            continue
        before, here, after = (mine.angles_deg[rows[k : len(rows) - 2 + k]] for k in range(3))
        away, apart = np.abs(here - (before + after) / 2.0), np.abs(after - before) / 2.0
        found += [
            f"{ANGLES[k]}_deg is {here[n, k]:.0f} in posture {mine.posture[rows[n + 1]]} of {motion!r}, "
            f"{before[n, k]:.0f} before and {after[n, k]:.0f} after it"
            for n, k in np.argwhere((away > OUT_OF_LINE_DEG) & (apart < away / 2.0))
        ]
    if not found:
        return None
    more = f"; and {len(found) - _MOST_SAID} more" if len(found) > _MOST_SAID else ""
    return "; ".join(found[:_MOST_SAID]) + more, "Look at its sign and digits, or delete the row"


def in_another_frame(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find positions across the bones that the angles turn, on the other side of the thorax, or not about IJ."""
    said = [text for text in (_across(mine, places), _beyond(places), _not_about_origin(places)) if text]
    return (said[0], THORAX_FRAME) if said else None


def _beyond(places: dict[str, Float[np.ndarray, "3 n"]]) -> str:
    for name in SHOULDER:
        x = places[name][0][np.isfinite(places[name][0])] if name in places else np.empty(0)
        if len(x) and np.median(x) < -(SC_BEYOND_MM if name == "SC" else BEYOND_MM):
            return f"{name} is at x = {np.median(x):.0f} mm, on the other side of the thorax"
    return ""


def _not_about_origin(places: dict[str, Float[np.ndarray, "3 n"]]) -> str:
    """SC from IJ, which is the origin."""
    mm = np.linalg.norm(places["SC"], axis=0) if "SC" in places else np.empty(0)
    mm, usual = mm[np.isfinite(mm)], RANGES["SC", "IJ"]
    if not len(mm) or usual.low_mm <= np.median(mm) <= usual.high_mm:
        return ""
    return f"SC is {np.median(mm):.3g} mm from IJ, in people {usual.low_mm:.0f} to {usual.high_mm:.0f}"


def _across(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> str:
    """The first bone whose landmarks lie across it."""
    angles = np.radians(mine.angles_deg.T)
    clavicle = rotation_from_cardan(np.stack([*angles[:2], np.zeros_like(angles[0])]))  # its axis does not turn it
    scapula = rotation_from_cardan(angles[3:])
    for begin, end, bone, axis, most in (
        *(("SC", end, "clavicle", clavicle[:, 0], ALONG_BONE_DEG) for end in ("AC", "AA")),
        *(("TS", end, "scapula", scapula[:, 0], ALONG_BONE_DEG) for end in ("AC", "AA")),
        ("TS", "AI", "scapula", -scapula[:, 1], ALONG_BORDER_DEG),
    ):
        if begin in places and end in places:
            way = places[end] - places[begin]
            along = np.sum(way * axis, axis=0) / np.maximum(np.linalg.norm(way, axis=0), 1.0)
            known = along[np.isfinite(along)]
            if len(known) and (away := np.degrees(np.arccos(np.clip(np.median(known), -1.0, 1.0)))) > most:
                return f"the line from {begin} to {end} is {away:.0f} degrees away from where the angles put the {bone}"
    return ""
