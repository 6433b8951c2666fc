"""The affine map that takes the landmarks of one bone to those of another: what landmarks alone say (Chapter 5).

Of least squares where the landmarks have a depth. Three, or any that lie nearly in a plane, fix it along the plane, and
across it the scale is sqrt(det), as a bone of the same proportions grows (``models.person.attachments``).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "3 points"]

_DEPTH, _WIDTH = 0.1, 0.05
"""Third and second singular value of the landmarks over the first: below these they lie in a plane, on a line. A place
far off a plane would be carried by the noise of landmarks that are hardly off it."""


@dataclass(frozen=True)
class LandmarkMap:
    """target = M (source - origin) + goal."""

    M: Float[np.ndarray, "3 3"]
    origin: Float[np.ndarray, "3"]
    goal: Float[np.ndarray, "3"]
    residual_mm: float
    """Root mean square of what the landmarks themselves are off."""
    in_a_plane: bool

    def of(self, points: Points) -> Points:
        """Carry points."""
        return self.M @ (points - self.origin[:, None]) + self.goal[:, None]


def landmark_map(source: Points, target: Points) -> LandmarkMap:
    """Find the map of landmarks in the same order. ValueError for fewer than three, or on a line."""
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
    """The map in the plane of the two longest axes, and sqrt(area) across it; no reflection."""
    u, v = axes[:, 0], axes[:, 1]
    along = y @ np.linalg.pinv(np.stack([u, v]) @ x)  # (3, 2): where u and v go
    normal = np.cross(along[:, 0], along[:, 1])
    area = float(np.linalg.norm(normal))
    across = normal / area * np.sqrt(area)
    return np.column_stack([along, across]) @ np.column_stack([u, v, np.cross(u, v)]).T
