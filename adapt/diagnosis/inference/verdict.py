"""From evidence to an answer: none, an effect (or a set that cannot be distinguished), or unknown.

Probabilities are those of the evidence, tempered, among none and the effects; and of 'unknown', a logistic function of
two absolute tests of what the best hypothesis leaves, and of what makes it hard to believe. The constants were fitted
on simulated subjects, as ``scripts/blind_check.py --calibrate`` fits them, and are frozen; no figure reported of
them is from these subjects.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_model import Hypothesis
from adapt.diagnosis.inference.ranking import Ranking
from adapt.diagnosis.result import EFFECT, NONE, UNKNOWN, Answer, Verdict

_TEMPERATURE = 1.0
"""Divides log evidence: 1 takes it at its word, more allows for evidence that is too sure of itself."""

_NONE_PRIOR = 0.35
"""Prior probability of no effect; single effects share the rest."""

_DECLARED_SHARE = 0.5
"""Of what the single effects share, for those that the motion file says of itself: as much as for all others."""

_PAIR_PRIOR = 0.02
"""Prior probability, beside those, that two effects act together, shared equally by the pairs tried."""

_UNKNOWN_TERMS = (-0.7, 0.4, 0.85)
"""Constant, weight of the discrepancy gain (nats) and of the excess (standard deviations) in its log odds."""

_UNKNOWN_PENALTIES = (1.7, 1.5)
"""Added to those log odds as far as pairs are the answer, as two effects of the list mimic more than one does; and for
each standard deviation that an effect of the best hypothesis is larger than such effects are.

