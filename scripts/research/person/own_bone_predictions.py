"""What an adaptation predicts of postures that it has not seen: angles, and positions of SC and AA."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from adapt import Adaptations, adapt_subjects
from adapt.engine.batching import take_problems
from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from models.girdle import Girdle, bone_rotations
from models.parameter_sets import ParameterSet
from motions.rotations import DEG, rotate
from motions.table import Motions

ADAPTATIONS: Mapping[str, Mapping[str, Any]] = {
    "plain": {},
    "w 300": {"weight": 300.0},
    "own bones": {"own_bones": True},
}
"""Arguments of ``adapt_subjects``."""


@dataclass(frozen=True)
class Fitted:
    """Girdles adapted to some postures."""

    subjects: tuple[str, ...]
    girdle: Girdle
    """Of each subject."""
    result: Adaptations

    def at(self, motions: Motions) -> Girdle:
        """Give the girdle of each posture."""
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
    """Mark the postures of the other motions, and those of this one, of subjects that have others."""
    tested = motions.motion == kind
    return ~tested, tested & np.isin(motions.subject, motions.subject[~tested])


@dataclass(frozen=True)
class Places:
    """Where SC and AA are predicted, mm."""

    SC: Float[np.ndarray, "3 postures"]
    AA: Float[np.ndarray, "3 postures"]


def predicted_places(seen: Motions, seen_angles, unseen: Motions, angles, ac_mm: Float[np.ndarray, "3 subjects"]):
    """Predict SC, at rest, and AA = SC + R_C ac + R_S a, of the postures of ``unseen``.

    SC and a are three constants each of every subject, the means over the postures of ``seen``. Angles: rad, measured
    or simulated. ``ac_mm``: of each subject, in the clavicle.
    """
    SC, AA = np.full((2, 3, len(unseen.subject)), np.nan)
    for k, name in enumerate(seen.subjects):
        mine, there = seen.subject == name, unseen.subject == name
        centre = np.nanmean(seen.landmarks_mm["SC"][mine], axis=0)[:, None]
        clavicle, scapula = bone_rotations(seen_angles[:, mine])
        rest = seen.landmarks_mm["AA"][mine].T - centre - rotate(clavicle, ac_mm[:, k, None])
        own = np.nanmean(rotate(np.swapaxes(scapula, 0, 1), rest), axis=1, keepdims=True)
        clavicle, scapula = bone_rotations(angles[:, there])
        SC[:, there] = centre
        AA[:, there] = centre + rotate(clavicle, ac_mm[:, k, None]) + rotate(scapula, own)
    return Places(SC, AA)


def own_ac_mm(seen: Motions, angles: Float[np.ndarray, "6 postures"]) -> Float[np.ndarray, "3 subjects"]:
    """Fit AC in the clavicle to measured positions, by least squares: what a rigid chain could do at best.

    AA - SC = R_C ac + R_S a in every posture of a subject, six unknowns; SC the mean.
    """
    found = []
    for name in seen.subjects:
        mine = seen.subject == name
        centre = np.nanmean(seen.landmarks_mm["SC"][mine], axis=0)
        rotations = np.concatenate([np.moveaxis(np.asarray(R), -1, 0) for R in bone_rotations(angles[:, mine])], axis=2)
        rest = (seen.landmarks_mm["AA"][mine] - centre).ravel()
        known = np.isfinite(rest)
        found.append(np.linalg.lstsq(rotations.reshape(-1, 6)[known], rest[known], rcond=None)[0][:3])
    return np.stack(found, axis=1)


def distances_mm(motions: Motions, places: Places) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Compute how far the measured SC and AA are from where they are predicted, each posture."""
    sc, aa = (
        np.linalg.norm(motions.landmarks_mm[name].T - at, axis=0) for name, at in (("SC", places.SC), ("AA", places.AA))
    )
    return sc, aa


def gaps_deg(
    angles: Float[np.ndarray, "6 postures"], wanted_deg: Float[np.ndarray, "postures 6"]
) -> Float[np.ndarray, "6 postures"]:
    """Compute |simulated - wanted| of each angle."""
    return np.abs(angles * DEG - wanted_deg.T)


def bone_means(gaps: Float[np.ndarray, "6 postures"]) -> tuple[float, float]:
    """Average gaps of the clavicle's and of the scapula's angles, where they are known."""
    clavicle, scapula = (one[np.isfinite(one)].mean() for one in (gaps[:3], gaps[3:]))
    return float(clavicle), float(scapula)
