"""How large the effects of a verdict are: their mean over the subjects, whatever acts beside them."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_evidence import Spread, independent_prior, posterior, shared_prior
from adapt.diagnosis.fit.misfit import spans_of
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.departures import with_departures
from adapt.diagnosis.inference.ranking import Ranking
from models.effects import Effect

_INTERVAL = 1.96
"""Standard deviations of a 95 % interval."""

_OFF_THE_MODEL = 0.1
"""SD of what is wrong with an amplitude because people are not quite as the effect says (courses, joints between which
the bones give way), as a share of the effect's size: more data do not lessen it. Fitted on simulated subjects of other
seeds than those reported."""


@dataclass(frozen=True)
class Amplitude:
    """One channel of an effect: its mean over the subjects, with a 95 % interval; with elevation, at the highest."""

    channel: str
    value: float
    low: float
    high: float


def amplitudes(
    ranking: Ranking, effects: Sequence[Effect], data: Observed, named: Sequence[str], together: int
) -> dict[str, tuple[Amplitude, ...]]:
    """Of each effect named, over the hypotheses of ``together`` effects that have it, as probable as they are.

    With weights w_k, means m_k and variances v_k of these: m = sum w_k m_k and v = sum w_k (v_k + (m_k - m)^2). Where
    it is not known what acts beside an effect, its interval says so; to v comes (``_OFF_THE_MODEL`` |m|)^2, |m| the
    length of the vector of all channels told. The departures of its course (nothing at 150 degrees) and its details are
    allowed for, and not told.
    """
    elevation_deg = data.highest_deg
    by_name = {effect.name: effect for effect in effects}
    found = {}
    for name in named:
        chosen = [k for k, h in enumerate(ranking.hypotheses) if len(h) == together and name in h]
        weight = np.exp(ranking.log_evidence[chosen] - ranking.log_evidence[chosen].max())
        each = [_strength(ranking, k, by_name, name, data, elevation_deg) for k in chosen]
        means, variances = (np.array(part) for part in zip(*each, strict=True))
        told = by_name[name].directions
        mean = np.average(means, axis=0, weights=weight)
        variance = np.average(variances + (means - mean) ** 2, axis=0, weights=weight)
        half = _INTERVAL * np.sqrt(variance + (_OFF_THE_MODEL * np.linalg.norm(mean[: len(told)])) ** 2)
        found[name] = tuple(
            Amplitude(channel, float(v), float(v - h), float(v + h))
            for channel, v, h in zip(told, mean, half, strict=False)
        )
    return found


def _strength(
    ranking: Ranking, k: int, by_name: dict[str, Effect], name: str, data: Observed, elevation_deg: float
) -> tuple[Float[np.ndarray, " channels"], Float[np.ndarray, " channels"]]:
    """Mean and variance of each channel of one effect in one hypothesis, at one elevation."""
    spread: Spread = independent_prior if ranking.independent_prior[k] > 0.0 else shared_prior
    hypothesis = ranking.hypotheses[k]
    active_effects = [by_name[one] for one in hypothesis]
    fitted = with_departures(ranking.fitted[k], active_effects, data)
    mean = posterior(fitted, spread(fitted.scale))
    effect, part = by_name[name], spans_of(active_effects)[hypothesis.index(name)]
    # The strengths at one elevation are linear in the amplitudes.
    L = np.asarray(effect.at(jnp.eye(effect.amplitudes), jnp.full(effect.amplitudes, elevation_deg)))
    return L @ mean.a[:, part].mean(axis=0), np.diagonal(L @ mean.mean_covariance[part, part] @ L.T)
