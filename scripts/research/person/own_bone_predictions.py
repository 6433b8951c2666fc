"""Predictions of an adaptation for held-out postures."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from adapt import Adaptations, adapt_subjects
from adapt.engine.batching import take_problems
from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from motions.rotations import DEG
from motions.table import Motions

ADAPTATIONS: Mapping[str, Mapping[str, Any]] = {
    "plain": {},
    "w 300": {"weight": 300.0},
    "own bones": {"own_bones": True},
}
"""Arguments of ``adapt_subjects`` for each kind of adaptation."""


@dataclass(frozen=True)
class Fitted:
    """Girdles adapted to some postures."""

    subjects: tuple[str, ...]
    girdle: Girdle
    """Adapted girdle of each subject."""
    result: Adaptations

    def at(self, motions: Motions) -> Girdle:
        """Return the girdle of each posture."""
        number = {name: k for k, name in enumerate(self.subjects)}
        return take_problems(self.girdle, np.array([number[name] for name in motions.subject.tolist()]))

    def angles(self, motions: Motions) -> Float[np.ndarray, "6 postures"]:
        """Simulate postures, rad; NaN where a fit failed."""
        measured = np.isfinite(motions.angles_deg.T)
        found = fit_batch(self.at(motions), np.where(measured, motions.angles_deg.T, 0.0) / DEG, measured)
        return np.where(found.status == status.OK, found.angles, np.nan)


def adapted_to(motions: Motions, model: ParameterSet, **options: Any) -> Fitted:
    """Adapt a set to these motions."""
    result = adapt_subjects(motions, model, held_out=(), **options)
    theta, words = result.problems.adapted.theta_mm, result.problems.adapted.status
    girdle = result.problems.data.girdle.with_adapted(np.where(words == status.OK, theta, np.nan))
    return Fitted(motions.subjects, girdle, result)


def without(motions: Motions, kind: str) -> tuple[Bool[np.ndarray, " postures"], Bool[np.ndarray, " postures"]]:
    """Return two masks: postures of the other motions, and postures of this motion in subjects that have others."""
    tested = motions.motion == kind
    return ~tested, tested & np.isin(motions.subject, motions.subject[~tested])


def gaps_deg(
    angles: Float[np.ndarray, "6 postures"], wanted_deg: Float[np.ndarray, "postures 6"]
) -> Float[np.ndarray, "6 postures"]:
    """Compute |simulated - wanted| of each angle."""
    return np.abs(angles * DEG - wanted_deg.T)


def bone_means(gaps: Float[np.ndarray, "6 postures"]) -> tuple[float, float]:
    """Average the finite gaps of the clavicle's and of the scapula's angles."""
    clavicle, scapula = (one[np.isfinite(one)].mean() for one in (gaps[:3], gaps[3:]))
    return float(clavicle), float(scapula)
