"""All hypotheses weighed on the same data: their evidence, and whether the best one leaves something systematic."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.discrepancy import discrepancy_gain
from adapt.diagnosis.evidence import (
    Block,
    Hypothesis,
    Linear,
    Statistics,
    alike,
    common_amplitude,
    log_evidence,
    log_sum,
    products,
    statistics,
    unlike,
)
from adapt.diagnosis.observed import NoiseEstimate, Observed
from models.effects import Effect

_SIZES = (0.5, 1.0)
"""Shares of an effect's scale that its amplitude is as likely to be of: small ones and large ones."""

_SPREADS = (0.2, 0.4, 0.7, 1.0)
"""Shares of ``THETA_SD_MM`` by which adapted parameters may vary between subjects: the data choose."""

_ABOUT_SIZE = 0.4
"""SD of the amplitude of an effect of one channel about its size, as a share of it: scales are typical values of the
effect where it is at work, not of its absence."""

_UNLIKE_SHARE = 0.05
"""Prior probability that an effect's sign differs from subject to subject."""

_AGAINST_SHARE = 0.01
"""Prior probability that an effect goes against the sign of its nature."""

_EXAMINED = 3
"""So many of the best hypotheses, and none, are examined for what they leave."""


@dataclass(frozen=True)
class Ranking:
    """Hypotheses, most probable first."""

    fitted: tuple[Linear, ...]
    log_evidence: Float[np.ndarray, " hypotheses"]
    """Less that of the best."""
    unlike: Float[np.ndarray, " hypotheses"]
    """Log evidence that amplitudes differ between subjects, less that they are alike."""
    discrepancy_gain: float
    """log evidence of the best hypothesis with an unlisted discrepancy, less that of the best without."""
    chi_square: float
    freedom: float
    """Of the best hypothesis."""
    excess: float
    """log(chi_square / freedom) in standard deviations, that of the noise estimate included: a ratio of variances from
    few degrees of freedom is skewed, its logarithm is not."""

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Names of the effects of each."""
        return tuple(one.hypothesis for one in self.fitted)


@dataclass(frozen=True)
class _Weighed:
    """A hypothesis with its evidence over all priors."""

    fitted: Linear
    """With the spread of the adapted parameters that the data choose."""
    log_evidence: float
    unlike: float


def rank(fitted: Sequence[Linear], effects: Sequence[Effect], data: Observed, noise: NoiseEstimate) -> Ranking:
    """Weigh fitted hypotheses; examine the best for what they leave."""
    by_name = {effect.name: effect for effect in effects}
    weighed = [_weighed(one, [by_name[name] for name in one.hypothesis], noise) for one in fitted]
    weighed.sort(key=lambda one: -one.log_evidence)
    best = weighed[0].log_evidence
    examined = [one for k, one in enumerate(weighed) if k < _EXAMINED or not one.fitted.hypothesis]
    gain = max(
        one.log_evidence - best + discrepancy_gain(one.fitted, data, _likeliest_prior(one.fitted), noise)
        for one in examined
    )
    top = weighed[0].fitted
    chi_square, freedom = float((top.y**2).sum()), _freedom(top, data)
    return Ranking(
        fitted=tuple(one.fitted for one in weighed),
        log_evidence=np.array([one.log_evidence - best for one in weighed]),
        unlike=np.array([one.unlike for one in weighed]),
        discrepancy_gain=gain,
        chi_square=chi_square,
        freedom=freedom,
        excess=math.log(chi_square / freedom) / math.sqrt(2.0 / freedom + 2.0 / noise.freedom),
    )


def _weighed(fitted: Linear, effects: Sequence[Effect], noise: NoiseEstimate) -> _Weighed:
    """Evidence summed over the noise there may be, the spreads of the adapted parameters, and the amplitudes' sizes,
    alike or unlike."""
    inner = products(fitted)
    alike_logs, unlike_logs = np.empty(len(_SPREADS)), np.empty(len(_SPREADS))
    for k, spread in enumerate(_SPREADS):
        at_noises = inner.over_noise(noise.likely_shares, spread)
        sized = [(of, size) for of in at_noises for size in _SIZES]
        alike_logs[k] = log_sum([_log_alike(of, fitted.scale, effects, size) for of, size in sized])
        unlike_logs[k] = log_sum([log_evidence(of, unlike(fitted.scale) * size) for of, size in sized])
    shares = np.log([1.0 - _UNLIKE_SHARE, _UNLIKE_SHARE])
    each = np.logaddexp(alike_logs + shares[0], unlike_logs + shares[1])
    spread = _SPREADS[int(np.argmax(each))]
    return _Weighed(fitted.with_spread(spread), log_sum(each), log_sum(unlike_logs) - log_sum(alike_logs))


def _log_alike(of: Statistics, scale, effects: Sequence[Effect], size: float) -> float:
    """Log evidence if the amplitudes of all subjects are alike and of one size, most of it with the expected signs."""
    prior = alike(scale) * size
    if len(effects) == 1 and len(effects[0].channels) == 1:
        return _log_about(of, prior, effects[0])
    log, common, covariance = common_amplitude(of, prior)
    signs = np.array([sign for effect in effects for sign in effect.signs])
    for k in np.flatnonzero(signs):
        agreed = _normal_cdf(signs[k] * common[k] / math.sqrt(covariance[k, k]))
        log += math.log(2.0 * ((1.0 - _AGAINST_SHARE) * agreed + _AGAINST_SHARE * (1.0 - agreed)))
    return log


def _log_about(of: Statistics, prior: Block, effect: Effect) -> float:
    """The same for one channel, whose amplitude lies about plus or minus the size."""
    logs = []
    for sign in (1.0, -1.0):
        mean, common = prior.mean.copy(), prior.common.copy()
        mean[0], common[0] = sign * common[0], _ABOUT_SIZE * common[0]
        share = 0.5 if not effect.signs[0] else 1.0 - _AGAINST_SHARE if sign == effect.signs[0] else _AGAINST_SHARE
        logs.append(math.log(share) + log_evidence(of, replace(prior, mean=mean, common=common)))
    return log_sum(logs)


def _normal_cdf(x: float) -> float:
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def _likeliest_prior(fitted: Linear) -> Block:
    """Of the priors of the amplitudes, the one with the most evidence."""
    of = statistics(fitted)
    priors = [spread(fitted.scale) * size for spread in (alike, unlike) for size in _SIZES]
    return max(priors, key=lambda prior: log_evidence(of, prior))


def _freedom(fitted: Linear, data: Observed) -> float:
    """Expected chi square of y if the hypothesis is right: tr (1 + X X' + A b^2 A')^-1, less the common amplitudes."""
    A = fitted.A * alike(fitted.scale).between
    covariance = np.eye(fitted.y.shape[1]) + fitted.X @ np.swapaxes(fitted.X, 1, 2) + A @ np.swapaxes(A, 1, 2)
    informed = np.trace(np.linalg.inv(covariance), axis1=1, axis2=2).sum() - data.uninformative
    return max(1.0, float(informed) - len(fitted.scale))
