"""The input of every solver: simulated subjects, the geometric fit and measured angles as the start, and the bounds;
and the assessment of its answers."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from oracles import Bones, bones, whole_objective  # pyright: ignore[reportMissingImports]

from models import load_model
from models.person.thorax_ellipsoid import jitted_geometric_fit
from motions.rhythm_subjects import simulate_subjects

SEED = 5

CLOSED_MM = 1e-6
"""Largest constraint residual of a valid answer, as in our stopping criterion."""

WITHIN_MM = 1e-5
"""Largest violation of the bounds of theta: interior-point methods relax them by 1e-8 of their size."""

Answer = tuple[np.ndarray, np.ndarray]
"""theta in mm, and the angles in degrees (6, postures)."""


@dataclass(frozen=True)
class Cases:
    """For each subject: min D + w mean(J_p) over theta and all postures, with closed chains and bounds on theta."""

    bones: Bones
    points_mm: np.ndarray
    bounds_mm: np.ndarray
    theta_mm: np.ndarray
    """Start of theta."""
    targets_deg: list[np.ndarray]
    """Measured angles of each subject (6, postures), also the start of its postures."""

    def E(self, answers: Sequence[Answer]) -> np.ndarray:
        """Compute E of each answer by the oracles; NaN where a chain is open or theta is out of its bounds."""
        low, high = self.bounds_mm + np.array([[-WITHIN_MM], [WITHIN_MM]])
        values = []
        for target, (theta, angles) in zip(self.targets_deg, answers, strict=True):
            E, open_mm = whole_objective(self.bones, self.points_mm, target, theta, angles)
            good = open_mm <= CLOSED_MM and bool(np.all((theta >= low) & (theta <= high)))
            values.append(E if good else np.nan)
        return np.array(values)


def cases(model: str, count: int, total: int, first: int = 0, step: int = 1) -> Cases:
    """Select every step-th of the first ``count`` of ``total`` simulated subjects, from ``first``."""
    chosen = load_model(model)
    girdle = jitted_geometric_fit(chosen.girdle, jnp.asarray(chosen.points_mm))
    points, bounds, theta = (np.asarray(x) for x in (chosen.points_mm, chosen.bounds_mm, girdle.adapted_mm))
    motions = simulate_subjects(total, seed=SEED)
    targets = [motions.angles_deg[motions.subject == name].T.copy() for name in motions.subjects[:count][first::step]]
    return Cases(bones(girdle), points, bounds, np.clip(theta, *bounds), targets)
