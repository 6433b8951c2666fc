"""How much is told again: what no cause explains is alike in neighbouring postures and in other shoulders.

- **Along a motion** y is taken for a stationary process. With the correlation r of neighbours L = (1 + r) / (1 - r) of
  them tell as much as one, at most all n. White noise has r = 0.
- **Between shoulders** y is alike where a cause is not quite of the form that it has here. With the correlation rho of
  two shoulders at one elevation of one motion, y of S shoulders has the covariance (1 - rho) I + rho 1 1' there, times
  its variance. So in the likelihood the sum of squares is

      sum |y - mean|^2 + (1 - rho) / (1 + (S - 1) rho L' / L) S |mean|^2

  Without correlation it is sum |y|^2. L' is L of what shoulders share, which is no noise. What they share counts as
  that of 1 / rho of them at most, however many there are.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.shoulders import Shoulders, sums_by
from models.girdle import CONSTRAINTS


class Independence(NamedTuple):
    """How much the unseen postures tell."""

    numbers: float = float(len(CONSTRAINTS))
    """Independent numbers of a fold, a motion of a shoulder, of the three constraints together."""
    common_weight: float = 1.0
    """Of squares of what shoulders have in common, beside 1 of what is their own."""


def independence_of(shoulders: Shoulders, y: Float[np.ndarray, "rows 3"]) -> Independence:
    """Estimate it from what a fit leaves."""
    sequences = [rows for rows in shoulders.sequences() if len(rows)]
    n = float(np.mean([len(rows) for rows in sequences]))
    before, after = (np.concatenate([rows[part] for rows in sequences]) for part in (np.s_[:-1], np.s_[1:]))
    square = 0.5 * (y[before] ** 2 + y[after] ** 2)
    r = _correlation(y[before] * y[after], square)
    others = mean_of_others(shoulders, y)
    rho = _correlation(y * others, y**2)
    r_shared = _correlation(0.5 * (y[before] * others[after] + y[after] * others[before]), square * rho)
    longer = _length(r_shared, n) / _length(r, n)
    return Independence(len(CONSTRAINTS) * n / _length(r, n), weight_of_common(rho, len(shoulders.subjects), longer))


def weight_of_common(rho: float, shoulders: int, longer: float) -> float:
    """Compute (1 - rho) / (1 + (S - 1) rho L' / L); ``longer`` is L' / L."""
    return (1.0 - rho) / (1.0 + (shoulders - 1) * rho * longer)


def mean_of_others(shoulders: Shoulders, y: Float[np.ndarray, "rows 3"]) -> Float[np.ndarray, "rows 3"]:
    """Average y of the other shoulders at the place of each row, each one's mean there; NaN where there is none."""
    met, of_row = np.unique(np.stack([shoulders.places, shoulders.subject]), axis=1, return_inverse=True)
    place = met[0]
    mean = sums_by(of_row, y) / np.bincount(of_row)[:, None]
    others = np.bincount(place)[place, None] - 1.0
    with np.errstate(invalid="ignore"):
        return np.where(others > 0.0, (sums_by(place, mean)[place] - mean) / others, np.nan)[of_row]


def _correlation(product: Float[np.ndarray, "rows 3"], square: Float[np.ndarray, "rows 3"]) -> float:
    """Mean product over mean square of the rows in which both are known: 0 to 1, and 0 where there is none."""
    known = np.isfinite(product)
    total = float(square[known].sum())
    return float(np.clip(product[known].sum() / total, 0.0, 1.0)) if total > 0 else 0.0


def _length(r: float, n: float) -> float:
    return min(n, (1.0 + r) / (1.0 - r)) if r < 1.0 else n
