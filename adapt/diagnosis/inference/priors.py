"""Evidence over all that may be so beforehand: spreads of parameters, sizes, signs, likeness of subjects, noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.linear_evidence import (
    AmplitudeStatistics,
    InnerProducts,
    agreeing_signs,
    amplitude_statistics,
    common_amplitude,
    log_evidence,
    log_sum,
)
from adapt.diagnosis.fit.linear_model import (
    AmplitudePrior,
    LinearisedFit,
    common_shift,
    independent_prior,
    shared_prior,
)
from adapt.diagnosis.inference.one_course import one_course
from models.adapted_parameters import PRIOR_SD_MM, SPREADS_MM
from models.effects import Effect

_SIZES = (0.5, 1.0)
"""Shares of an effect's scale that its amplitude is as likely to be of: small ones and large ones."""

_SPREADS = np.array(list(product(*SPREADS_MM))) / PRIOR_SD_MM

_LIKELIEST = 8
"""So many are weighed with all else; the others are allowed for by their weight with the amplitudes as fitted."""

_ABOUT_SIZE = 0.4
"""SD of the amplitude of the channel that leads about the effect's size, as a share of it: scales are typical values of
the effect where it is at work, not of its absence."""

_SHIFT_PROBABILITY, SHIFT = 0.1, 0.5
"""Prior probability that the people measured differ from the parameter set on average, not only from each other; and by
which share of ``PRIOR_SD_MM``."""

_OPPOSED_PROBABILITY, _OPPOSED_SIGNED_PROBABILITY = 0.05, 0.015
"""Prior probability that an effect's sign differs from subject to subject, all else being shared; and that of an effect
whose nature has a sign: of 0.05, 0.025, 0.015 and 0.005 the best log score on calibration seeds."""

_INDEPENDENT_PROBABILITY, _INDEPENDENT_SIGNED_PROBABILITY = 0.02, 0.002
"""The same for amplitudes that each subject has for itself, of either sign."""

_TOGETHER_PROBABILITY = 0.8
"""Prior probability, amplitudes being shared by all subjects, that the channels of an effect follow one course."""

_AGAINST_PROBABILITY = 0.01
"""Prior probability that an effect goes against the sign of its nature."""

_erfc = np.vectorize(math.erfc, otypes=[float])


@dataclass(frozen=True)
class OverPriors:
    """The evidence of a hypothesis, of one data set or of many draws."""

    log_evidence: Float[np.ndarray, "*draws"]
    independent_log_odds: Float[np.ndarray, "*draws"]
    """Log odds that amplitudes differ between subjects, in sign or in all."""
    by_spread: Float[np.ndarray, " spreads *draws"]
    """Log evidence with each of ``spreads``."""
    spreads: Float[np.ndarray, "spreads 6"]

    @property
    def spread(self) -> Float[np.ndarray, " 6"]:
        """Of one data set, the spreads of the adapted parameters that it chooses."""
        return self.spreads[int(np.argmax(self.by_spread))]


def over_priors(
    products: InnerProducts,
    scale: Float[np.ndarray, " amplitudes"],
    effects: Sequence[Effect],
    noise_factors: Sequence[tuple[float, float]],
    spreads: Float[np.ndarray, "spreads 6"],
    departures: int = 0,
) -> OverPriors:
    """Sum the evidence over the noise there may be, the spreads of the adapted parameters and what they have in common,
    and the amplitudes' sizes, shared by the subjects or each one's own. ``scale`` and ``effects`` are the hypothesis's
    own, with so many columns for ``departures`` of each channel behind the amplitudes."""
    sign = agreeing_signs(products.at(), shared_prior(scale))
    unsigned = [replace(effect, prior=replace(effect.prior, sign=())) for effect in effects]
    priors = [shared_prior(scale) * size for size in _SIZES]
    unshifted, shifted = (one.over(noise_factors, spreads) for one in (products, products.with_shift()))
    opposed = unshifted.with_signs(sign)
    signed = any(any(effect.prior.sign) for effect in effects)
    opposed_probability = _OPPOSED_SIGNED_PROBABILITY if signed else _OPPOSED_PROBABILITY
    independent_probability = _INDEPENDENT_SIGNED_PROBABILITY if signed else _INDEPENDENT_PROBABILITY
    shared_log = _mixed(
        (1.0 - _SHIFT_PROBABILITY, [_log_shared(unshifted, prior, effects, departures) for prior in priors]),
        (
            _SHIFT_PROBABILITY,
            [_log_shared(shifted, prior + common_shift(SHIFT), effects, departures) for prior in priors],
        ),
    )
    independent_log = _mixed(
        (
            opposed_probability * 0.5 ** (sign.shape[-1] - 1),
            [_log_shared(opposed, p, unsigned, departures) for p in priors],
        ),
        (independent_probability, [log_evidence(unshifted, independent_prior(prior.common)) for prior in priors]),
    )
    shared_probability = 1.0 - opposed_probability - independent_probability
    each = np.logaddexp(shared_log + math.log(shared_probability), independent_log)
    log_odds = log_sum(independent_log) - log_sum(shared_log) - math.log(shared_probability)
    return OverPriors(log_sum(each), log_odds, each, spreads)


