"""Points of a generic bone carried to a person's bone by the shapes of their surfaces (thesis 5.2.4).

1. **Similarity** from the moments of the two clouds of surface points: the centroids give the translation, the roots of
   the total variances the scale, the principal axes the rotation. An axis has no sense: of the four right-handed
   choices the one is taken that leaves the surfaces nearest to each other.
2. **Deformation**: the surface is stretched along its principal axes to the person's variances. Then every control
   point goes to the nearest place of the person's, as a biharmonic spline (the thin plate of three dimensions, kernel
   r, with a linear part) has it; again with less smoothing, so that the surfaces end on each other. Named landmarks of
   both bones hold it where they are.

The thesis deforms by a force field between the surfaces, which it does not publish; this is not that method. Its
principle is the same: no correspondence but nearness, so that points may slide along a featureless surface.

Points are ``(3, n)``, mm, right-handed; both clouds should cover their surface evenly.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "3 points"]

_SMOOTHINGS = (30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
"""mm of the spline's regularisation, from stiff to soft: the surface settles as a whole before its details do."""

_MOST_CONTROL = 400
"""Control points of the spline, evenly chosen: a bone's shape at 1 cm, and a dense system of equations."""

_LEAST_GAP = 0.02
"""Principal variances nearer to each other than this share give no axis of their own."""


@dataclass(frozen=True)
class Similarity:
    """target = scale R source + t."""

    scale: float
    R: Float[np.ndarray, "3 3"]
    t: Float[np.ndarray, "3"]

    def of(self, points: Points) -> Points:
        """Move points."""
        return self.scale * self.R @ points + self.t[:, None]


def similarity_by_inertia(source: Points, target: Points) -> Similarity:
    """Find translation, rotation and scale from the inertia of the two surfaces (thesis 5.2.4).

    ValueError where a surface is so round that its principal axes are not defined.
    """
    centre = source.mean(axis=1), target.mean(axis=1)
    (s_values, s_axes), (t_values, t_axes) = (_principal(p) for p in (source, target))
    scale = float(np.sqrt(t_values.sum() / s_values.sum()))
    best: tuple[float, Similarity | None] = (np.inf, None)
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        R = _right_handed(t_axes * np.array([*signs, 1.0])) @ _right_handed(s_axes).T
        found = Similarity(scale, R, centre[1] - scale * R @ centre[0])
        apart = float(_distances(found.of(source), target).mean())
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
    """Carry points of a generic bone (its attachments) to a person's, by their surfaces and, where given, landmarks."""
    moved = _stretched_by_inertia(source, target)
    control = moved(source[:, _evenly(source.shape[1], _MOST_CONTROL)])
    start, found = control, moved(points)
    none = np.zeros((3, 0))
    held = none if source_landmarks is None else moved(source_landmarks)
    goal = none if target_landmarks is None else target_landmarks
    current, onto = control, _projection(target)
    start_and_held = np.concatenate([start, held], axis=1)
    for smoothing in _SMOOTHINGS:
        current = _spline(start_and_held, np.concatenate([onto(current), goal], axis=1), start, smoothing)
    return _spline(start_and_held, np.concatenate([onto(current), goal], axis=1), found, _SMOOTHINGS[-1])


def _stretched_by_inertia(source: Points, target: Points) -> Callable[[Points], Points]:
    """The similarity, with a scale of its own along each principal axis of the target: where the deformation starts."""
    similarity = similarity_by_inertia(source, target)
    values, axes = _principal(target)
    spread = np.var(axes.T @ similarity.of(source), axis=1, ddof=1)
    stretch = axes @ np.diag(np.sqrt(values / spread)) @ axes.T
    centre = target.mean(axis=1)[:, None]
    return lambda points: centre + stretch @ (similarity.of(points) - centre)


def _principal(points: Points) -> tuple[np.ndarray, np.ndarray]:
    values, axes = np.linalg.eigh(np.cov(points))
    values, axes = values[::-1], axes[:, ::-1]
    if (np.diff(-values) < _LEAST_GAP * values[0]).any():
        raise ValueError("two principal axes of the surface have the same inertia: its rotation is not defined")
    return values, axes


def _right_handed(axes: np.ndarray) -> np.ndarray:
    return np.column_stack([axes[:, 0], axes[:, 1], np.cross(axes[:, 0], axes[:, 1])])


def _spline(source: Points, target: Points, at: Points, smoothing: float) -> Points:
    """The displacements of ``source`` to ``target``, smoothed, at other points."""
    from scipy.interpolate import RBFInterpolator  # 0.2 s: not for every command

    spline = RBFInterpolator(source.T, (target - source).T, smoothing=smoothing, kernel="linear", degree=1)
    return at + spline(at.T).T


_NEIGHBOURS = 10
"""Points of a surface that its tangent plane at one of them is laid through."""


def _projection(surface: Points) -> Callable[[Points], Points]:
    """Make the projection to a surface: onto the tangent plane at the nearest of its points, p + n n.(v - p)."""
    from scipy.spatial import KDTree

    tree = KDTree(surface.T)
    patches = surface.T[tree.query(surface.T, k=min(_NEIGHBOURS, surface.shape[1]))[1]]
    normals = np.linalg.svd(patches - patches.mean(axis=1, keepdims=True), full_matrices=False)[2][:, 2].T

    def onto(points: Points) -> Points:
        nearest = tree.query(points.T)[1]
        n = normals[:, nearest]
        return points + n * ((surface[:, nearest] - points) * n).sum(axis=0)

    return onto


def _nearest(points: Points, of: Points) -> np.ndarray:
    from scipy.spatial import KDTree

    return np.asarray(KDTree(of.T).query(points.T)[1])


def _distances(points: Points, to: Points) -> Float[np.ndarray, " points"]:
    return np.linalg.norm(points - to[:, _nearest(points, to)], axis=0)


def _evenly(count: int, most: int) -> np.ndarray:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
