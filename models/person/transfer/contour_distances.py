"""Distances of an attachment to another attachment of the same bone (thesis 4.3.8 and 5.3), and to the bone's surface.

An attachment is a point, a line through its points in their order, or a plane with a closed contour through its points.
A distance to a contour is the distance to its nearest place, which may lie between its points.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from models.person.transfer.mesh import Mesh, to_segments

Points = Float[np.ndarray, "3 points"]

SHAPES = POINT, LINE, PLANE = ("point", "line", "plane")

_FLATTEST = 1e-6
"""Limit of the second singular value of points over the first, below which the points lie on a line."""


class Spread(NamedTuple):
    """Summary of distances in mm: smallest, mean, standard deviation (n - 1) and largest."""

    least_mm: float
    mean_mm: float
    sd_mm: float
    most_mm: float


def spread_of(distances_mm: Float[np.ndarray, " points"]) -> Spread:
    """Summarise distances; the SD of a single distance is NaN."""
    sd = float(np.std(distances_mm, ddof=1)) if len(distances_mm) > 1 else float("nan")
    return Spread(float(distances_mm.min()), float(distances_mm.mean()), sd, float(distances_mm.max()))


def to_contour_mm(points: Points, contour: Points, shape: str) -> Float[np.ndarray, " points"]:
    """Compute the distance of each point to a contour; for a ``point``, to the nearest of its measurements."""
    starts = contour
    if shape == POINT or contour.shape[1] == 1:
        ends = contour
    elif shape == LINE:
        starts, ends = contour[:, :-1], contour[:, 1:]
    else:
        ends = np.roll(contour, -1, axis=1)
    return to_segments(points, starts, ends).min(axis=1)


def between_contours(one: Points, other: Points, shape: str) -> Spread:
    """Summarise the distances of the points of either contour to the other contour (Table 5.3)."""
    both = to_contour_mm(one, other, shape), to_contour_mm(other, one, shape)
    return spread_of(np.concatenate(both))


def to_plane(points: Points, plane: Points) -> tuple[float, float]:
    """Compute MDP of Table 4.6: mean and SD of the distances of points to the least-squares plane through other points.

    ValueError where the points of the plane lie on a line.
    """
    middle = plane.mean(axis=1, keepdims=True)
    axes, sizes, _ = np.linalg.svd(plane - middle, full_matrices=False)
    if plane.shape[1] < 3 or sizes[1] < _FLATTEST * sizes[0]:
        raise ValueError("the points of a plane lie on a line")
    found = spread_of(np.abs(axes[:, 2] @ (points - middle)))
    return found.mean_mm, found.sd_mm


def between_means_mm(one: Points, other: Points) -> float:
    """Compute DMP of Table 4.6: the distance between the two mean points."""
    return float(np.linalg.norm(one.mean(axis=1) - other.mean(axis=1)))


def to_line(points: Points, line: Points) -> Spread:
    """Compute MD, MinD and MaxD of Table 4.7: distances of points to the line through other points in their order."""
    return spread_of(to_contour_mm(points, line, LINE))


def to_surface(points: Points, mesh: Mesh) -> Spread:
    """Compute the distances of Appendix C, from an attachment's points to the surface of its bone."""
    return spread_of(mesh.distances_mm(points))
