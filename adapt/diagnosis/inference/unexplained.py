"""Unexplained share of the gap, and a test whether a misfit is more than noise."""

import numpy as np

from adapt.diagnosis.result import Noise

BY_CHANCE = 0.05
"""Probability of a larger misfit by chance below which a misfit is more than noise."""

_ENDLESS = 1e9
"""Degrees of freedom of a known noise: SciPy has no F distribution of infinitely many."""


def unexplained_share(adapted_deg: float, with_causes_deg: float, noise_deg: float) -> float:
    """Compute the unexplained share of the adapted gap beyond noise; NaN where there is no such gap."""
    beyond = adapted_deg - noise_deg
    return float(np.clip((with_causes_deg - noise_deg) / beyond, 0.0, 1.0)) if beyond > 0 else np.nan


def more_than_noise(chi2: float, freedom: int, noise: Noise) -> bool:
    """Test whether a misfit in units of the noise is more than noise, whose variance is an estimate itself (F test)."""
    from scipy.special import fdtrc  # slow import that not every command needs

    return bool(fdtrc(freedom, min(noise.freedom, _ENDLESS), chi2 / freedom) < BY_CHANCE)