The five are between the fit to our own calibration worlds and that to these and two other authors' together, whose
outside effects show less: as likely as the former in our own worlds, nearly as likely as the latter in all."""

_MOST_GAIN, _MOST_EXCESS, _MOST_AMPLITUDE_EXCESS = 10.0, 5.0, 5.0
"""Beyond these a test is no surer."""

UNKNOWN_FROM = 0.33
"""Probability of unknown from which it is the answer: a wrong name costs more than no name."""

NONE_FROM = 0.1
"""Probability of none, against the effects, from which it is the answer: only less than 1 in 10 is beyond noise. Of 200
simulated worlds without effect it was below that by chance in 3, below 1 in 20 in 2, below 1 in 3 in about 8 %."""

_PART_GAIN = 10.0
"""Log evidence over none from which an effect that is not enough is named as part of an unknown cause."""

_SET_PROBABILITY = 0.95
"""What the reported set holds of the probability of all effects, at least; mostly more, as a name comes in whole."""


def judge(ranking: Ranking, names: Sequence[str], declared: Sequence[str] = ()) -> Verdict:
    """Judge a ranking of none, every effect of ``names`` and perhaps pairs of them.

    ``declared`` are those of the names that the motions are marked with.
    """
    posterior = posterior_probabilities(ranking.hypotheses, ranking.log_evidence, names, declared)
    unknown = _unknown(ranking, posterior)
    probability = dict.fromkeys([*names, NONE], 0.0)
    pairs: dict[str, float] = {}
    for hypothesis, p in zip(ranking.hypotheses, posterior, strict=True):
        for name in hypothesis or (NONE,):
            probability[name] += float((1.0 - unknown) * p / max(len(hypothesis), 1))
        if len(hypothesis) > 1:
            pairs["+".join(hypothesis)] = float((1.0 - unknown) * p)
    answer, effects, together = _answer(ranking, posterior, unknown)
    return Verdict(answer, effects, together, {**probability, UNKNOWN: unknown}, pairs)


def _unknown(ranking: Ranking, posterior: Float[np.ndarray, " hypotheses"]) -> float:
    """Logistic in the two tests and in ``unknown_penalties``."""
    constant, *weights = _UNKNOWN_TERMS
    tests = clipped_tests(ranking.discrepancy_gain, ranking.excess)
    log_odds = constant + float(
        np.dot(weights, tests) + np.dot(_UNKNOWN_PENALTIES, unknown_penalties(ranking, posterior))
    )
    return 1.0 / (1.0 + math.exp(-log_odds))


def clipped_tests(discrepancy_gain: float, excess: float) -> tuple[float, float]:
    """Clip the discrepancy gain (nats) and the excess of chi square (standard deviations) to where they count."""
    return (
        float(np.clip(discrepancy_gain, -_MOST_GAIN, _MOST_GAIN)),
        float(np.clip(excess, -_MOST_EXCESS, _MOST_EXCESS)),
    )


def unknown_penalties(ranking: Ranking, posterior: Float[np.ndarray, " hypotheses"]) -> tuple[float, float]:
    """Measure the share of pairs in the answer, and the amplitude excess: with both, the best hypothesis has to leave
    less."""
    of_pairs = sum(float(p) for hypothesis, p in zip(ranking.hypotheses, posterior, strict=True) if len(hypothesis) > 1)
    return of_pairs, min(ranking.amplitude_excess, _MOST_AMPLITUDE_EXCESS)


def _single_priors(names: Sequence[str], declared: Sequence[str]) -> dict[Hypothesis, float]:
    """Of none and of every effect alone."""
    some = [name for name in declared if name in names]
    whole = 1.0 - _NONE_PRIOR
    priors: dict[Hypothesis, float] = {(name,): whole / len(names) for name in names}
    if 0 < len(some) < len(names):
        rest = whole * (1.0 - _DECLARED_SHARE) / (len(names) - len(some))
        priors = {(name,): whole * _DECLARED_SHARE / len(some) if name in some else rest for name in names}
    return {(): _NONE_PRIOR, **priors}


def posterior_probabilities(
    hypotheses: Sequence[Hypothesis],
    log_evidence: Float[np.ndarray, " hypotheses *draws"],
    names: Sequence[str],
    declared: Sequence[str] = (),
) -> Float[np.ndarray, " hypotheses *draws"]:
    """Compute tempered posterior probabilities among none, effects and pairs; of one data set or many draws."""
    single = _single_priors(names, declared)
    pairs = sum(len(hypothesis) == 2 for hypothesis in hypotheses)
    priors = np.array([single.get(hypothesis, _PAIR_PRIOR / max(pairs, 1)) for hypothesis in hypotheses])
    log = log_evidence / _TEMPERATURE + np.log(priors).reshape(-1, *(1,) * (log_evidence.ndim - 1))
    weight = np.exp(log - log.max(axis=0))
    return weight / weight.sum(axis=0)


def _answer(ranking: Ranking, posterior, unknown: float) -> tuple[Answer, tuple[str, ...], bool]:
    order = np.argsort(-posterior, kind="stable")
    none = ranking.hypotheses.index(())
    best = next(ranking.hypotheses[k] for k in order if k != none)
    if unknown >= UNKNOWN_FROM:
        gain = ranking.log_evidence[ranking.hypotheses.index(best)] - ranking.log_evidence[none]
        partly = best if gain > _PART_GAIN else ()
        return UNKNOWN, partly, len(partly) > 1
    if posterior[none] >= NONE_FROM:
        return NONE, (), False
    as_many = [(ranking.hypotheses[k], posterior[k]) for k in order if len(ranking.hypotheses[k]) == len(best)]
    names = dict.fromkeys(name for hypothesis in _credible(as_many) for name in hypothesis)
    return EFFECT, tuple(names), len(best) > 1


def _credible(probabilities: Sequence[tuple[Hypothesis, float]]) -> list[Hypothesis]:
    """The fewest of these hypotheses, most probable first, that hold ``_SET_PROBABILITY`` of what all hold."""
    total, chosen, held = sum(probability for _, probability in probabilities), [], 0.0
    for hypothesis, probability in probabilities:
        chosen.append(hypothesis)
        held += probability
        if held >= _SET_PROBABILITY * total:
            break
    return chosen
