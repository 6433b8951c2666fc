"""All hypotheses weighed on the same data: their evidence, and whether the best one leaves something systematic."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_evidence import inner_products
from adapt.diagnosis.fit.linear_model import Hypothesis, LinearisedFit, independent_prior, shared_prior
from adapt.diagnosis.fit.measurement_noise import NoiseEstimate
from adapt.diagnosis.fit.misfit import spans_of
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.axial_turn import mean_subject, with_mean_subject
from adapt.diagnosis.inference.departures import departures_per_channel, with_departures
from adapt.diagnosis.inference.discrepancy import discrepancy_gain
from adapt.diagnosis.inference.priors import likeliest_prior, likely_spreads, over_priors
from adapt.engine.batching import in_threads
from models.effects import Effect

_EXAMINED = 3
"""So many of the best hypotheses, and none, are examined for what they leave."""


@dataclass(frozen=True)
class Ranking:
    """Hypotheses, most probable first."""

    fitted: tuple[LinearisedFit, ...]
    log_evidence: Float[np.ndarray, " hypotheses"]
    """Less that of the best."""
    independent_log_odds: Float[np.ndarray, " hypotheses"]
    """Log evidence that amplitudes differ between subjects, less that they are shared."""
    discrepancy_gain: float
    """log evidence of the best hypothesis with an unlisted discrepancy, less that of the best without."""
    chi_square: float
    freedom: float
    """Of the best hypothesis."""
    excess: float
    """log(chi_square / freedom) in standard deviations, that of the noise estimate included: a ratio of variances from
    few degrees of freedom is skewed, its logarithm is not."""
    amplitude_excess: float
    """How far the amplitudes of an effect of the best hypothesis lie beyond their prior, likewise: log of the mean
    square amplitude, in prior SDs, in standard deviations; 0 if within. What is not in the list is fitted by effects
    larger than there are."""

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Names of the effects of each."""
        return tuple(one.hypothesis for one in self.fitted)


@dataclass(frozen=True)
class _Weighed:
    """A hypothesis with its evidence over all priors."""

    fitted: LinearisedFit
    """With the spread of the adapted parameters that the data choose."""
    wider: LinearisedFit
    """The same with what its amplitudes may depart by."""
    log_evidence: float
    independent_log_odds: float


def rank(fitted: Sequence[LinearisedFit], effects: Sequence[Effect], data: Observed, noise: NoiseEstimate) -> Ranking:
    """Weigh fitted hypotheses; examine the best for what they leave."""
    by_name = {effect.name: effect for effect in effects}
    departures = departures_per_channel(data)
    weighed = in_threads(
        lambda one: _weighed(one, [by_name[name] for name in one.hypothesis], data, noise, departures), fitted
    )
    weighed.sort(key=lambda one: -one.log_evidence)
    best = weighed[0].log_evidence
    examined = [one for k, one in enumerate(weighed) if k < _EXAMINED or not one.fitted.hypothesis]
    gains = in_threads(lambda one: discrepancy_gain(one.wider, data, likeliest_prior(one.wider), noise), examined)
    gain = max(one.log_evidence - best + more for one, more in zip(examined, gains, strict=True))
    top = weighed[0].fitted
    chi_square, freedom = float((top.y**2).sum()), _freedom(top, data)
    return Ranking(
        fitted=tuple(one.fitted for one in weighed),
        log_evidence=np.array([one.log_evidence - best for one in weighed]),
        independent_log_odds=np.array([one.independent_log_odds for one in weighed]),
        discrepancy_gain=gain,
        chi_square=chi_square,
        freedom=freedom,
        excess=math.log(chi_square / freedom) / math.sqrt(2.0 / freedom + 2.0 / noise.freedom),
        amplitude_excess=amplitude_excess(top, [by_name[name] for name in top.hypothesis]),
    )


def _weighed(
    fitted: LinearisedFit, effects: Sequence[Effect], data: Observed, noise: NoiseEstimate, departures: int
) -> _Weighed:
    wider = with_departures(fitted, effects, data)
    products = inner_products(wider)
    spreads, log_fraction = likely_spreads(products, wider.a)
    products = with_mean_subject(products, mean_subject(effects, data))
    found = over_priors(products, wider.scale, effects, noise.likely_factors, spreads, departures)
    fitted, wider = (one.with_spread(found.spread) for one in (fitted, wider))
    return _Weighed(fitted, wider, float(found.log_evidence) - log_fraction, float(found.independent_log_odds))


def amplitude_excess(fitted: LinearisedFit, effects: Sequence[Effect]) -> float:
    """Measure how much larger an effect is than such effects are: the most of ``effects``, the hypothesis's own.

    It is the log of the mean square of its amplitudes, in prior SDs (at least 1), over
    (2 / amplitudes)^1/2: about the SD of the log of a mean square.
    """
    square = ((fitted.a / independent_prior(fitted.scale).between) ** 2).mean(axis=0)
    each = (square[own] for own in spans_of(effects))
    return max((math.log(max(float(one.mean()), 1.0)) / math.sqrt(2.0 / len(one)) for one in each), default=0.0)


def _freedom(fitted: LinearisedFit, data: Observed) -> float:
    """Expected chi square of y if the hypothesis is right: tr (1 + X X' + A b^2 A')^-1, less the common amplitudes."""
    A = fitted.A * shared_prior(fitted.scale).between
    covariance = np.eye(fitted.y.shape[1]) + fitted.X @ np.swapaxes(fitted.X, 1, 2) + A @ np.swapaxes(A, 1, 2)
    informed = np.trace(np.linalg.inv(covariance), axis1=1, axis2=2).sum() - data.uninformative
    return max(1.0, float(informed) - len(fitted.scale))
