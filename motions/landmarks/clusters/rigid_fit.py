"""Fit of a rigid body to its markers, frame by frame, and parts of the motion between two poses.

The fit is the least squares of x_m = R a_m + t over the markers m that were seen: with H = sum a_m x_m' about both
centroids and H = U S V', R = V diag(1, 1, det VU') U' (Soderkvist & Wedin, J. Biomech. 26 (1993) 1473-1477).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from motions.rotations import compose, cross_matrix, rotate, rotation_from_vector, vector_from_rotation

FEWEST = 3
"""Number of markers that determine a position and a rotation."""

THIN_MM = 3.0
"""Smallest root mean square distance of the markers from a line. Below it, a millimetre of noise turns the body about
this line by more than 20 degrees. Clusters in use are three to ten times as wide."""


class Pose(NamedTuple):
    """Rigid transformation x = R a + t, per frame."""

    R: Float[np.ndarray, "3 3 frames"]
    t: Float[np.ndarray, "3 frames"]

    def carry(self, points: Float[np.ndarray, "3 #frames"]) -> Float[np.ndarray, "3 frames"]:
        """Compute R a + t."""
        return rotate(self.R, points) + self.t

    def fetch(self, points: Float[np.ndarray, "3 frames"]) -> Float[np.ndarray, "3 frames"]:
        """Compute R' (x - t), the inverse of ``carry``."""
        return rotate(np.swapaxes(self.R, 0, 1), points - self.t)

    def after(self, first: "Pose") -> "Pose":
        """Compute the composition: first the transformation ``first``, then this one."""
        return Pose(compose(self.R, first.R), self.carry(first.t))

    def inverse(self) -> "Pose":
        """Compute the inverse transformation."""
        R = np.swapaxes(self.R, 0, 1)
        return Pose(R, -rotate(R, self.t))


class RigidFit(NamedTuple):
    """Pose in each frame and root mean square distance of the markers, mm; NaN where too few markers were seen."""

    pose: Pose
    residual_mm: Float[np.ndarray, " frames"]


def fit_rigid(shape_mm: Float[np.ndarray, "markers 3"], seen_mm: Float[np.ndarray, "markers 3 frames"]) -> RigidFit:
    """Fit the shape to the markers of each frame; NaN where fewer than FEWEST were seen, or all lie near a line."""
    seen = np.all(np.isfinite(seen_mm), axis=1)
    count = np.maximum(seen.sum(axis=0), 1)
    a, x = np.where(seen[:, None], shape_mm[..., None], 0.0), np.where(seen[:, None], seen_mm, 0.0)
    a_mean, x_mean = a.sum(axis=0) / count, x.sum(axis=0) / count
    a, x = (np.where(seen[:, None], part - mean, 0.0) for part, mean in ((a, a_mean), (x, x_mean)))
    U, _, Vt = np.linalg.svd(np.einsum("min,mjn->nij", a, x))
    last = np.sign(np.linalg.det(np.swapaxes(U @ Vt, 1, 2)))
    R = np.einsum("nki,nk,njk->ijn", Vt, np.stack([np.ones_like(last), np.ones_like(last), last], axis=1), U)
    rest = np.where(seen[:, None], x - np.einsum("ijn,mjn->min", R, a), 0.0)
    pose = Pose(R, x_mean - rotate(R, a_mean))
    good = (seen.sum(axis=0) >= FEWEST) & ~thin(a, seen)
    residual = np.sqrt((rest**2).sum(axis=(0, 1)) / count)
    return RigidFit(Pose(*(np.where(good, part, np.nan) for part in pose)), np.where(good, residual, np.nan))


def thin(about_mean_mm: Float[np.ndarray, "markers 3 frames"], seen: Bool[np.ndarray, "markers frames"]) -> np.ndarray:
    """Find the frames in which the markers lie within THIN_MM of a line."""
    sizes = np.linalg.svd(np.moveaxis(about_mean_mm, 2, 0), compute_uv=False)
    if sizes.shape[1] < 2:
        return np.ones(len(sizes), bool)
    return sizes[:, 1] < THIN_MM * np.sqrt(np.maximum(seen.sum(axis=0), 1))


def mean_shape(seen_mm: Float[np.ndarray, "markers 3 frames"]) -> Float[np.ndarray, "markers 3"]:
    """Average the shape of a cluster over the frames, in the pose of the first frame that has all markers.

    ValueError if no frame has all markers, or if they lie in a line.
    """
    whole = np.flatnonzero(np.isfinite(seen_mm).all(axis=(0, 1)))
    if not len(whole):
        raise ValueError("its markers are in no frame together")
    shape = seen_mm[..., whole[0]]
    fit = fit_rigid(shape, seen_mm[..., whole])
    if np.isnan(fit.residual_mm).any():
        raise ValueError("its markers lie in a line")
    return np.stack([fit.pose.fetch(marker[:, whole]).mean(axis=1) for marker in seen_mm])


def part_of_the_way(whole: Pose, share: Float[np.ndarray, " frames"]) -> Pose:
    """Compute a share of a screw motion D (``whole``, one pose): exp(share log D).

    With w the rotation vector of D, the translation of D is V(w) v, and the translation of the share is
    share V(share w) v.
    """
    w = vector_from_rotation(whole.R[..., 0])
    v = np.linalg.solve(_translating(w[:, None])[..., 0], whole.t[:, 0])
    w_share = w[:, None] * share
    return Pose(rotation_from_vector(w_share), share * rotate(_translating(w_share), v[:, None]))


_SMALL_RAD = 1e-4
"""Angle below which the first terms of the series of V are exact to the last digit."""


def _translating(w: Float[np.ndarray, "3 frames"]) -> Float[np.ndarray, "3 3 frames"]:
    """Compute V(w), the mean of exp([s w]x) over s from 0 to 1.

    V(w) = 1 + (1 - cos a)/a^2 [w]x + (a - sin a)/a^3 [w]x^2 with a = |w|.
    """
    a = np.linalg.norm(w, axis=0)
    safe = np.where(a < _SMALL_RAD, 1.0, a)
    first = np.where(a < _SMALL_RAD, 0.5, 2.0 * np.sin(safe / 2.0) ** 2 / safe**2)
    second = np.where(a < _SMALL_RAD, 1.0 / 6.0, (safe - np.sin(safe)) / safe**3)
    K = np.asarray(cross_matrix(w))
    return np.eye(3)[..., None] + first * K + second * np.asarray(compose(K, K))
