"""Attachments of one bone carried to another by their landmarks, or by their surfaces (thesis, Chapter 5)."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from models.person.transfer.bone_surfaces import carried_points
from models.person.transfer.landmark_map import landmark_map
from models.person.transfer.mesh import Mesh

Points = Float[np.ndarray, "3 points"]

SPREAD_POINTS = 6000
"""Drawn evenly over a surface: three times the nodes of the thesis's scapula, 1717 (Figure 5.3)."""


@dataclass(frozen=True)
class Bone:
    """What is known of a bone, in a frame of its own, mm."""

    landmarks_mm: Mapping[str, Float[np.ndarray, "3"]] = field(default_factory=dict)
    mesh: Mesh | None = None


@dataclass(frozen=True)
class Carried:
    """Attachments in the frame of the target, and what carried them."""

    points_mm: dict[str, Points]
    how: str


def carry_attachments(attachments: Mapping[str, Points], source: Bone, target: Bone) -> Carried:
    """Carry points of the source to the target, both right shoulders.

    By the surfaces where both bones have one, held at the landmarks that both have; else by the landmarks alone.
    ValueError where neither carries them.
    """
    common = [name for name in source.landmarks_mm if name in target.landmarks_mm]
    pairs = [np.array([bone.landmarks_mm[name] for name in common]).reshape(-1, 3).T for bone in (source, target)]
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
