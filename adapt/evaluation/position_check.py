"""Simulated positions of landmarks, and their distances from measured positions that no fit uses."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import take_problems
from adapt.evaluation.held_out import AdaptedSubjects, HeldOut
from adapt.evaluation.person_constants import (
    Chains,
    Places,
    constants_of,
    distances_mm,
    not_told,
    prior_of,
    root_mean_square_mm,
    with_constants_mm,
)
from adapt.solvers import status
from adapt.solvers.rows import PostureRows
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import MOTION, Fold
from models.person.family import AnyModel, girdles_of
from models.person.positions.landmark_positions import POSITIONS, BonePoses, bone_poses


@dataclass(frozen=True)
class Judge:
    """Measured positions of subjects, and the prior of the persons' constants about one model."""

    subjects: tuple[str, ...]
    measured_mm: Places
    """Measured positions of the landmarks that a girdle has; thorax frame, NaN where not measured."""
    prior: Float[np.ndarray, "numbers numbers subjects"]

    @staticmethod
    def of(model: AnyModel, rows: PostureRows) -> "Judge":
        """Set up the judge of a model, with the landmarks of these rows."""
        measured = {name: place for name, place in rows.landmarks_mm.items() if name in POSITIONS}
        seen = {name: place for name, place in measured.items() if np.isfinite(place).any()}
        return Judge(rows.subjects, seen, prior_of(model, rows.subjects))

    def simulated_mm(self, chains: Chains) -> dict[str, Float[np.ndarray, "3 n"]]:
        """Compute the positions of the landmarks with each subject's constants, fitted to all its postures."""
        return with_constants_mm(chains, constants_of(chains, self.measured_mm, self.prior), self.measured_mm)

    def not_told(self, chains: Chains) -> tuple[str, ...]:
        """Name the constants that the positions do not determine."""
        return not_told(constants_of(chains, self.measured_mm, self.prior), self.prior, self.measured_mm)

    def gap_mm(self, chains: Chains, folds: Sequence[Fold] = ()) -> float:
        """Compute the root mean square distance over tested landmarks and postures, mm; NaN where there is none.

        ``folds``: the fold of each problem; without folds, each subject is a problem.
        """
        prior = self.prior[..., [fold.subject for fold in folds]] if folds else self.prior
        return root_mean_square_mm(distances_mm(chains, self.measured_mm, prior))


def as_they_are(model: AnyModel, rows: PostureRows, fitted: PostureSolution) -> Chains:
    """Lay out the postures of the model without adaptation: one problem per subject."""
    girdle = girdles_of(model, [rows.subjects[k] for k in rows.subject.tolist()])
    angles = np.where(fitted.status == status.OK, fitted.angles, np.nan)
    return _in_sample(_poses(rows.active_effects.on(girdle), angles), rows.subject)


def in_folds(chains: Chains, folds: Sequence[Fold]) -> Chains:
    """Lay out postures that do not depend on the held-out motion, for constants that do: one problem per fold."""
    row, problem, tested = _of_folds(folds)
    return Chains(take_problems(chains.poses, row), row, problem, ~tested, tested)


def adapted_to_all(found: AdaptedSubjects) -> Chains:
    """Lay out the postures of subjects adapted with one model: one problem per subject."""
    rows, adapted = found.rows, found.adapted
    posture = rows.posture
    angles = np.where(adapted.status == status.OK, adapted.angles, np.nan)[:, posture, rows.subject]
    girdle = found.data.girdles_at(adapted.theta_mm, posture, rows.subject)
    return _in_sample(_poses(girdle, angles), rows.subject)


def adapted_to_folds(rows: PostureRows, held_out: HeldOut) -> Chains:
    """Lay out the postures of subjects adapted without the held-out motion, and the simulated postures of that motion:
    one problem per fold."""
    row, problem, tested = _of_folds(held_out.folds)
    posture, adapted = rows.posture[row], held_out.adapted
    angles = np.where(adapted.status == status.OK, adapted.angles, np.nan)[:, posture, problem]
    angles[:, tested] = np.concatenate(held_out.angles, axis=1)
    poses = _poses(held_out.data.girdles_at(adapted.theta_mm, posture, problem), angles)
    return Chains(poses, row, problem, ~tested, tested)


def of_motions(held_out: HeldOut) -> HeldOut:
    """Select the folds of one model that hold out a kind of motion."""
    chosen = np.flatnonzero([fold.kind == MOTION for fold in held_out.folds])
    return held_out.of(chosen)


def _poses(girdle, angles: Float[np.ndarray, "6 n"]) -> BonePoses:
    return jax.tree.map(np.asarray, bone_poses(girdle, angles))


def _in_sample(poses: BonePoses, subject: Int[np.ndarray, " rows"]) -> Chains:
    every = np.ones(len(subject), bool)
    return Chains(poses, np.arange(len(subject)), subject, every, every)


def _of_folds(
    folds: Sequence[Fold],
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Return rows, problems and the mask of tested postures: first the fitted rows of all folds, then the tested
    ones."""
    each = [fold.fitted for fold in folds] + [fold.tested for fold in folds]
    counts = [len(rows) for rows in each]
    problem, tested = np.tile(np.arange(len(folds)), 2), np.repeat([False, True], len(folds))
    return np.concatenate(each), np.repeat(problem, counts), np.repeat(tested, counts)
