"""How noisy a measurement is, and how surely that is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Float

from motions.rotations import DEG
from motions.table import ANGLES

_NODES = 3
"""Of the quadrature over the noise: nine change log evidence by 0.2 nats at most, mostly by less than 0.05."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one measurement."""

    angle_deg: float
    landmark_mm: float = 2.0

    def standard_deviations(self, quantities: int) -> Float[np.ndarray, " quantities"]:
        """Repeat the SD for six angles in rad, then for landmark coordinates in mm."""
        angles = len(ANGLES)
        return np.array([self.angle_deg / DEG] * angles + [self.landmark_mm] * (quantities - angles))


@dataclass(frozen=True)
class NoiseEstimate:
    """The noise, and the residual degrees of freedom it rests on: infinite where it was given."""

    noise: Noise
    freedom: float
    source: str
    """'estimated', 'given' or 'assumed', of the angles."""
    noisy_deg: Mapping[int, float] = field(default_factory=dict)
    """SD of the subjects, by number, that scatter far more than the others: it is not in the estimate."""

    @property
    def known(self) -> bool:
        """Whether the noise was given."""
        return not np.isfinite(self.freedom)

    @cached_property
    def likely_factors(self) -> list[tuple[float, float]]:
        """Factors that may take the estimate to the true noise, each with its probability (Gauss-Hermite).

        The logarithm of an SD estimated from n degrees of freedom has an SD of its own of 1 / sqrt(2 n).
        """
        if self.known:
            return [(1.0, 1.0)]
        nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
        factors = np.exp(nodes / np.sqrt(2.0 * self.freedom))
        return list(zip(factors.tolist(), (weights / weights.sum()).tolist(), strict=True))
