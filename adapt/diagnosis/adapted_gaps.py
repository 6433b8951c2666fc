"""The gaps of `girdle adapt`, and of `girdle adapt --effect`: the same fits, bounds and held-out folds."""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from adapt.diagnosis.inference.intervals import by_bone
from adapt.diagnosis.result import BoneGaps
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.motion_rows import MotionRows, fit_rows
from adapt.solvers.padded_batch import Batch, pack
from adapt.solvers.problem_batch import problem_batch
from adapt.tables.held_out import MOTION, POSTURES
from adapt.trust.held_out import folds, held_out
from models.effects.known import Amplitudes, active_effects
from models.parameter_sets import ParameterSet
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class AdaptedGaps:
    """What the adaptations of one model leave, with known effects or without; mean |simulated - measured|, degrees."""

    batch: Batch
    adapted: Adapted
    in_sample: BoneGaps
    """Over the postures of each subject, then over subjects: the mean of summary.csv."""
    unseen: Mapping[str, BoneGaps]
    """By what is held out, MOTION (where there are several) or POSTURES: the mean of the rows of heldout.csv."""
    before: Mapping[str, BoneGaps]
    """The same without adaptation; under the empty word in sample."""


def adapted_gaps(motions: Motions, model: ParameterSet, effects: Amplitudes, person: Mapping[str, int]) -> AdaptedGaps:
    """Adapt the model to all subjects, and again without each motion and each third of the postures.

    ``person``: the number of the person of each subject, for the intervals.
    """
    batch = pack(motions)
    data = problem_batch(batch, [model], active_effects(effects, motions).at(batch.rows))
    adapted = adapt_batch(data)
    measured = np.where(batch.measured & batch.counted, batch.angles, np.nan)
    after = np.abs(np.where(adapted.status == status.OK, adapted.angles, np.nan) - measured) * float(DEG)
    count = len(motions.posture)
    fitted = fit_rows(MotionRows.of_models(motions, 1, effects, float), _repeated(model, count))
    rows = np.abs(np.where(fitted.status == status.OK, fitted.angles, np.nan) * DEG - motions.angles_deg.T)
    before = np.where(batch.counted, rows[:, batch.rows], np.nan)
    everyone = np.array([person[name] for name in batch.subjects])
    parts = folds(motions, batch)
    found = held_out(data, len(batch.subjects), parts)
    unseen, base = {}, {"": by_bone(_of_subjects(before), everyone)}
    for kind in (MOTION, POSTURES):
        chosen = [k for k, part in enumerate(parts) if part.kind == kind]
        if chosen:
            of_folds = np.array([_mean(found.unseen_deg[:, parts[k].tested, k]) for k in chosen])
            of_base = np.array([_mean(before[:, parts[k].tested, parts[k].subject]) for k in chosen])
            persons = everyone[[parts[k].subject for k in chosen]]
            unseen[kind], base[kind] = by_bone(of_folds, persons), by_bone(of_base, persons)
    return AdaptedGaps(batch, adapted, by_bone(_of_subjects(after), everyone), unseen, base)


def _repeated(model: ParameterSet, count: int):
    return jax.tree.map(lambda x: np.repeat(np.asarray(x)[..., None], count, axis=-1), model.girdle)


def _of_subjects(gaps: Float[np.ndarray, "6 postures subjects"]) -> Float[np.ndarray, "subjects 6"]:
    return np.array([_mean(gaps[..., s]) for s in range(gaps.shape[-1])])


def _mean(gaps: Float[np.ndarray, "6 postures"]) -> Float[np.ndarray, "6"]:
    """Average the postures that are known."""
    known = np.isfinite(gaps)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, gaps, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
