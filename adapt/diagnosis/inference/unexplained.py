"""Unexplained share of the gap, and a test whether a gap is more than noise."""

import numpy as np

from adapt.diagnosis.fit.search_folds import Folds
from adapt.diagnosis.result import Noise
from models.girdle import CONSTRAINTS

_SURELY = 3.0
"""Number of SDs of the logarithm of a variance ratio above which the gap is more than noise."""


def unexplained_share(adapted_deg: float, with_causes_deg: float, noise_deg: float) -> float:
    """Compute the unexplained share of the adapted gap beyond noise; NaN where there is no such gap."""
    beyond = adapted_deg - noise_deg
    return float(np.clip((with_causes_deg - noise_deg) / beyond, 0.0, 1.0)) if beyond > 0 else np.nan


def more_than_noise(square_deg2: float, folds: Folds, noise: Noise) -> bool:
    """Test whether the mean square per informative value is larger than noise, with one degree of freedom per
    constraint, motion and subject."""
    ratio = square_deg2 / noise.angle_deg**2
    spread = np.sqrt(2.0 / (len(CONSTRAINTS) * len(folds.subject)) + 2.0 / noise.freedom)
    return float(np.log(ratio)) > _SURELY * spread
