"""Points of a generic bone carried to a person's bone by the shapes of their surfaces (thesis 5.2.4).

1. **Similarity** from the moments of the two clouds of surface points: the centroids give the translation, the roots of
   the total variances the scale, the principal axes the rotation. An axis has no sign, so there are four right-handed
   rotations; the one with the smallest mean distance between the surfaces is taken.
2. **Stretch** along the principal axes to the person's variances, then by an affine map that lays the surface on the
   person's surface: iterations move each point towards the tangent plane at the nearest point.
3. **Deformation** by a biharmonic spline (the thin plate of three dimensions, kernel r, with a linear part) that moves
   every control point to the nearest place of the person's surface; repeated with less smoothing, so that the surfaces
   coincide at the end. Common landmarks of the bones hold the spline at their places.

The thesis deforms by a force field between the surfaces, which it does not publish. This method is another one of the
same principle: only nearness defines correspondence, so points may slide along a featureless surface.

Points are ``(3, n)``, mm, right-handed; both clouds should cover their surface evenly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "3 points"]

_SMOOTHINGS = (30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
"""Regularisation of the spline (mm), from stiff to soft: the surface as a whole is fitted before its details."""

_MOST_CONTROL = 400
"""Maximum number of evenly chosen control points of the spline. They resolve a bone's shape to 1 cm; their system of
equations is dense."""

_PLANE_SD, _STRETCH_SD = 0.005, 0.1
"""Prior SDs of the affine map, in units of the bone's size. Points are off the tangent planes by half a per cent after
the map, because bones differ in their features too; the map stretches, shears and shifts by a tenth. Without the second
prior a surface that is nearly an ellipsoid slides along itself."""

_MOST_STEPS, _AT_REST_MM = 60, 1e-4
"""Maximum number of iterations of the affine map, and its tolerance: the movement of every point (mm) in one iteration.
Synthetic bones take 10 to 40 iterations."""

_LEAST_GAP = 0.02
"""Smallest difference of two principal variances, as a share of the largest, at which their axes are defined."""


@dataclass(frozen=True)
class Similarity:
    """Similarity transformation: target = scale R source + t."""

    scale: float
    R: Float[np.ndarray, "3 3"]
    t: Float[np.ndarray, "3"]

    def of(self, points: Points) -> Points:
        """Map points."""
        return self.scale * self.R @ points + self.t[:, None]


def similarity_by_inertia(source: Points, target: Points) -> Similarity:
    """Compute translation, rotation and scale from the inertia of the two surfaces (thesis 5.2.4).

    ValueError where a surface is so round that its principal axes are not defined.
    """
    from scipy.spatial import KDTree  # takes 0.2 s, and only some commands need it

    centre = source.mean(axis=1), target.mean(axis=1)
    (s_values, s_axes), (t_values, t_axes) = (_principal(p) for p in (source, target))
    scale = float(np.sqrt(t_values.sum() / s_values.sum()))
    tree = KDTree(target.T)
    best: tuple[float, Similarity | None] = (np.inf, None)
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        R = _right_handed(t_axes * np.array([*signs, 1.0])) @ _right_handed(s_axes).T
        found = Similarity(scale, R, centre[1] - scale * R @ centre[0])
        apart = float(tree.query(found.of(source).T)[0].mean())
        if apart < best[0]:
            best = apart, found
    assert best[1] is not None
    return best[1]


def carried_points(
    source: Points,
    target: Points,
    points: Points,
    source_landmarks: Points | None = None,
    target_landmarks: Points | None = None,
) -> Points:
    """Carry points (attachments) of a generic bone to a person's bone, by surfaces and, where given, landmarks."""
    surface = Surface.through(target)
    by_inertia = _stretched_by_inertia(source, target)
    affine = _laid_on(by_inertia(source), surface)

    def moved(some: Points) -> Points:
        return affine(by_inertia(some))

    start, found = moved(source[:, _evenly(source.shape[1], _MOST_CONTROL)]), moved(points)
    none = np.zeros((3, 0))
    held = none if source_landmarks is None else moved(source_landmarks)
    goal = none if target_landmarks is None else target_landmarks
    current = start
    start_and_held = np.concatenate([start, held], axis=1)
    for smoothing in _SMOOTHINGS:
        current = _spline(start_and_held, np.concatenate([surface.onto(current), goal], axis=1), start, smoothing)
    return _spline(start_and_held, np.concatenate([surface.onto(current), goal], axis=1), found, _SMOOTHINGS[-1])


