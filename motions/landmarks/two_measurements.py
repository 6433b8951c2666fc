"""Comparison of two measurements of one bone, or of the frames of a trial: distance matrices and rigid motions.

Source: Chapter 4 (MRI and dissection, Table 4.1) and Chapter 5 (CT and palpation, Tables 5.1 and 5.2) of the thesis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.checks.distance_matrices import difference_matrix, distance_matrix, largest_consistent
from motions.landmarks.clusters.rigid_fit import FEWEST, fit_rigid
from motions.rotations import DEG, vector_from_rotation

Points = Float[np.ndarray, "3 points"]


@dataclass(frozen=True)
class RigidMotion:
    """Least-squares rotation and translation from points to other points (Spoor and Veldpaus 1980)."""

    angle_deg: float
    """Angle of rotation about ``axis``."""
    axis: Float[np.ndarray, "3"]
    """Unit vector of the rotation axis; NaN without a rotation."""
    shift_mm: Float[np.ndarray, "3"]
    """Translation of the mean point."""
    residual_mm: Float[np.ndarray, " points"]
    """Distance of each point to its counterpart after the motion; Table 5.2 has their mean and SD."""


def rigid_motion(one: Points, other: Points) -> RigidMotion:
    """Compute the rigid motion that takes the points of one measurement to the points of the other.

    ValueError for fewer than three points, or for points on a line.
    """
    if one.shape[1] < FEWEST:
        raise ValueError(f"{one.shape[1]} points, and a rigid motion needs {FEWEST}")
    fit = fit_rigid(one.T, other.T[..., None])
    if np.isnan(fit.residual_mm[0]):
        raise ValueError("the points lie on a line")
    vector = np.asarray(vector_from_rotation(fit.pose.R[..., 0]))
    angle = float(np.linalg.norm(vector))
    moved = fit.pose.R[..., 0] @ one + fit.pose.t
    axis = vector / angle if angle > 0.0 else np.full(3, np.nan)
    shift = other.mean(axis=1) - one.mean(axis=1)
    return RigidMotion(angle * float(DEG), axis, shift, np.linalg.norm(moved - other, axis=0))


@dataclass(frozen=True)
class Compared:
    """Comparison of two measurements of the points of one body."""

    names: tuple[str, ...]
    first_mm: Float[np.ndarray, "points points"]
    """Distances between the points in the first measurement."""
    differences_mm: Float[np.ndarray, "points points"]
    """Difference E = DM_first - DM_second of the distance matrices (Eq. 4.1, 5.1)."""
    consistent: tuple[str, ...]
    """Largest set of points on which both measurements agree (Table 5.1)."""
    motion: RigidMotion | None
    """Motion from the first to the second measurement; None for fewer than three points, or for points on a line."""
    moved_by: tuple[str, ...]
    """Points that determine this motion: the consistent points, or all if fewer than three are consistent."""


def compare_measurements(names: Sequence[str], first: Points, second: Points) -> Compared:
    """Compare two measurements of the same points. ValueError for too many points to search all their subsets."""
    one, other = distance_matrix(first), distance_matrix(second)
    differences = difference_matrix(one, other)
    kept = list(largest_consistent(differences))
    by = kept if len(kept) >= FEWEST else list(range(len(names)))
    try:
        motion = rigid_motion(first[:, by], second[:, by])
    except ValueError:
        motion = None
    consistent, moved_by = (tuple(names[k] for k in part) for part in (kept, by))
    return Compared(tuple(names), one, differences, consistent, motion, moved_by)
