"""How many independent numbers a motion of a person tells: what no cause explains is alike in what lies near.

The mean of n postures of S shoulders is as well known as that of so many independent ones

    S n / (L + (S - 1) rho L'),      L = (1 + r) / (1 - r), at most n

- **Along a motion** y is taken for a stationary process. r is the correlation of neighbours; L of them tell as much as
  one. White noise has r = 0.
- **Between shoulders** y is alike where a cause is not quite of the form that it has here. rho is the correlation of
  two shoulders at one elevation of one motion, and L' is L of what they share, which is no noise. However many there
  are, it counts as often as that of 1 / rho of them at most.
"""

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.shoulders import Shoulders
from models.girdle import CONSTRAINTS

_ALIKE_DEG = 10.0
"""Elevations that round to the same multiple of it are one place: postures of most files are as far apart."""


def numbers_per_fold(shoulders: Shoulders, y: Float[np.ndarray, "rows 3"]) -> float:
    """Estimate how many independent numbers a motion of a subject tells, of the three constraints together."""
    sequences = [rows for rows in shoulders.sequences() if len(rows)]
    n = float(np.mean([len(rows) for rows in sequences]))
    before, after = (np.concatenate([rows[part] for rows in sequences]) for part in (np.s_[:-1], np.s_[1:]))
    square = 0.5 * (y[before] ** 2 + y[after] ** 2)
    own = _share(y[before] * y[after], square)
    others = mean_of_others(shoulders, y)
    rho = _share(y * others, y**2)
    shared = _share(0.5 * (y[before] * others[after] + y[after] * others[before]), square * rho)
    alike = _length(own, n) + (len(shoulders.subjects) - 1) * rho * _length(shared, n)
    return len(CONSTRAINTS) * n / alike


def mean_of_others(shoulders: Shoulders, y: Float[np.ndarray, "rows 3"]) -> Float[np.ndarray, "rows 3"]:
    """Average y of the other shoulders at the place of each row, each one's mean there; NaN where there is none."""
    met, of_row = np.unique(np.stack([_places(shoulders), shoulders.subject]), axis=1, return_inverse=True)
    place = met[0]
    mean = _sums(y, of_row) / np.bincount(of_row)[:, None]
    others = np.bincount(place)[place, None] - 1.0
    with np.errstate(invalid="ignore"):
        return np.where(others > 0.0, (_sums(mean, place)[place] - mean) / others, np.nan)[of_row]


def _places(shoulders: Shoulders) -> Int[np.ndarray, " rows"]:
    """Number the places of postures: motion and elevation; where that was not measured, motion and posture."""
    motions = shoulders.motions
    elevation = np.round(motions.humerus_elevation_deg / _ALIKE_DEG)
    along = np.where(np.isfinite(elevation), elevation, motions.posture)
    return np.unique(np.stack([shoulders.motion, along]), axis=1, return_inverse=True)[1]


def _sums(values: Float[np.ndarray, "rows n"], group: Int[np.ndarray, " rows"]) -> Float[np.ndarray, "groups n"]:
    return np.stack([np.bincount(group, column) for column in values.T], axis=1)


def _share(product: Float[np.ndarray, "rows 3"], square: Float[np.ndarray, "rows 3"]) -> float:
    """Correlation, of the rows in which both are known: 0 to 1, and 0 where there is none."""
    known = np.isfinite(product)
    total = float(square[known].sum())
    return float(np.clip(product[known].sum() / total, 0.0, 1.0)) if total > 0 else 0.0


def _length(correlation: float, n: float) -> float:
    return min(n, (1.0 + correlation) / (1.0 - correlation)) if correlation < 1.0 else n