def _stretched_by_inertia(source: Points, target: Points) -> Callable[[Points], Points]:
    """Return the similarity with a separate scale along each principal axis of the target: the first part of step 2."""
    similarity = similarity_by_inertia(source, target)
    values, axes = _principal(target)
    spread = np.var(axes.T @ similarity.of(source), axis=1, ddof=1)
    stretch = axes @ np.diag(np.sqrt(values / spread)) @ axes.T
    centre = target.mean(axis=1)[:, None]
    return lambda points: centre + stretch @ (similarity.of(points) - centre)


def _laid_on(points: Points, surface: "Surface") -> Callable[[Points], Points]:
    """Find the affine map x + M (x, 1) of least sum (n.(x + M (x, 1) - p))^2 / plane_sd^2 + N |M|^2 / stretch_sd^2.

    p and n are place and normal of the surface point nearest to the mapped x, N is the number of points. Lengths are in
    units of the bone's size.
    """
    centre, size = points.mean(axis=1, keepdims=True), float(np.sqrt(points.var(axis=1).sum()))

    def extended(some: Points) -> Float[np.ndarray, "4 points"]:
        return np.concatenate([(some - centre) / size, np.ones((1, some.shape[1]))])

    x, moved, M = extended(points), points, np.zeros((3, 4))
    held = points.shape[1] * (_PLANE_SD / _STRETCH_SD) ** 2 * np.eye(12)
    for _ in range(_MOST_STEPS):
        place, normal = surface.nearest(moved)
        rows = (normal[:, None] * x).reshape(12, -1)
        off = ((place - points) * normal).sum(axis=0) / size
        M = np.linalg.solve(rows @ rows.T + held, rows @ off).reshape(3, 4)
        before, moved = moved, points + size * M @ x
        if np.abs(moved - before).max() < _AT_REST_MM:
            break
    return lambda some: some + size * M @ extended(some)


def _principal(points: Points) -> tuple[np.ndarray, np.ndarray]:
    values, axes = np.linalg.eigh(np.cov(points))
    values, axes = values[::-1], axes[:, ::-1]
    if (np.diff(-values) < _LEAST_GAP * values[0]).any():
        raise ValueError("two principal axes of the surface have the same inertia: its rotation is not defined")
    return values, axes


def _right_handed(axes: np.ndarray) -> np.ndarray:
    return np.column_stack([axes[:, 0], axes[:, 1], np.cross(axes[:, 0], axes[:, 1])])


def _spline(source: Points, target: Points, at: Points, smoothing: float) -> Points:
    """Move the points ``at`` by the smoothed displacements from ``source`` to ``target``."""
    from scipy.interpolate import RBFInterpolator  # takes 0.2 s, and only some commands need it

    spline = RBFInterpolator(source.T, (target - source).T, smoothing=smoothing, kernel="linear", degree=1)
    return at + spline(at.T).T


_NEIGHBOURS = 10
"""Number of neighbouring surface points through which a tangent plane is fitted."""


@dataclass(frozen=True)
class Surface:
    """Points of a surface, with the normals of the tangent planes there."""

    points: Points
    normals: Points
    tree: Any
    """KDTree of the points (scipy)."""

    @staticmethod
    def through(points: Points) -> "Surface":
        """Build a surface from its points: a tangent plane at each point, fitted to the neighbours."""
        from scipy.spatial import KDTree

        tree = KDTree(points.T)
        patches = points.T[tree.query(points.T, k=min(_NEIGHBOURS, points.shape[1]))[1]]
        centred = patches - patches.mean(axis=1, keepdims=True)
        return Surface(points, np.linalg.svd(centred, full_matrices=False)[2][:, 2].T, tree)

    def nearest(self, points: Points) -> tuple[Points, Points]:
        """Find the nearest surface point to each point, and the normal there."""
        near = self.tree.query(points.T)[1]
        return self.points[:, near], self.normals[:, near]

    def onto(self, points: Points) -> Points:
        """Project each point v onto the tangent plane at the nearest surface point p: v + n n.(p - v)."""
        place, n = self.nearest(points)
        return points + n * ((place - points) * n).sum(axis=0)


def _evenly(count: int, most: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
