"""Orientation of the humerus in each posture: measured, or assumed from the name of the motion.

A motion file needs only the elevation. Muscles of the humerus need its whole orientation R = Ry(p) Rz(e) Ry(q) (thesis,
Appendix A): plane of elevation p (0 abduction, 90 forward flexion), elevation e, axial rotation q (internal positive).
The first available source of this list is used:

1. ``landmarks``: GH, EM and EL of the posture, thorax frame, which determine all three angles.
2. ``columns``: the columns PLANE and AXIAL of the file, degrees, beside humerus_elevation_deg.
3. ``motion``: the plane in the motion's name (PLANES_DEG); for horizontal flexion and axial rotation, the angle in the
   column MOTION_ANGLE.
4. ``assumed``: the plane of the scapula, for any other name.

If 3 and 4 do not give q, the arm is assumed not to turn about its own axis: q = -p, a swing from the hanging arm with
the elbow's axis in the frontal plane. In studies, people turn the arm outward as they raise it, by 0 to 55 degrees up
to the top (Stokdijk et al., Clin. Biomech. 18:296-302, 2003: about 55 in all planes; Acta Orthop. 80:451-455, 2009: 27
in abduction, 3 in flexion).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from motions.errors import InputError, warn_input
from motions.landmarks.frames import humerus_angles, humerus_frame
from motions.motion_csv.cells import LARGEST_ANGLE_DEG, NOT_MEASURED, to_number
from motions.motion_csv.columns import AXIAL, MOTION_ANGLE, PLANE
from motions.rotations import DEG
from motions.table import Motions

PLANES_DEG = {"scap": 30.0, "abduct": 0.0, "front": 0.0, "flex": 90.0, "sagit": 90.0}
"""Plane of elevation by part of a motion's name. In studies the plane of the scapula is 30 to 40 degrees forward of the
frontal plane."""

_ASSUMED_DEG = PLANES_DEG["scap"]

_FEWEST_VALUES = 3
"""Smallest number of values for the check of units, because fewer may all be small by chance."""

LANDMARKS, COLUMNS, MOTION, ASSUMED = "landmarks", "columns", "motion", "assumed"


class HumerusPose(NamedTuple):
    """Orientation of the humerus relative to the thorax, and its source (LANDMARKS, COLUMNS, MOTION or ASSUMED)."""

    angles: Float[np.ndarray, " 3 postures"]
    """p, e and q in rad; NaN where the elevation is NaN."""
    known_by: Shaped[np.ndarray, " postures"]


def humerus_pose(motions: Motions) -> HumerusPose:
    """Compute the orientation of the humerus in every posture, from the best source that the motions have.

    InputError where a cell of a column is not a number.
    """
    pose = named_pose(motions.motion.tolist(), motions.humerus_elevation_deg, _numbers(motions, MOTION_ANGLE))
    pose = _where(pose, _by_columns(motions), COLUMNS)
    return _where(pose, _by_landmarks(motions), LANDMARKS)


def warn_of_radians(motions: Motions) -> None:
    """Warn where PLANE looks like radians.

    PLANE then stays within pi in the motions whose names imply a plane above 0, or PLANE and AXIAL both stay within pi.
    """
    plane, axial = (_numbers(motions, name) for name in (PLANE, AXIAL))
    others = np.array([(plane_of_name(name) or 0.0) > 0.0 for name in motions.motion.tolist()])
    for subject, rows in zip(motions.subjects, motions.rows_by_subject(), strict=True):
        if _within_pi(plane[rows][others[rows]]) or (_within_pi(plane[rows]) and _within_pi(axial[rows])):
            cause = f"{subject}: {PLANE} never exceeds 3.14, so it looks like radians"
            warn_input(InputError("the motions", None, cause, f"Give {PLANE} and {AXIAL} in degrees"))


def _within_pi(values: Float[np.ndarray, " n"]) -> bool:
    known = np.abs(values[np.isfinite(values)])
    return len(known) >= _FEWEST_VALUES and 0.0 < known.max() <= np.pi


def named_pose(
    names: Sequence[str],
    elevation_deg: Float[np.ndarray, " postures"],
    motion_angle_deg: Float[np.ndarray, " postures"] | None = None,
) -> HumerusPose:
    """Compute the orientation of the humerus only from the motions' names, elevations and, if given, MOTION_ANGLE."""
    angle = np.full(len(names), np.nan) if motion_angle_deg is None else motion_angle_deg
    each = [_named(name.lower(), float(deg)) for name, deg in zip(names, angle, strict=True)]
    p, turned, known_by = (np.array(part) for part in zip(*each, strict=True))
    return HumerusPose(np.stack([p, elevation_deg, turned - p]) / DEG, known_by)


def _named(name: str, angle_deg: float) -> tuple[float, float, str]:
    """Return plane, rotation about the arm's own axis, and source."""
    if "horizontal" in name and np.isfinite(angle_deg):
        return angle_deg, 0.0, MOTION
    if "axial" in name and np.isfinite(angle_deg):
        return 0.0, angle_deg, MOTION
    plane = plane_of_name(name)
    return (_ASSUMED_DEG, 0.0, ASSUMED) if plane is None else (plane, 0.0, MOTION)


def plane_of_name(name: str) -> float | None:
    """Return the plane of elevation that the name of a motion implies; None if it implies none."""
    name = name.lower()
    return next((plane for part, plane in PLANES_DEG.items() if part in name and "horizontal" not in name), None)


def _by_columns(motions: Motions) -> Float[np.ndarray, " 3 postures"]:
    plane, axial = (_numbers(motions, name) for name in (PLANE, AXIAL))
    return np.stack([plane, motions.humerus_elevation_deg, axial]) / DEG


def _by_landmarks(motions: Motions) -> Float[np.ndarray, " 3 postures"]:
    if not all(name in motions.landmarks_mm for name in ("GH", "EM", "EL")):
        return np.full((3, len(motions.posture)), np.nan)
    return humerus_angles(humerus_frame(*(motions.landmarks_mm[name].T for name in ("GH", "EM", "EL"))))


def _where(pose: HumerusPose, angles: Float[np.ndarray, " 3 postures"], known_by: str) -> HumerusPose:
    known = np.isfinite(angles).all(axis=0)
    return HumerusPose(np.where(known, angles, pose.angles), np.where(known, known_by, pose.known_by))


def _numbers(motions: Motions, name: str) -> Float[np.ndarray, " postures"]:
    """Read a column of numbers that the fits do not use; NaN where it is empty or missing."""
    if name not in motions.extra:
        return np.full(len(motions.posture), np.nan)
    numbers = np.empty(len(motions.posture))
    for k, cell in enumerate(motions.extra[name].tolist()):
        text = str(cell).strip()
        try:
            numbers[k] = np.nan if text.lower() in NOT_MEASURED else to_number(text)
        except ValueError:
            numbers[k] = np.inf
        if abs(numbers[k]) > LARGEST_ANGLE_DEG:  # False for NaN
            where = f"{motions.subject[k]}, {motions.motion[k]}, posture {motions.posture[k]}"
            remedy = "Give degrees between -180 and 180, or leave the cell empty"
            raise InputError(where, None, f"{name} is {cell!r}", remedy)
    return numbers
