"""Resampling of persons and motions by a Bayesian bootstrap: intervals, and BayesBag.

Each draw gives every person a random weight (Rubin 1981, The Annals of Statistics 9:130-134, doi
10.1214/aos/1176345338); of three persons, sampling with replacement would mostly leave one out. A slightly wrong model,
as every model of a shoulder is, gives too high a probability to a single set of causes. So probabilities are averaged
over resampled persons (Huggins & Miller 2023, Reproducible model selection using bagged posteriors, Bayesian Analysis
18:79-104, doi 10.1214/21-BA1301).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.result import ALL, BoneGaps, Interval
from motions.table import BONES

_DRAWS, _SEED = 400, 11
_PERCENT = (2.5, 97.5)

_BAGS, _BAGS_SEED = 50, 7
"""Number of draws, which gives a probability of 0.8 to within 0.04 or better, and a seed for reproducible answers."""


def interval(values: Float[np.ndarray, " folds"], person: np.ndarray) -> Interval:
    """Average over folds, with a 95 % interval; folds without a value are left out."""
    known = np.isfinite(values)
    if not known.any():
        return Interval(np.nan, np.nan, np.nan)
    values, person = values[known], np.unique(person[known], return_inverse=True)[1]
    draws = fold_weights(person, _DRAWS, _SEED) @ values / len(values)
    low, high = np.percentile(draws, _PERCENT)
    return Interval(float(values.mean()), float(low), float(high))


def fold_weights(person: np.ndarray, draws: int, seed: int) -> Float[np.ndarray, "draws folds"]:
    """Draw random weights of the folds, per person and per fold; each draw sums to the number of folds."""
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
    """Average the known values of each row; NaN where no value is known."""
    known = np.isfinite(gaps)
    count = known.sum(axis=1)
    total = np.where(known, gaps, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def resampled_persons(
    person: Int[np.ndarray, " subjects"], as_many: float = 1.0
) -> Float[np.ndarray, "draws subjects"]:
    """Draw weights of the shoulders of each person, with mean ``as_many``, as if ``as_many`` times as many persons had
    been drawn. The weights of all persons sum to ``as_many`` times their number; a single person has weight 1."""
    persons = int(person.max()) + 1
    as_many = as_many if persons > 1 else 1.0
    weights = np.random.default_rng(_BAGS_SEED).dirichlet(np.full(persons, as_many), _BAGS)
    return as_many * persons * weights[:, person]
