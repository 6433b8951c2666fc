"""The gaps of `girdle adapt`, and of `girdle adapt --effect`: the same fits, bounds and held-out folds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.inference.intervals import by_bone, known_mean
from adapt.diagnosis.result import BoneGaps
from adapt.evaluation.held_out import AdaptedSubjects, adapt_with_folds, gaps_deg
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.objective import WEIGHT, down_weighted
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import MOTION, POSTURES, Fold, motions_and_thirds
from models.effects import EFFECTS, AnyGirdle, Effect
from models.effects.amplitudes import Amplitudes
from models.person.family import AnyModel
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class AdaptedGaps:
    """What the adaptations of one model leave, with known effects or without; mean |simulated - measured|, degrees."""

    rows: PostureRows
    chain: AnyGirdle
    """Of all subjects, adapted, with the effects at work: (component, postures, subjects)."""
    adapted: Adapted
    in_sample: BoneGaps
    """Over the postures of each subject, then over subjects: the mean of summary.csv."""
    unseen: Mapping[str, BoneGaps]
    """By what is held out, MOTION (where there are several) or POSTURES: the mean of the rows of heldout.csv."""
    found: AdaptedSubjects
    """The adaptations themselves."""


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
    folds, weight = motions_and_thirds(motions), down_weighted(WEIGHT, thorax_downweighting)
    return gaps_of(adapt_with_folds(posture_rows(motions, effects, library), [model], folds, weight), person)


def gaps_of(found: AdaptedSubjects, person: Mapping[str, int]) -> AdaptedGaps:
    """Average the gaps that the adaptations of one model leave, on all postures and on those that are held out."""
    rows, adapted, data = found.rows, found.adapted, found.data
    measured = np.where(data.measured & data.counted, data.angles, np.nan)
    after = np.abs(np.where(adapted.status == status.OK, adapted.angles, np.nan) - measured) * float(DEG)
    everyone = _persons(rows.subjects, person)
    chain = data.active_effects.on(data.girdle.with_adapted(adapted.theta_mm).over_postures())
    unseen = _of_folds(found.held_out.unseen_deg, found.held_out.folds, everyone)
    return AdaptedGaps(rows, chain, adapted, _of_subjects(list(np.moveaxis(after, -1, 0)), everyone), unseen, found)


def base_gaps(motions: Motions, before: PostureSolution, folds: Sequence[Fold], person: Mapping[str, int]) -> BaseGaps:
    """Average the gaps of the model as it is, on all postures and on those that are held out.

    ``before``: its fits of all rows of the motions.
    """
    gaps, everyone = gaps_deg(motions, before), _persons(motions.subjects, person)
    in_sample = _of_subjects([gaps[:, motions.subject == name] for name in motions.subjects], everyone)
    return BaseGaps(in_sample, _of_folds([gaps[:, fold.tested] for fold in folds], folds, everyone))


def _persons(subjects: Sequence[str], person: Mapping[str, int]) -> Int[np.ndarray, " subjects"]:
    return np.array([person[name] for name in subjects])


def _of_subjects(gaps: Sequence[Float[np.ndarray, "6 some"]], everyone) -> BoneGaps:
    return by_bone(np.array([known_mean(one) for one in gaps]), everyone)


def _of_folds(gaps: Sequence[Float[np.ndarray, "6 some"]], folds: Sequence[Fold], everyone) -> dict[str, BoneGaps]:
    """The gaps of all folds of each kind."""
    found = {}
    for kind in (MOTION, POSTURES):
        chosen = [k for k, fold in enumerate(folds) if fold.kind == kind]
        if chosen:
            persons = everyone[[folds[k].subject for k in chosen]]
            found[kind] = by_bone(np.array([known_mean(gaps[k]) for k in chosen]), persons)
    return found
