"""One rigid body measured twice: which point is which, and the motion between the two.

Points are ``(3, points)``, in any right-handed frame and any unit.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from motions.landmarks.rigidity import difference_matrix, distance_matrix

Points = Float[np.ndarray, "3 points"]

SMALLEST_WIDTH = 1e-6
"""Of a cloud of points, as a share of its length: a narrower one is a line, about which it may turn freely."""


class RigidMotion(NamedTuple):
    """target = R source + t, and what it leaves."""

    R: Float[np.ndarray, "3 3"]
    t: Float[np.ndarray, "3"]
    residual: Float[np.ndarray, " points"]
    """Distance of each point to where it should be, in the points' unit (Table 5.2)."""

    def moved(self, points: Float[np.ndarray, " 3 *batch"]) -> Float[np.ndarray, " 3 *batch"]:
        """Compute R p + t."""
        return np.einsum("ij,j...->i...", self.R, points) + self.t.reshape(3, *[1] * (points.ndim - 1))


def rigid_motion(source: Points, target: Points) -> RigidMotion:
    """Find the rotation and translation with the least sum of squared residuals, never a reflection.

    With the centroids taken off, R is the rotation nearest to sum_k target_k source_k' (Spoor & Veldpaus, J. Biomech.
    13 (1980) 391-393; Kabsch, Acta Cryst. A34 (1978) 827-828). ValueError where the points lie on a line, or are fewer
    than three.
    """
    if source.shape[1] < 3 or min(width(source), width(target)) < SMALLEST_WIDTH:
        raise ValueError("a rigid motion needs three points that do not lie on a line")
    from_source, from_target = (p - p.mean(axis=1, keepdims=True) for p in (source, target))
    R = nearest_rotation(from_target @ from_source.T)
    t = target.mean(axis=1) - R @ source.mean(axis=1)
    return RigidMotion(R, t, np.linalg.norm(R @ source + t[:, None] - target, axis=0))


def nearest_rotation(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Compute the rotation nearest to a matrix, U diag(1, 1, +-1) V' of U S V'; the sign keeps it from a mirror."""
    U, _, Vt = np.linalg.svd(matrix)
    return U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt


def width(points: Points) -> float:
    """Compute the second singular value of a cloud over its first: 0 for points on a line."""
    singular = np.linalg.svd(points - points.mean(axis=1, keepdims=True), compute_uv=False)
    return float(singular[1] / singular[0]) if singular[0] > 0.0 else 0.0


def matched_points(source: Points, target: Points, tolerance: float) -> tuple[int, ...]:
    """Find for each point of the source which of the target it is, by their distances to each other (thesis 5.2.3).

    Of the assignments whose distances all agree within the tolerance it is the one with the least sum of squared
    differences; a mirror image has the same distances. ValueError where there is none.
    """
    from_source, from_target = distance_matrix(source), distance_matrix(target)
    best: tuple[float, tuple[int, ...]] = (np.inf, ())

    def extend(chosen: tuple[int, ...], cost: float) -> None:
        nonlocal best
        place = len(chosen)
        if cost >= best[0]:
            return
        if place == source.shape[1]:
            best = cost, chosen
            return
        for candidate in set(range(target.shape[1])) - set(chosen):
            apart = from_source[place, :place] - from_target[candidate, list(chosen)]
            if (np.abs(apart) <= tolerance).all():
                extend((*chosen, candidate), cost + float((apart**2).sum()))

    extend((), 0.0)
    if not best[1]:
        raise ValueError(f"no assignment of the points keeps all distances within {tolerance:g}")
    return best[1]


def compared(source: Points, target: Points) -> Float[np.ndarray, "points points"]:
    """Compute the matrix of differences of two measurements of the same points (Eq. 5.1)."""
    return difference_matrix(distance_matrix(source), distance_matrix(target))
