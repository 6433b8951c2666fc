"""Tables of `girdle check`: distances, rigid motions and the thorax of measured landmarks, of one file or two."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from jaxtyping import Float

from motions.checks.distances import RANGES
from motions.checks.rigidity import CLAVICLE, SCAPULA
from motions.formats.landmark_sets import LandmarkSet
from motions.landmarks.frames import thorax_angles, thorax_frame
from motions.landmarks.mapping import THORAX
from motions.landmarks.sampled_postures import THORAX_COLUMNS
from motions.landmarks.two_measurements import RigidMotion, compare_measurements, rigid_motion
from motions.rotations import DEG, compose

BONES = {"thorax": THORAX, "clavicle": CLAVICLE, "scapula": SCAPULA, "humerus": ("GH", "EM", "EL")}
"""Landmarks of each bone; AC belongs to two bones."""

ALL = "all"
"""Name for all points of a file where they count as one bone."""

DISTANCES = ("subject", "bone", "one", "other", "postures", "mean_mm", "sd_mm", "least_mm", "most_mm")
RANGE = ("person_low_mm", "person_high_mm")
"""Range of adults (``motions.checks.distances``); empty where nobody has published it."""

MOTION = ("angle_deg", "axis_x", "axis_y", "axis_z", "shift_x_mm", "shift_y_mm", "shift_z_mm")
RESIDUAL = ("residual_mm", "residual_sd_mm", "residual_most_mm", "farthest")
"""Mean, SD (n - 1) and maximum of the residual distances of the points after the motion (Table 5.2), and the point with
the largest residual."""

DIFFERENCES = ("bone", "one", "other", "first_mm", "second_mm", "difference_mm", "consistent")
"""Columns of a comparison. difference: first minus second (Eq. 4.1, 5.1). consistent: 1 where both points belong to the
largest set that agrees."""


def bone_of(one: str, other: str) -> str:
    """Return the bone that holds both points; empty where none does."""
    return next((bone for bone, names in BONES.items() if one in names and other in names), "")


def distances_table(sets: Sequence[LandmarkSet]) -> pd.DataFrame:
    """Tabulate the distance of every pair of points over the postures: DISTANCES and RANGE."""
    pairs = [(own, *pair) for own in sets for pair in combinations(own.points_mm, 2)]
    rows = [row for pair in pairs for row in _distance(*pair)]
    return pd.DataFrame(rows, columns=[*DISTANCES, *RANGE])


def _distance(own: LandmarkSet, one: str, other: str) -> Iterator[tuple[object, ...]]:
    mm = np.linalg.norm(own.points_mm[one] - own.points_mm[other], axis=0)
    mm = mm[np.isfinite(mm)]
    if len(mm):
        known = RANGES.get((one, other)) or RANGES.get((other, one))
        low, high = (np.nan, np.nan) if known is None else (known.low_mm, known.high_mm)
        sd = float(np.std(mm, ddof=1)) if len(mm) > 1 else np.nan
        numbers = float(mm.mean()), sd, float(mm.min()), float(mm.max())
        yield own.subject, bone_of(one, other), one, other, len(mm), *numbers, low, high


def motions_table(sets: Sequence[LandmarkSet]) -> pd.DataFrame:
    """Tabulate the rigid motion of each bone from the first posture that has all its points: subject, bone, from,
    posture, ..."""
    rows = []
    for own in sets:
        for bone, names in _bones_there(own.points_mm).items():
            seen = np.isfinite(np.stack([own.points_mm[name] for name in names])).all(axis=(0, 1))
            first, *others = np.flatnonzero(seen).tolist() or [-1]
            for k in others:
                found = _motion({name: own.points_mm[name][:, first] for name in names}, own, k)
                if found is not None:
                    rows.append((own.subject, bone, own.postures[first], own.postures[k], *_cells(found, names)))
    return pd.DataFrame(rows, columns=["subject", "bone", "from", "posture", *MOTION, *RESIDUAL])


def _motion(first: Mapping[str, np.ndarray], own: LandmarkSet, posture: int) -> RigidMotion | None:
    now = [own.points_mm[name][:, posture] for name in first]
    try:
        return rigid_motion(np.stack(list(first.values()), axis=1), np.stack(now, axis=1))
    except ValueError:  # the points lie on a line
        return None


def _bones_there(points: Mapping[str, object]) -> dict[str, list[str]]:
    """Return the bones with at least three points; without any landmark among the points, return all points as one
    bone."""
    if not any(name in points for names in BONES.values() for name in names):
        return {ALL: list(points)}
    there = {bone: [name for name in names if name in points] for bone, names in BONES.items()}
    return {bone: names for bone, names in there.items() if len(names) > 2}


def _cells(motion: RigidMotion, names: Sequence[str]) -> tuple[object, ...]:
    off = motion.residual_mm
    numbers = float(off.mean()), float(off.std(ddof=1)), float(off.max()), names[int(off.argmax())]
    return motion.angle_deg, *motion.axis.tolist(), *motion.shift_mm.tolist(), *numbers


def two_tables(first: LandmarkSet, second: LandmarkSet) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tabulate two measurements of one body: DIFFERENCES of every bone's points, and the rigid motion between them.

    ValueError where a file has several postures, or where the two files share no two points of a bone.
    """
    places = first.mean_mm(), second.mean_mm()
    common = {name: None for name in places[0] if name in places[1]}
    bones = {bone: [n for n in names if n in common] for bone, names in BONES.items()}
    bones = {bone: names for bone, names in bones.items() if len(names) > 1} or {ALL: list(common)}
    if all(len(names) < 2 for names in bones.values()):
        raise ValueError("the two share no two points of one bone")
    distances, moved = [], []
    for bone, names in bones.items():
        pair = [np.stack([one[name] for name in names], axis=1) for one in places]
        found = compare_measurements(names, *pair)
        for i, j in combinations(range(len(names)), 2):
            kept = names[i] in found.consistent and names[j] in found.consistent
            one_mm, apart = float(found.first_mm[i, j]), float(found.differences_mm[i, j])
            distances.append((bone, names[i], names[j], one_mm, one_mm - apart, apart, int(kept)))
        if found.motion is not None:
            moved.append((bone, " ".join(found.moved_by), *_cells(found.motion, found.moved_by)))
    columns = ["bone", "points", *MOTION, *RESIDUAL]
    return pd.DataFrame(distances, columns=list(DIFFERENCES)), pd.DataFrame(moved, columns=columns)


def thorax_of_landmarks(sets: Sequence[LandmarkSet], R_lab_global: Float[np.ndarray, "3 3"]) -> pd.DataFrame:
    """Tabulate the orientation of the thorax in the global frame: subject, posture and THORAX_COLUMNS (Appendix A)."""
    rows = []
    for own in sets:
        if set(THORAX) <= set(own.points_mm):
            R = thorax_frame(*(own.points_mm[name] for name in THORAX))
            angles = thorax_angles(compose(R_lab_global.T[..., None], R)) * float(DEG)
            rows += [(own.subject, name, *one) for name, one in zip(own.postures, angles.T.tolist(), strict=True)]
    return pd.DataFrame(rows, columns=["subject", "posture", *THORAX_COLUMNS])
