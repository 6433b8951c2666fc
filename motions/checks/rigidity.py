"""Rigidity of bones: distances between landmarks of one bone over postures, and landmark outliers.

**Outliers.** In posture k the distances d of the pairs differ from their mean over the other postures by
r = J_k v + J_k e. J_k = dd/dx is the Jacobian by the landmarks, e the noise of the landmarks (independent, SD s per
coordinate) and v the displacement of the outlier, one landmark. W_k whitens J_k J_k'. Without one |W_k r|^2 over s^2 is
chi-squared; s^2 comes from the other postures, so the ratio of the mean squares has an F distribution. The posture with
the largest ratio is taken out and the rest tested again, up to a third of the postures; all postures up to the last
significant one have an outlier (generalized extreme studentized deviates; Rosner, Technometrics 25 (1983) 165-172). The
landmark with the largest evidence is named, with a prior of SD ``OUTLIER_MM`` per coordinate for v.

**Invisible outliers.** Distances do not show a landmark that moves at right angles to all of them, or all landmarks of
a bone that turn or move together. In a triad, AI off the plane of the scapula hardly shows, a common rotation never.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import jax.scipy.special
import numpy as np
from jaxtyping import Bool, Float, Int

SCAPULA = ("AC", "AA", "TS", "AI")
CLAVICLE = ("SC", "AC")
"""Landmarks of the clavicle; AC belongs to the scapula too."""

FEWEST_POSTURES = 4
"""Minimum number of postures: without the tested posture, the others still need a scatter."""

FALSE_ALARM = 0.006
"""Probability, by the F distribution, that any posture of a sound trial is reported. The linearised distances are not
quite Gaussian: simulated trials give up to three times as many, at most 2 % (scripts/research/landmarks)."""

OUTLIER_MM = 10.0
"""Prior SD of an outlier's displacement per coordinate, in mm: fingers and markers may be off by centimetres."""

_LARGEST_SHARE = 1.0 / 3.0
"""Maximum share of postures with an outlier: if more differ, it is not clear which of them are right."""

_PATIENCE = 10
"""Number of postures taken out in a row without a significant one, after which the rest of a long trial is sound."""

_LEAST_NOISE_MM = 0.01
"""Minimum noise in mm: files round simulated landmarks, which have no noise, to about this."""

_WEAKEST = 0.02
"""Minimum variance of a direction of the distances, as a share of the strongest one's. In a weaker direction, which is
ignored, the distances determine each other except for second-order terms."""


@dataclass(frozen=True)
class LandmarkOutlier:
    """Landmark that is not at its place on the bone in one posture."""

    posture: int
    """Index of the posture, from 0."""
    landmark: str
    size_mm: float
    """Size of the displacement as far as the distances show it."""


@dataclass(frozen=True)
class Rigidity:
    """Distances over the postures, and the outliers and the noise that they show."""

    pairs: tuple[tuple[str, str], ...]
    distances_mm: Float[np.ndarray, "pairs postures"]
    """Distances; NaN where one of the two landmarks was not measured."""
    outliers: tuple[LandmarkOutlier, ...]
    noise_mm: float
    """SD of the noise per coordinate of a landmark, from the distances; NaN below ``FEWEST_POSTURES``."""

    def sound(self) -> Bool[np.ndarray, "pairs postures"]:
        """Check which distances were measured between landmarks that are no outliers."""
        good = np.isfinite(self.distances_mm)
        for outlier in self.outliers:
            for row, pair in enumerate(self.pairs):
                good[row, outlier.posture] &= outlier.landmark not in pair
        return good


