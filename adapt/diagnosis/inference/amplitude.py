"""How large the effects of a verdict are: their mean over the subjects, whatever acts beside them."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_evidence import posterior
from adapt.diagnosis.fit.linear_model import Spread, independent_prior, shared_prior
from adapt.diagnosis.fit.misfit import spans_of
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.departures import with_departures
from adapt.diagnosis.inference.ranking import Ranking
from adapt.diagnosis.result import ChannelAmplitude, EffectAmplitude
from models.effects import Effect
from models.effects.known import as_option

_INTERVAL = 1.96
"""Standard deviations of a 95 % interval."""

_OFF_THE_MODEL = 0.1
"""SD of what is wrong with an amplitude because people are not quite as the effect says (courses, joints between which
the bones give way), as a share of the effect's size: more data do not lessen it. Fitted on simulated subjects of other
seeds than those reported."""


def amplitudes(
    ranking: Ranking, effects: Sequence[Effect], data: Observed, named: Sequence[str], together: int
) -> dict[str, EffectAmplitude]:
    """Estimate each effect named, over the hypotheses of ``together`` effects that have it, as probable as they are.

    With weights w_k, means m_k and variances v_k of these: m = sum w_k m_k and v = sum w_k (v_k + (m_k - m)^2). Where
    it is not known what acts beside an effect, its interval says so; to v comes (``_OFF_THE_MODEL`` |m|)^2, |m| the
    length of the vector of its directions. The departures of its course (nothing at 150 degrees) and its details are
    allowed for, and not reported.
    """
    elevation_deg = data.highest_deg
    by_name = {effect.name: effect for effect in effects}
    found = {}
    for name in named:
        chosen = [k for k, h in enumerate(ranking.hypotheses) if len(h) == together and name in h]
        weight = np.exp(ranking.log_evidence[chosen] - ranking.log_evidence[chosen].max())
        each = [_strength(ranking, k, by_name, name, data, elevation_deg) for k in chosen]
        means, variances = (np.array(part) for part in zip(*each, strict=True))
        directions = by_name[name].directions
        mean = np.average(means, axis=0, weights=weight)
        variance = np.average(variances + (means - mean) ** 2, axis=0, weights=weight)
        half = _INTERVAL * np.sqrt(variance + (_OFF_THE_MODEL * np.linalg.norm(mean[: len(directions)])) ** 2)
        channels = (
            ChannelAmplitude(channel, float(v), float(v - h), float(v + h))
            for channel, v, h in zip(directions, mean, half, strict=False)
        )
        found[name] = effect_amplitude(by_name[name], tuple(channels), elevation_deg)
    return found


def _strength(
    ranking: Ranking, k: int, by_name: dict[str, Effect], name: str, data: Observed, elevation_deg: float
) -> tuple[Float[np.ndarray, " channels"], Float[np.ndarray, " channels"]]:
    """Mean and variance of each channel of one effect in one hypothesis, at one elevation."""
    spread: Spread = independent_prior if ranking.independent_log_odds[k] > 0.0 else shared_prior
    hypothesis = ranking.hypotheses[k]
    active_effects = [by_name[one] for one in hypothesis]
    fitted = with_departures(ranking.fitted[k], active_effects, data)
    mean = posterior(fitted, spread(fitted.scale))
    effect, part = by_name[name], spans_of(active_effects)[hypothesis.index(name)]
    # The strengths at one elevation are linear in the amplitudes.
    L = np.asarray(effect.at(jnp.eye(effect.amplitudes), jnp.full(effect.amplitudes, elevation_deg)))
    return L @ mean.a[:, part].mean(axis=0), np.diagonal(L @ mean.mean_covariance[part, part] @ L.T)


def effect_amplitude(
    effect: Effect, channels: tuple[ChannelAmplitude, ...], highest_elevation_deg: float
) -> EffectAmplitude:
    """Say how large the effect is by its channels at the highest elevation: the only one, or the length of several."""
    value, half = _size(channels)
    return EffectAmplitude(
        what=effect.what,
        unit=effect.unit,
        value=value,
        low=value - half if len(channels) == 1 else max(0.0, value - half),
        high=value + half,
        channels=channels,
        option=as_option(effect, [one.value for one in channels], highest_elevation_deg),
    )


def _size(channels: Sequence[ChannelAmplitude]) -> tuple[float, float]:
    """The channel, or the length of several, and half its interval.

    The length's interval is by the delta method: the errors of the channels, taken as independent, along the mean. A
    mean of length 0 has no direction: then the widest channel's.
    """
    value = np.array([one.value for one in channels])
    half = np.array([(one.high - one.low) / 2.0 for one in channels])
    if len(channels) == 1:
        return float(value[0]), float(half[0])
    length = float(np.linalg.norm(value))
    return length, float(np.linalg.norm(value * half)) / length if length else float(half.max())
