"""Gaps of ``girdle adapt`` and ``girdle adapt --effect``, with the same fits, bounds and held-out folds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.inference.intervals import by_bone, known_mean
from adapt.diagnosis.result import BoneGaps
from adapt.evaluation.held_out import AdaptedSubjects, gaps_deg
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.rows import PostureRows
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import MOTION, POSTURES, Fold
from models.effects import AnyGirdle
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class AdaptedGaps:
    """Gaps after the adaptations of one model, with known effects or without: mean |simulated - measured|, degrees."""

    rows: PostureRows
    chain: AnyGirdle
    """Adapted girdles of all subjects with the effects active: (component, postures, subjects)."""
    adapted: Adapted
    in_sample: BoneGaps
    """Means over the postures of each subject, then over subjects, as in summary.csv."""
    held_out: Mapping[str, BoneGaps]
    """Means of the rows of heldout.csv, by the kind of fold: MOTION (where there are several) or POSTURES."""
    found: AdaptedSubjects
    """Adaptations that the gaps are from."""


@dataclass(frozen=True)
class BaseGaps:
    """Gaps of the model without adaptation."""

    in_sample: BoneGaps
    held_out: Mapping[str, BoneGaps]
    """Means over the held-out postures, by the kind of fold."""


def gaps_of(found: AdaptedSubjects, person: Mapping[str, int]) -> AdaptedGaps:
    """Average the gaps after the adaptations of one model, on all postures and on held-out postures."""
    rows, adapted, data = found.rows, found.adapted, found.data
    measured = np.where(data.measured & data.counted, data.angles, np.nan)
    after = np.abs(np.where(adapted.status == status.OK, adapted.angles, np.nan) - measured) * float(DEG)
    everyone = _persons(rows.subjects, person)
    chain = data.active_effects.on(data.girdle.with_adapted(adapted.theta_mm).over_postures())
    held_out = _of_folds(found.held_out.gaps_deg, found.held_out.folds, everyone)
    return AdaptedGaps(rows, chain, adapted, _of_subjects(list(np.moveaxis(after, -1, 0)), everyone), held_out, found)


def base_gaps(motions: Motions, before: PostureSolution, folds: Sequence[Fold], person: Mapping[str, int]) -> BaseGaps:
    """Average the gaps of the model without adaptation, on all postures and on held-out postures.

    ``before``: fits of the model to all rows of the motions.
    """
    gaps, everyone = gaps_deg(motions, before), _persons(motions.subjects, person)
    in_sample = _of_subjects([gaps[:, motions.subject == name] for name in motions.subjects], everyone)
    return BaseGaps(in_sample, _of_folds([gaps[:, fold.tested] for fold in folds], folds, everyone))


def _persons(subjects: Sequence[str], person: Mapping[str, int]) -> Int[np.ndarray, " subjects"]:
    return np.array([person[name] for name in subjects])


def _of_subjects(gaps: Sequence[Float[np.ndarray, "6 some"]], everyone) -> BoneGaps:
    return by_bone(np.array([known_mean(one) for one in gaps]), everyone)


def _of_folds(gaps: Sequence[Float[np.ndarray, "6 some"]], folds: Sequence[Fold], everyone) -> dict[str, BoneGaps]:
    """Average the gaps of all folds of each kind."""
    found = {}
    for kind in (MOTION, POSTURES):
        chosen = [k for k, fold in enumerate(folds) if fold.kind == kind]
        if chosen:
            persons = everyone[[folds[k].subject for k in chosen]]
            found[kind] = by_bone(np.array([known_mean(gaps[k]) for k in chosen]), persons)
    return found
