"""The affine map, from landmarks alone, that takes the landmarks of one bone to the landmarks of another (Chapter 5).

Landmarks that span three dimensions determine the map by least squares. Three landmarks, or landmarks that lie nearly
in a plane, determine the map only along this plane. The scale across the plane is then sqrt(det), as if the bone grew
with the same proportions (``models.person.attachments``).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "3 points"]

_DEPTH, _WIDTH = 0.1, 0.05
"""Limits of the third and the second singular value of the landmarks over the first, below which the landmarks lie in a
plane or on a line. If landmarks are hardly off a plane, only their noise would decide where a place far off it goes."""


@dataclass(frozen=True)
class LandmarkMap:
    """Affine map: target = M (source - origin) + goal."""

    M: Float[np.ndarray, "3 3"]
    origin: Float[np.ndarray, "3"]
    goal: Float[np.ndarray, "3"]
    residual_mm: float
    """Root mean square distance between the mapped and the target landmarks."""
    in_a_plane: bool

    def of(self, points: Points) -> Points:
        """Map points of the source bone to the target bone."""
        return self.M @ (points - self.origin[:, None]) + self.goal[:, None]


def landmark_map(source: Points, target: Points) -> LandmarkMap:
    """Compute the map between landmarks in the same order. ValueError for fewer than three, or if all are on a line."""
    if source.shape[1] < 3:
        raise ValueError(f"{source.shape[1]} landmarks on both bones, and a map needs three")
    origin, goal = source.mean(axis=1), target.mean(axis=1)
    x, y = source - origin[:, None], target - goal[:, None]
    for one in (x, y):
        sizes = np.linalg.svd(one, compute_uv=False)
        if sizes[1] < _WIDTH * sizes[0]:
            raise ValueError("the landmarks lie on a line")
    axes, sizes, _ = np.linalg.svd(x, full_matrices=False)
    flat = bool(len(sizes) < 3 or sizes[2] < _DEPTH * sizes[0])
    M = _of_plane(axes, x, y) if flat else y @ np.linalg.pinv(x)
    residual = float(np.sqrt(((M @ x - y) ** 2).sum(axis=0).mean()))
    return LandmarkMap(M, origin, goal, residual, flat)


def _of_plane(axes: np.ndarray, x: Points, y: Points) -> Float[np.ndarray, "3 3"]:
    """Compute the map M in the plane of the two longest axes, with scale sqrt(area) across it and no reflection."""
    u, v = axes[:, 0], axes[:, 1]
    along = y @ np.linalg.pinv(np.stack([u, v]) @ x)  # (3, 2): images of u and v
    normal = np.cross(along[:, 0], along[:, 1])
    area = float(np.linalg.norm(normal))
    across = normal / area * np.sqrt(area)
    return np.column_stack([along, across]) @ np.column_stack([u, v, np.cross(u, v)]).T
