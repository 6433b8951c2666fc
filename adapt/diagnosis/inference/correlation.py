"""How many independent numbers a motion tells: postures that share a discrepancy tell little more than one.

What no cause explains is taken for a stationary process along a motion; of its correlation r between neighbours follows
the number of independent postures, n (1 - r) / (1 + r), at least one. White noise has r = 0.
"""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.shoulders import Shoulders
from models.girdle import CONSTRAINTS


def numbers_per_fold(shoulders: Shoulders, y: Float[np.ndarray, "rows 3"]) -> float:
    """Estimate how many independent numbers a motion of a subject tells, of the three constraints together."""
    product = square = 0.0
    counts = []
    for rows in shoulders.sequences():
        before, after = y[rows[:-1]], y[rows[1:]]
        product += float((before * after).sum())
        square += 0.5 * float((before**2).sum() + (after**2).sum())
        counts += [len(rows)] if len(rows) else []
    correlation = float(np.clip(product / square, 0.0, 1.0)) if square > 0 else 0.0
    independent = np.mean(counts) * (1.0 - correlation) / (1.0 + correlation)
    return len(CONSTRAINTS) * max(1.0, float(independent))