def rigid_pairs(names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """List the pairs of these landmarks on one bone: all pairs of the scapula, and SC with AC."""
    scapula = [name for name in SCAPULA if name in names]
    clavicle = [CLAVICLE] if all(name in names for name in CLAVICLE) else []
    return (*clavicle, *combinations(scapula, 2))


def check_rigidity(
    landmarks_mm: Mapping[str, Float[np.ndarray, "postures 3"]], pairs: Sequence[tuple[str, str]] | None = None
) -> Rigidity:
    """Find the landmark outliers, posture by posture.

    Positions are in any frame, which may differ between postures. ``pairs``: pairs of landmarks on one bone; by default
    :func:`rigid_pairs`. A posture counts if all landmarks of the pairs were measured.
    """
    chosen = tuple(rigid_pairs(list(landmarks_mm)) if pairs is None else pairs)
    names = list(dict.fromkeys(name for pair in chosen for name in pair))
    if not chosen:
        return Rigidity((), np.zeros((0, 0)), (), np.nan)
    positions = np.stack([np.asarray(landmarks_mm[name], float) for name in names], axis=1)
    ends = np.array([[names.index(a), names.index(b)] for a, b in chosen])
    between = positions[:, ends[:, 0]] - positions[:, ends[:, 1]]
    distances = np.linalg.norm(between, axis=2)
    whole = np.flatnonzero(np.isfinite(distances).all(axis=1) & (distances > 0.0).all(axis=1))
    if len(whole) < FEWEST_POSTURES:
        return Rigidity(chosen, distances.T, (), np.nan)
    J = _slopes(between[whole] / distances[whole][..., None], ends, len(names))
    outliers, noise_mm = _outliers(distances[whole], J)
    found = tuple(LandmarkOutlier(int(whole[k]), names[which], size) for k, which, size in sorted(outliers))
    return Rigidity(chosen, distances.T, found, noise_mm)


def _slopes(unit: np.ndarray, ends: Int[np.ndarray, "pairs 2"], landmarks: int) -> np.ndarray:
    """Compute the Jacobian J of the distances by the landmarks, (postures, pairs, landmarks, 3)."""
    J = np.zeros((len(unit), len(ends), landmarks, 3))
    rows = np.arange(len(ends))
    J[:, rows, ends[:, 0]] = unit
    J[:, rows, ends[:, 1]] = -unit
    return J


def _whitening(J: np.ndarray) -> np.ndarray:
    """Compute W with W J J' W' = 1 in the directions that the distances have, (postures, rank, pairs)."""
    flat = J.reshape(*J.shape[:2], -1)
    values, vectors = np.linalg.eigh(flat @ np.swapaxes(flat, 1, 2))
    rank = int((values > _WEAKEST * values[:, -1:]).sum(axis=1).min())
    return np.swapaxes(vectors[:, :, -rank:] / np.sqrt(values[:, None, -rank:]), 1, 2)


def _outliers(
    distances: Float[np.ndarray, "postures pairs"], J: np.ndarray
) -> tuple[list[tuple[int, int, float]], float]:
    """Return posture, landmark and size of each outlier, and the noise."""
    W = _whitening(J)
    taken = _postures_with_outlier(distances, W)
    kept = np.setdiff1d(np.arange(len(distances)), taken)
    z = np.einsum("krm,km->kr", W, distances - distances[kept].mean(axis=0))
    variance = max(float((z[kept] ** 2).sum()) / ((len(kept) - 1) * W.shape[1]), _LEAST_NOISE_MM**2)
    return [(k, *_landmark(W[k], J[k], z[k], variance)) for k in taken], float(np.sqrt(variance))


def _postures_with_outlier(distances: Float[np.ndarray, "postures pairs"], W: np.ndarray) -> list[int]:
    """List the postures in the order in which they are taken out, up to the last significant one."""
    rank, kept = W.shape[1], list(range(len(distances)))
    taken: list[int] = []
    last = 0
    for _ in range(max(1, int(_LARGEST_SHARE * len(distances)))):
        n = len(kept)
        if n < FEWEST_POSTURES or len(taken) - last > _PATIENCE:
            break
        z = np.einsum("krm,km->kr", W[kept], distances[kept] - distances[kept].mean(axis=0))
        squares = (z**2).sum(axis=1) * n / (n - 1)  # relative to the mean of the other postures
        rest = np.maximum((z**2).sum() - squares, (n - 2) * rank * _LEAST_NOISE_MM**2)
        ratio = squares / rest * (n - 2)
        k = int(np.argmax(ratio))
        taken.append(kept.pop(k))
        if _exceeds_by_chance(float(ratio[k]), rank, (n - 2) * rank) < FALSE_ALARM / n:
            last = len(taken)
    return taken[:last]


def _exceeds_by_chance(F: float, of: int, in_rest: int) -> float:
    """Compute P(F' > F) of the F distribution by the incomplete beta function."""
    return float(jax.scipy.special.betainc(in_rest / 2.0, of / 2.0, in_rest / (in_rest + of * F)))


def _landmark(W: np.ndarray, J: np.ndarray, z: np.ndarray, variance: float) -> tuple[int, float]:
    """Find the landmark whose displacement explains a posture best, and its size."""
    evidence, sizes = [], []
    for which in range(J.shape[1]):
        G = W @ J[:, which]
        precision = G.T @ G / variance + np.eye(3) / OUTLIER_MM**2
        pull = G.T @ z / variance
        moved = np.linalg.solve(precision, pull)
        evidence.append(0.5 * pull @ moved - 0.5 * np.linalg.slogdet(precision)[1])
        sizes.append(float(np.linalg.norm(moved)))
    best = int(np.argmax(evidence))
    return best, sizes[best]
