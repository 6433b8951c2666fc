"""The gaps of `girdle adapt`, and of `girdle adapt --effect`: the same fits, bounds and held-out folds."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.inference.intervals import by_bone, known_mean
from adapt.diagnosis.result import BoneGaps
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.motion_rows import MotionRows, fit_rows
from adapt.solvers.objective import WEIGHT, down_weighted
from adapt.solvers.padded_batch import Batch, pack
from adapt.solvers.problem_batch import problem_batch
from adapt.tables.held_out import MOTION, POSTURES
from adapt.trust.held_out import Fold, folds, held_out
from models.effects import EFFECTS, AnyGirdle, Effect
from models.effects.amplitudes import NO_EFFECTS, Amplitudes, active_effects
from models.person.family import AnyModel, girdles_of
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class AdaptedGaps:
    """What the adaptations of one model leave, with known effects or without; mean |simulated - measured|, degrees."""

    batch: Batch
    chain: AnyGirdle
    """Of all subjects, adapted, with the effects at work: (component, postures, subjects)."""
    adapted: Adapted
    in_sample: BoneGaps
    """Over the postures of each subject, then over subjects: the mean of summary.csv."""
    unseen: Mapping[str, BoneGaps]
    """By what is held out, MOTION (where there are several) or POSTURES: the mean of the rows of heldout.csv."""


@dataclass(frozen=True)
class BaseGaps:
    """The same of the model as it is."""

    in_sample: BoneGaps
    unseen: Mapping[str, BoneGaps]
    """On the postures that are held out."""


def adapted_gaps(
    motions: Motions,
    model: AnyModel,
    effects: Amplitudes,
    person: Mapping[str, int],
    library: Mapping[str, Effect] = EFFECTS,
    thorax_downweighting: float = 1.0,
) -> AdaptedGaps:
    """Adapt the model to all subjects, and again without each motion and each third of the postures.

    ``person``: the number of the person of each subject, for the intervals. ``library``: the effects by name.
    ``thorax_downweighting``: see :func:`adapt.adapt_subjects`.
    """
    batch = pack(motions)
    data = problem_batch(batch, [model], active_effects(effects, motions, library).at(batch.rows))
    weight = down_weighted(WEIGHT, thorax_downweighting)
    adapted = adapt_batch(data, weight)
    measured = np.where(batch.measured & batch.counted, batch.angles, np.nan)
    after = np.abs(np.where(adapted.status == status.OK, adapted.angles, np.nan) - measured) * float(DEG)
    parts = folds(motions, batch)
    found = held_out(data, len(batch.subjects), parts, weight).unseen_deg
    of_folds = [found[:, part.tested, k] for k, part in enumerate(parts)]
    everyone = _persons(batch, person)
    chain = data.with_sizes(adapted.sizes).active_effects.on(data.girdle.with_adapted(adapted.theta_mm).over_postures())
    return AdaptedGaps(batch, chain, adapted, _of_subjects(after, everyone), _of_folds(of_folds, parts, everyone))


def base_gaps(motions: Motions, model: AnyModel, person: Mapping[str, int]) -> BaseGaps:
    """Fit every posture with the model as it is; the gaps on all postures, and on those that are held out."""
    batch = pack(motions)
    fitted = fit_rows(MotionRows.of_models(motions, 1, NO_EFFECTS, float), girdles_of(model, motions.subject.tolist()))
    rows = np.abs(np.where(fitted.status == status.OK, fitted.angles, np.nan) * DEG - motions.angles_deg.T)
    before = np.where(batch.counted, rows[:, batch.rows], np.nan)
    parts = folds(motions, batch)
    of_folds = [before[:, part.tested, part.subject] for part in parts]
    everyone = _persons(batch, person)
    return BaseGaps(_of_subjects(before, everyone), _of_folds(of_folds, parts, everyone))


def _persons(batch: Batch, person: Mapping[str, int]) -> Int[np.ndarray, " subjects"]:
    return np.array([person[name] for name in batch.subjects])


def _of_subjects(gaps: Float[np.ndarray, "6 postures subjects"], everyone) -> BoneGaps:
    return by_bone(np.array([known_mean(gaps[..., s]) for s in range(gaps.shape[-1])]), everyone)


def _of_folds(gaps: list[Float[np.ndarray, "6 some"]], parts: list[Fold], everyone) -> dict[str, BoneGaps]:
    """The gaps of all folds of each kind."""
    found = {}
    for kind in (MOTION, POSTURES):
        chosen = [k for k, part in enumerate(parts) if part.kind == kind]
        if chosen:
            persons = everyone[[parts[k].subject for k in chosen]]
            found[kind] = by_bone(np.array([known_mean(gaps[k]) for k in chosen]), persons)
    return found
