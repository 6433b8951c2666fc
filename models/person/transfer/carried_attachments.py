"""Attachments of one bone carried to another by the landmarks or the surfaces of both (thesis, Chapter 5)."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from models.person.transfer.bone_surfaces import carried_points
from models.person.transfer.landmark_map import landmark_map
from models.person.transfer.mesh import Mesh
from motions.landmarks.clusters.rigid_fit import FEWEST, fit_rigid

Points = Float[np.ndarray, "3 points"]

SPREAD_POINTS = 6000
"""Number of points drawn evenly over a surface: three times the 1717 nodes of the thesis's scapula (Figure 5.3)."""


@dataclass(frozen=True)
class Bone:
    """Landmarks and surface of a bone, in a frame of its own, mm."""

    landmarks_mm: Mapping[str, Float[np.ndarray, "3"]] = field(default_factory=dict)
    mesh: Mesh | None = None


@dataclass(frozen=True)
class Carried:
    """Attachments in the frame of the target bone, and a description of the method that carried them."""

    points_mm: dict[str, Points]
    how: str


def carry_attachments(attachments: Mapping[str, Points], source: Bone, target: Bone) -> Carried:
    """Carry points of the source bone to the target bone, both of right shoulders.

    If both bones have a surface, the surfaces carry the points, held at the common landmarks; else the common landmarks
    alone do. ValueError where neither surfaces nor landmarks suffice.
    """
    common, pairs = _in_common(source, target)
    every = np.concatenate(list(attachments.values()), axis=1)
    if source.mesh is not None and target.mesh is not None:
        clouds = source.mesh.spread(SPREAD_POINTS), target.mesh.spread(SPREAD_POINTS)
        landmarks = (pairs[0], pairs[1]) if common else (None, None)
        found = carried_points(*clouds, every, *landmarks)
        held = f", held at {', '.join(common)}" if common else ""
        how = f"by the surfaces{held}"
    else:
        by = landmark_map(*pairs)
        kind = "in a plane: their scale across it is assumed" if by.in_a_plane else "affine, least squares"
        found, how = by.of(every), f"by the landmarks {', '.join(common)} ({kind}; rms {by.residual_mm:.1f} mm)"
    ends = np.cumsum([points.shape[1] for points in attachments.values()])[:-1]
    return Carried(dict(zip(attachments, np.split(found, ends, axis=1), strict=True)), how)


def lay_on_same_bone(attachments: Mapping[str, Points], source: Bone, target: Bone) -> Carried:
    """Move one measurement of a bone onto another of the same bone, without scaling (Tables 4.6, 4.7, Appendix C).

    The movement is the rigid motion of the common landmarks (least squares). Measurements without landmarks are in one
    frame already and stay unchanged. ValueError for one or two common landmarks, or for landmarks on a line.
    """
    common, (one, other) = _in_common(source, target)
    if not (source.landmarks_mm or target.landmarks_mm):
        return Carried(dict(attachments), "by nothing: both measurements are in one frame of the bone")
    fit = fit_rigid(one.T, other.T[..., None])
    if np.isnan(fit.residual_mm[0]):
        raise ValueError(f"{len(common)} landmarks of both measurements, and a rigid motion needs {FEWEST} off a line")
    moved = {name: fit.pose.carry(points) for name, points in attachments.items()}
    return Carried(moved, f"rigidly by the landmarks {', '.join(common)} (rms {fit.residual_mm[0]:.1f} mm)")


def _in_common(source: Bone, target: Bone) -> tuple[list[str], list[Points]]:
    """Return the names of the common landmarks, and their places on both bones."""
    common = [name for name in source.landmarks_mm if name in target.landmarks_mm]
    return common, [
        np.array([bone.landmarks_mm[name] for name in common]).reshape(-1, 3).T for bone in (source, target)
    ]
