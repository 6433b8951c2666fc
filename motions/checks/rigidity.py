"""What is rigid stays rigid: distances between landmarks of one bone over postures, and which landmark slipped.

**Slips.** In posture k the distances d of the pairs differ from their mean over the other postures by
r = J_k v + J_k e, with J_k = dd/dx by the landmarks, e the noise of the landmarks (independent, SD s a coordinate) and
v the slip, which moves one landmark. W_k whitens J_k J_k'. Without a slip |W_k r|^2 over s^2 is chi-squared; s^2 comes
from the other postures, so the ratio of the mean squares has an F distribution. The posture with the largest ratio is
taken out and the rest looked at again, up to a third of the postures; those up to the last significant one slipped
(generalized extreme studentized deviates; Rosner, Technometrics 25 (1983) 165-172). The landmark named is the one with
the largest evidence, with v of SD ``SLIP_MM`` a coordinate.

**What no distance shows.** A landmark that moves at right angles to all its distances, and all landmarks of a bone that
turn or move together: of a triad, AI off the plane of the scapula hardly shows, and a common rotation never.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import jax.scipy.special
import numpy as np
from jaxtyping import Bool, Float, Int

SCAPULA = ("AC", "AA", "TS", "AI")
CLAVICLE = ("SC", "AC")
"""The landmarks of a bone: AC is one of both."""

FEWEST_POSTURES = 4
"""With fewer there is nothing to judge a posture by: it is taken out, and the others still need a scatter."""

FALSE_ALARM = 0.006
"""Chance that a posture of a sound trial is said to have slipped, by the F distribution. The linearised distances are
not quite Gaussian: simulated trials give up to three times as many, at most 2 % (scripts/research/landmarks)."""

SLIP_MM = 10.0
"""SD a coordinate of what a slip is believed to be beforehand: fingers and markers slip by centimetres."""

_MOST_SLIPPED = 1.0 / 3.0
"""Of the postures: where more differ, it is not clear which of them are right."""

_PATIENCE = 10
"""Postures taken out in a row without one that slipped, after which the rest of a long trial is sound."""

_LEAST_NOISE_MM = 0.01
"""Landmarks without noise, simulated ones, are rounded to about this in files."""

_WEAKEST = 0.02
"""A direction of the distances with less than this share of the strongest one's variance is not looked at: the
distances are then bound to each other but for terms of second order."""


@dataclass(frozen=True)
class Slip:
    """A landmark that is not where its bone says, in one posture."""

    posture: int
    """Its place, from 0."""
    landmark: str
    size_mm: float
    """Of the slip as far as the distances show it."""


@dataclass(frozen=True)
class Rigidity:
    """Distances over the postures, and what they say."""

    pairs: tuple[tuple[str, str], ...]
    distances_mm: Float[np.ndarray, "pairs postures"]
    """NaN where one of the two was not measured."""
    slips: tuple[Slip, ...]
    noise_mm: float
    """SD of a coordinate of a landmark, as the distances have it; NaN below ``FEWEST_POSTURES``."""

    def sound(self) -> Bool[np.ndarray, "pairs postures"]:
        """Tell which distances are of landmarks that did not slip and were measured."""
        good = np.isfinite(self.distances_mm)
        for slip in self.slips:
            for row, pair in enumerate(self.pairs):
                good[row, slip.posture] &= slip.landmark not in pair
        return good


def rigid_pairs(names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """List the pairs of these landmarks that one bone holds: all of the scapula, and SC with AC."""
    scapula = [name for name in SCAPULA if name in names]
    clavicle = [CLAVICLE] if all(name in names for name in CLAVICLE) else []
    return (*clavicle, *combinations(scapula, 2))


def check_rigidity(
    landmarks_mm: Mapping[str, Float[np.ndarray, "postures 3"]], pairs: Sequence[tuple[str, str]] | None = None
) -> Rigidity:
    """Find the landmarks that slipped, posture by posture.

    Positions are in any frame, one for each posture or one for all. ``pairs``: those whose distance one bone holds; by
    default :func:`rigid_pairs`. A posture counts where all landmarks of the pairs were measured.
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
    slips, noise_mm = _slips(distances[whole], J)
    found = tuple(Slip(int(whole[k]), names[which], size) for k, which, size in sorted(slips))
    return Rigidity(chosen, distances.T, found, noise_mm)


