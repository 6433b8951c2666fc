"""What no cause explains: its share of the gap, and whether it is more than noise."""

import numpy as np

from adapt.diagnosis.fit.search_folds import Folds
from adapt.diagnosis.result import Noise
from models.girdle import CONSTRAINTS

_SURELY = 3.0
"""Standard deviations of the logarithm of a ratio of variances from which the gap is more than noise."""


def left_over_share(adapted_deg: float, with_causes_deg: float, noise_deg: float) -> float:
    """Compute the share of the adapted gap beyond noise that the causes leave; NaN where there is no such gap."""
    beyond = adapted_deg - noise_deg
    return float(np.clip((with_causes_deg - noise_deg) / beyond, 0.0, 1.0)) if beyond > 0 else np.nan


def more_than_noise(square_deg2: float, folds: Folds, noise: Noise) -> bool:
    """Tell whether the mean square of what is informative is larger than noise; one number of each constraint a motion
    of a person."""
    ratio = square_deg2 / noise.angle_deg**2
    spread = np.sqrt(2.0 / (len(CONSTRAINTS) * len(folds.subject)) + 2.0 / noise.freedom)
    return float(np.log(ratio)) > _SURELY * spread
