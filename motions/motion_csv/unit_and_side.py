"""Checks of unit and side, which need all postures of a subject.

Each function takes all postures of one subject and returns a finding, or None.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from motions.motion_csv.cells import Side
from motions.motion_csv.columns import SIDE
from motions.motion_csv.posture_rows import Posture
from motions.table import ANGLES

LEAST_VALUES = 3
"""Minimum number of values: fewer may all be small by chance."""

LARGE_MOTION_DEG = 60.0
"""Range of elevation of the arm, in degrees, over which every scapula turns laterally by at least 15 degrees."""

LARGEST_METRES = 2.0
"""Maximum coordinate of positions in metres: no landmark is 2 m from IJ, and in mm a girdle is larger than 2 mm."""

FAR = ("AC", "TS", "AI")

SMALLEST_REACH_MM = 40.0
"""Minimum of the largest coordinate of the landmarks FAR, in mm: in adults they are 100-200 mm from IJ; in cm all their
coordinates are below 40."""

LEFT_CLAVICLE_DEG, LEFT_SCAPULA_DEG = 5.0, -5.0
"""Limits of the mean clavicle_y and scapula_y in degrees, beyond which the angles belong to the mirror image. In every
published motion a right clavicle is retracted (y < 0) and a right scapula protracted (y > 0) by 20-60 degrees."""


class Finding(NamedTuple):
    """Cause, what is wrong, and remedy, what the user can do about it."""

    cause: str
    remedy: str


def angles_in_radians(postures: Sequence[Posture]) -> Finding | None:
    """Find angles in radians: every measured angle is at most pi, although scapular protraction is 20-60 degrees.

    One posture is enough if it has clavicular protraction too, which is as large.
    """
    return radians_in(np.stack([posture.angles_deg for posture in postures]))


def radians_in(angles_deg: Float[np.ndarray, "postures 6"]) -> Finding | None:
    """Find, in the angles of one subject, that all are in radians."""
    protraction = np.isfinite(angles_deg[:, [ANGLES.index("clavicle_y"), ANGLES.index("scapula_y")]])
    enough = protraction.all(axis=1).any() or (len(angles_deg) >= LEAST_VALUES and protraction[:, 1].any())
    if not enough or np.nanmax(np.abs(angles_deg)) > np.pi:
        return None
    cause = "no angle exceeds 3.14, so the angles look like radians"
    return Finding(cause, "Give clavicle and scapula angles in degrees")


def angle_in_radians(postures: Sequence[Posture]) -> Finding | None:
    """Find a single angle in radians: in one motion all its values are at most pi.

    The angle exceeds 30 degrees in every published motion. The other angles of a person may be this small, and so may
    scapula_z if the arm hardly moves.
    """
    for motion in dict.fromkeys(posture.motion for posture in postures):
        mine = [posture for posture in postures if posture.motion == motion]
        elevations = _measured(posture.humerus_elevation_deg for posture in mine)
        moves = max(elevations) - min(elevations) if elevations else 0.0
        for angle in ("clavicle_y", "scapula_y", *(("scapula_z",) if moves > LARGE_MOTION_DEG else ())):
            values = _measured_deg(mine, angle)
            if len(values) >= LEAST_VALUES and max(map(abs, values)) <= np.pi:
                cause = f"{angle}_deg never exceeds 3.14 in motion {motion!r}, so it looks like radians"
                return Finding(cause, "Give it in degrees, or leave its cells empty")
    return None


def elevation_in_radians(postures: Sequence[Posture]) -> Finding | None:
    """Find elevations in radians: a motion has three or more different elevations, all at most pi."""
    for motion in dict.fromkeys(posture.motion for posture in postures):
        mine = [posture.humerus_elevation_deg for posture in postures if posture.motion == motion]
        if finding := radians_of(mine, motion):
            return finding
    return None


def radians_of(elevations_deg: Iterable[float], motion: str) -> Finding | None:
    """Find that the elevations of one motion are in radians."""
    elevations = _measured(set(elevations_deg))
    if len(elevations) < LEAST_VALUES or max(elevations) <= 0.0 or max(map(abs, elevations)) > np.pi:
        return None
    cause = f"humerus_elevation_deg of motion {motion!r} never exceeds 3.14, so it looks like radians"
    return Finding(cause, "Give the elevation of the humerus in degrees")


def landmarks_not_in_mm(postures: Sequence[Posture]) -> Finding | None:
    """Find landmarks in metres (all coordinates below 2) or centimetres (all coordinates of AC, TS or AI below 40)."""
    return not_in_mm(_reach_mm(postures))


def not_in_mm(reach: Mapping[str, float]) -> Finding | None:
    """Find, in the largest coordinates of one subject's landmarks (NaN: not measured), that they are not in mm."""
    if 0.0 < max(_measured(reach.values()), default=0.0) < LARGEST_METRES:
        return Finding("the landmark positions look like metres", "Give landmark positions in mm")
    for name in FAR:
        if reach.get(name, math.nan) < SMALLEST_REACH_MM:
            cause = f"the positions of landmark {name} look like centimetres"
            return Finding(cause, "Give landmark positions in mm, in the thorax frame")
    return None


def _reach_mm(postures: Sequence[Posture]) -> dict[str, float]:
    """Return the largest absolute coordinate of each landmark that was measured at least once."""
    reach: dict[str, float] = {}
    for posture in postures:
        for name, position_mm in posture.landmarks_mm.items():
            if not np.isnan(position_mm).any():
                reach[name] = max(reach.get(name, 0.0), float(np.max(np.abs(position_mm))))
    return reach


def wrong_side(postures: Sequence[Posture]) -> Finding | None:
    """Find angles of the wrong side: they should be of a right shoulder by now, but look like its mirror image."""
    clavicle_y = _mean_deg(postures, "clavicle_y")
    scapula_y = _mean_deg(postures, "scapula_y")
    if not (clavicle_y > LEFT_CLAVICLE_DEG and scapula_y < LEFT_SCAPULA_DEG):
        return None
    if _mean_deg(postures, "clavicle_z") > 0.0 and _mean_deg(postures, "scapula_z") > 0.0:  # not a mirror image: z > 0
        cause = "the clavicle is protracted and the scapula retracted, but both are elevated: no shoulder is so"
        return Finding(
            cause, "Exchange clavicle_y_deg and scapula_y_deg, or turn the sign of both round (docs/frames.md)"
        )
    side: Side = postures[0].side
    if side == "left":
        cause = "the side is left, but the angles are those of a right shoulder: they were mirrored before"
        return Finding(cause, f"Remove the column {SIDE}, or write right in it")
    cause = "the clavicle is protracted and the scapula retracted: this looks like a left shoulder"
    verb = "Fill the" if SIDE in postures[0].row.cells else "Add a"
    return Finding(cause, f"{verb} column {SIDE} with the word left")


def _mean_deg(postures: Sequence[Posture], angle: str) -> float:
    """Average an angle in degrees over the postures where it was measured; NaN if there is none."""
    measured = _measured_deg(postures, angle)
    return fmean(measured) if measured else math.nan


def _measured_deg(postures: Sequence[Posture], angle: str) -> list[float]:
    place = ANGLES.index(angle)
    return _measured(posture.angles_deg.item(place) for posture in postures)


def _measured(values: Iterable[float]) -> list[float]:
    return [value for value in values if not math.isnan(value)]


CHECKS = (angles_in_radians, angle_in_radians, elevation_in_radians, landmarks_not_in_mm, wrong_side)