def _slopes(unit: np.ndarray, ends: Int[np.ndarray, "pairs 2"], landmarks: int) -> np.ndarray:
    """J: of each distance by each landmark, (postures, pairs, landmarks, 3)."""
    J = np.zeros((len(unit), len(ends), landmarks, 3))
    rows = np.arange(len(ends))
    J[:, rows, ends[:, 0]] = unit
    J[:, rows, ends[:, 1]] = -unit
    return J


def _whitening(J: np.ndarray) -> np.ndarray:
    """W with W J J' W' = 1 in the directions that the distances have, (postures, rank, pairs)."""
    flat = J.reshape(*J.shape[:2], -1)
    values, vectors = np.linalg.eigh(flat @ np.swapaxes(flat, 1, 2))
    rank = int((values > _WEAKEST * values[:, -1:]).sum(axis=1).min())
    return np.swapaxes(vectors[:, :, -rank:] / np.sqrt(values[:, None, -rank:]), 1, 2)


def _slips(distances: Float[np.ndarray, "postures pairs"], J: np.ndarray) -> tuple[list[tuple[int, int, float]], float]:
    """Posture, landmark and size of each slip, and the noise."""
    W = _whitening(J)
    taken = _slipped_postures(distances, W)
    kept = np.setdiff1d(np.arange(len(distances)), taken)
    z = np.einsum("krm,km->kr", W, distances - distances[kept].mean(axis=0))
    variance = max(float((z[kept] ** 2).sum()) / ((len(kept) - 1) * W.shape[1]), _LEAST_NOISE_MM**2)
    return [(k, *_landmark(W[k], J[k], z[k], variance)) for k in taken], float(np.sqrt(variance))


def _slipped_postures(distances: Float[np.ndarray, "postures pairs"], W: np.ndarray) -> list[int]:
    """The postures in the order in which they are taken out, up to the last significant one."""
    rank, kept = W.shape[1], list(range(len(distances)))
    taken: list[int] = []
    last = 0
    for _ in range(max(1, int(_MOST_SLIPPED * len(distances)))):
        n = len(kept)
        if n < FEWEST_POSTURES or len(taken) - last > _PATIENCE:
            break
        z = np.einsum("krm,km->kr", W[kept], distances[kept] - distances[kept].mean(axis=0))
        squares = (z**2).sum(axis=1) * n / (n - 1)  # of a posture against the mean of the others
        rest = np.maximum((z**2).sum() - squares, (n - 2) * rank * _LEAST_NOISE_MM**2)
        ratio = squares / rest * (n - 2)
        k = int(np.argmax(ratio))
        taken.append(kept.pop(k))
        if _exceeds_by_chance(float(ratio[k]), rank, (n - 2) * rank) < FALSE_ALARM / n:
            last = len(taken)
    return taken[:last]


def _exceeds_by_chance(F: float, of: int, in_rest: int) -> float:
    """P(F' > F) of the F distribution, by the incomplete beta function."""
    return float(jax.scipy.special.betainc(in_rest / 2.0, of / 2.0, in_rest / (in_rest + of * F)))


def _landmark(W: np.ndarray, J: np.ndarray, z: np.ndarray, variance: float) -> tuple[int, float]:
    """The landmark whose slip explains a posture best, and by how much it slipped."""
    evidence, sizes = [], []
    for which in range(J.shape[1]):
        G = W @ J[:, which]
        precision = G.T @ G / variance + np.eye(3) / SLIP_MM**2
        pull = G.T @ z / variance
        slip = np.linalg.solve(precision, pull)
        evidence.append(0.5 * pull @ slip - 0.5 * np.linalg.slogdet(precision)[1])
        sizes.append(float(np.linalg.norm(slip)))
    best = int(np.argmax(evidence))
    return best, sizes[best]
