"""Intervals over persons and motions that might have been measured, by a Bayesian bootstrap."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.result import ALL, BoneGaps, Interval
from motions.table import BONES

_DRAWS, _SEED = 400, 11
_PERCENT = (2.5, 97.5)


def interval(values: Float[np.ndarray, " folds"], person: np.ndarray) -> Interval:
    """Average over folds, with a 95 % interval; unknown folds are left out."""
    known = np.isfinite(values)
    if not known.any():
        return Interval(np.nan, np.nan, np.nan)
    values, person = values[known], np.unique(person[known], return_inverse=True)[1]
    draws = fold_weights(person, _DRAWS, _SEED) @ values / len(values)
    low, high = np.percentile(draws, _PERCENT)
    return Interval(float(values.mean()), float(low), float(high))


def fold_weights(person: np.ndarray, draws: int, seed: int) -> Float[np.ndarray, "draws folds"]:
    """Draw weights of the folds, those of one person together and each on its own; each draw sums to their number."""
    generator = np.random.default_rng(seed)
    count, persons = len(person), int(person.max()) + 1
    weights = generator.dirichlet(np.ones(count), draws)
    if persons > 1:
        weights = weights * generator.dirichlet(np.ones(persons), draws)[:, person]
    return weights / weights.sum(axis=1, keepdims=True) * count


def by_bone(gaps: Float[np.ndarray, "folds 6"], person: Sequence[int] | np.ndarray) -> BoneGaps:
    """Average the angles of each bone, then the folds."""
    parts = {ALL: slice(None), **BONES}
    with np.errstate(invalid="ignore"):
        return {bone: interval(known_mean(gaps[:, part]), np.asarray(person)) for bone, part in parts.items()}


def known_mean(gaps: Float[np.ndarray, "n some"]) -> Float[np.ndarray, " n"]:
    """Average what is known of each row; NaN where nothing is."""
    known = np.isfinite(gaps)
    count = known.sum(axis=1)
    total = np.where(known, gaps, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
