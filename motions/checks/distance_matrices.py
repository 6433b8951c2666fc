"""Distance matrices of two measurements of one bone (thesis, chapters 4 and 5).

The distance matrices are DM_1 and DM_2, and E = DM_1 - DM_2 (Eq. 4.1 and 5.1). A point that is wrong in one measurement
spoils its whole row of E, so the largest consistent subset of points is kept.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Float


def distance_matrix(points: Float[np.ndarray, "3 points"]) -> Float[np.ndarray, "points points"]:
    """Compute the distances between all points."""
    return np.linalg.norm(points[:, :, None] - points[:, None, :], axis=0)


def difference_matrix(
    one: Float[np.ndarray, "points points"], other: Float[np.ndarray, "points points"]
) -> Float[np.ndarray, "points points"]:
    """Compute E = DM_1 - DM_2 (Eq. 4.1, 5.1): positive where the distance is larger in the first measurement."""
    return one - other


MOST_POINTS = 16
"""Maximum number of points, of which every subset is searched: 65 000 subsets."""


def largest_consistent(differences: Float[np.ndarray, "points points"]) -> tuple[int, ...]:
    """Find the largest set of points with all absolute differences within the mean absolute difference (Table 5.1).

    Among sets of equal size, return the one with the smallest mean difference. Raise ValueError for more than
    ``MOST_POINTS`` points, which have too many subsets.
    """
    apart = np.abs(differences)
    count = len(apart)
    if count > MOST_POINTS:
        raise ValueError(f"{count} points, and sets of at most {MOST_POINTS} are looked through")
    limit = float(apart[np.triu_indices(count, 1)].mean())
    for size in range(count, 1, -1):
        kept = [part for part in combinations(range(count), size) if _mean_of(apart, part, np.max) <= limit]
        if kept:
            return min(kept, key=lambda part: _mean_of(apart, part, np.mean))
    return ()


def mean_difference(differences: Float[np.ndarray, "points points"], points: Sequence[int]) -> float:
    """Average the absolute differences between these points."""
    return _mean_of(np.abs(differences), points, np.mean)


def _mean_of(apart: np.ndarray, points: Sequence[int], what) -> float:
    return float(what([apart[i, j] for i, j in combinations(points, 2)]))
