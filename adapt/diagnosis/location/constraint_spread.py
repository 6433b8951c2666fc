"""How far each constraint is from holding at the measured postures: adapted, with the causes, and by noise alone."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.location.observations import Observed
from models.effects import AnyGirdle
from models.girdle import CONSTRAINTS
from motions.rotations import DEG

_STEP_RAD = 1e-4
"""Of the differences: their error, 1e-8 of the slope, is nothing beside what noise is known to."""


class ConstraintSpread(NamedTuple):
    """Root mean square of one constraint over all postures, mm."""

    constraint: str
    adapted_mm: float
    with_causes_mm: float
    noise_mm: float
    """What noise of the angles alone would make of a chain that closes."""


def constraint_spread(
    data: Observed, adapted: AnyGirdle, with_causes: AnyGirdle, noise_deg: float
) -> list[ConstraintSpread]:
    """Compute the spread of A1-A3 over the postures with all six angles measured; none where there is no such posture.

    ``adapted`` and ``with_causes`` are the chains of all subjects, (component, postures, subjects).
    """
    used = data.measured[:6].all(axis=0) & data.counted
    if not used.any():
        return []
    angles = data.values[:6]
    before, after = (_rms(np.asarray(chain.residuals_mm(angles))[:, used]) for chain in (adapted, with_causes))
    slopes = [_slope(with_causes, angles, k)[:, used] for k in range(6)]
    noise = _rms(np.sqrt(np.sum(np.square(slopes), axis=0))) * noise_deg / float(DEG)
    sizes = np.stack([before, after, noise], axis=1).tolist()
    return [ConstraintSpread(name, *one) for name, one in zip(CONSTRAINTS, sizes, strict=True)]


def _rms(values: Float[np.ndarray, "3 postures"]) -> Float[np.ndarray, "3"]:
    return np.sqrt(np.mean(values**2, axis=1))


def _slope(chain: AnyGirdle, angles: Float[np.ndarray, "6 postures subjects"], k: int) -> np.ndarray:
    """Slope of A1-A3 in one angle, mm a rad."""
    step = np.zeros((6, 1, 1))
    step[k] = _STEP_RAD
    up, down = (np.asarray(chain.residuals_mm(angles + sign * step)) for sign in (1.0, -1.0))
    return (up - down) / (2.0 * _STEP_RAD)