def likely_spreads(
    products: InnerProducts, amplitudes: Float[np.ndarray, "subjects amplitudes"]
) -> tuple[Float[np.ndarray, "likeliest 6"], float]:
    """Find the spreads with most evidence for these amplitudes, and the log of their share of the evidence of all."""
    log = products.given_amplitudes(amplitudes).at(spread=_SPREADS).log
    chosen = np.sort(np.argsort(-log, kind="stable")[:_LIKELIEST])
    return _SPREADS[chosen], float(log_sum(log[chosen]) - log_sum(log))


def _mixed(*parts: tuple[float, list]) -> Float[np.ndarray, " spreads *draws"]:
    """Log evidence of what is so with these probabilities, each with a sum over sizes and, along the second axis,
    noises."""
    return log_sum([math.log(probability) + log_sum(log_sum(logs), axis=1) for probability, logs in parts])


def likeliest_prior(fitted: LinearisedFit) -> AmplitudePrior:
    """Choose, of the priors of the amplitudes, the one with the most evidence."""
    statistics = amplitude_statistics(fitted)
    priors = [spread(fitted.scale) * size for spread in (shared_prior, independent_prior) for size in _SIZES]
    return max(priors, key=lambda prior: float(log_evidence(statistics, prior)))


def _log_shared(statistics: AmplitudeStatistics, prior: AmplitudePrior, effects: Sequence[Effect], departures: int):
    """Log evidence if all subjects share the amplitudes, of one size, most of it with the expected signs, and the
    channels of each effect go together or not."""
    if len(effects) == 1 and (leading := effects[0].leading) is not None:
        return _log_about_size(statistics, prior, effects[0], leading * effects[0].terms, departures)
    expected = [sign for effect in effects for sign in effect.signs]
    return _log_together_or_not(statistics, prior, effects, expected, departures)


def _log_together_or_not(
    statistics: AmplitudeStatistics,
    prior: AmplitudePrior,
    effects: Sequence[Effect],
    signs: Sequence[int],
    departures: int,
):
    """The same for one prior of the amplitudes, of which so many first ones have these signs, expected or 0."""
    expected = np.zeros(len(prior.common), dtype=int)
    expected[: len(signs)] = signs
    free, common, covariance = common_amplitude(statistics, prior)
    free = free + _log_of_signs(expected, common, covariance)
    if not any(len(effect.channels) > 1 for effect in effects):
        return free
    one = one_course(statistics, prior, common, effects, departures)
    together, common, covariance = common_amplitude(one.statistics, one.prior, one.along)
    together = together + _log_of_signs(expected[one.kept], common, covariance)
    return np.logaddexp(math.log(_TOGETHER_PROBABILITY) + together, math.log(1.0 - _TOGETHER_PROBABILITY) + free)


def _log_of_signs(expected: Int[np.ndarray, " amplitudes"], common, covariance):
    """What is gained or lost by how far the common amplitudes have the expected signs, most of the prior's weight."""
    log = 0.0
    for k in np.flatnonzero(expected):
        agreed = _normal_cdf(expected[k] * common[..., k] / np.sqrt(covariance[..., k, k]))
        log = log + np.log(2.0 * ((1.0 - _AGAINST_PROBABILITY) * agreed + _AGAINST_PROBABILITY * (1.0 - agreed)))
    return log


def _log_about_size(
    statistics: AmplitudeStatistics, prior: AmplitudePrior, effect: Effect, leading: int, departures: int
):
    """The same if the amplitude of the channel that leads lies about plus or minus the size."""
    own, logs = effect.signs[leading], []
    for sign in (1.0, -1.0):
        mean, common = prior.mean.copy(), prior.common.copy()
        mean[leading], common[leading] = sign * common[leading], _ABOUT_SIZE * common[leading]
        probability = 0.5 if not own else 1.0 - _AGAINST_PROBABILITY if sign == own else _AGAINST_PROBABILITY
        about = replace(prior, mean=mean, common=common)
        logs.append(math.log(probability) + _log_together_or_not(statistics, about, [effect], (), departures))
    return log_sum(logs)


def _normal_cdf(x):
    return 0.5 * _erfc(-x / math.sqrt(2.0))
