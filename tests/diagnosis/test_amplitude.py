"""Amplitudes over what may act beside an effect: moments of a mixture, by hand."""

from dataclasses import replace

import numpy as np
import pytest
from test_discrepancy import observed
from test_linear_evidence import linear_of

from adapt.diagnosis.fit.linear_evidence import posterior
from adapt.diagnosis.fit.linear_model import LinearisedFit, shared_prior
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.ranking import Ranking
from adapt.diagnosis.result import ChannelAmplitude
from models.effects import EFFECTS

SAME = 1e-12
"""Relative: a few sums."""

OFF_THE_MODEL = 0.1
"""Of the size, beside what the data leave open: people are not quite as an effect says."""

NAME, ONE, OTHER = "clavicle_length", "scapula_size", "thorax_asymmetry"
LIST = tuple(
    replace(EFFECTS[name], channels=("size",), prior=replace(EFFECTS[name].prior, scale=(8.0,)), details=0)
    for name in (NAME, ONE, OTHER)
)
"""Effects of one constant channel each, in the order of the list."""


def fitted(seed: int, *hypothesis: str) -> LinearisedFit:
    return replace(linear_of(seed, amplitudes=len(hypothesis)), hypothesis=hypothesis)


def ranking(*each: LinearisedFit, less: float = 0.0, independent_log_odds: float = -1.0) -> Ranking:
    """The first is the best, the others are ``less`` nats less probable."""
    log = np.array([0.0] + [-less] * (len(each) - 1))
    return Ranking(each, log, np.full(len(each), independent_log_odds), 0.0, 1.0, 1.0, 0.0, 0.0)


def amplitude_of(weighed: Ranking, together: int) -> ChannelAmplitude:
    (found,) = amplitudes(weighed, LIST, observed(), [NAME], together)[NAME].channels
    return found


def mean_and_variance(one: LinearisedFit) -> tuple[float, float]:
    found = posterior(one, shared_prior(one.scale))
    return float(found.a[:, 0].mean()), float(found.mean_covariance[0, 0])


def half_interval(variance, size: float):
    return 1.96 * np.sqrt(variance + (OFF_THE_MODEL * size) ** 2)


def test_alone_it_is_that_of_the_effect_alone_whatever_pairs_say():
    alone, pair = fitted(0, NAME), fitted(1, NAME, ONE)
    mean, variance = mean_and_variance(alone)
    half = half_interval(variance, mean)
    found = amplitude_of(ranking(pair, alone), together=1)
    np.testing.assert_allclose([found.value, found.low, found.high], [mean, mean - half, mean + half], rtol=SAME)


def test_two_pairs_alike_probable_give_the_mean_and_an_interval_over_both():
    pairs = [fitted(1, NAME, ONE), fitted(2, NAME, OTHER)]
    (m1, v1), (m2, v2) = (mean_and_variance(one) for one in pairs)
    mean = (m1 + m2) / 2.0
    half = half_interval((v1 + v2) / 2.0 + (m1 - m2) ** 2 / 4.0, mean)
    found = amplitude_of(ranking(*pairs, fitted(3, ONE, OTHER)), together=2)
    np.testing.assert_allclose([found.value, found.low, found.high], [mean, mean - half, mean + half], rtol=SAME)


def test_more_data_do_not_lessen_what_the_model_is_wrong_by():
    """Residuals without noise but for a millionth: what is left of the interval is the model's share of the size."""
    sure = fitted(5, NAME).with_noise(1e-6)
    found = amplitude_of(ranking(sure), together=1)
    assert (found.high - found.low) / 2.0 == pytest.approx(1.96 * OFF_THE_MODEL * abs(found.value), rel=1e-3)


@pytest.mark.parametrize("less", [40.0, np.log(3.0)])
def test_each_counts_as_much_as_it_is_probable(less):
    pairs = [fitted(1, NAME, ONE), fitted(2, NAME, OTHER)]
    (m1, _), (m2, _) = (mean_and_variance(one) for one in pairs)
    expected = m1 if less == 40.0 else 0.75 * m1 + 0.25 * m2
    assert amplitude_of(ranking(*pairs, less=less), together=2).value == pytest.approx(expected, rel=SAME)


def test_details_are_allowed_for_and_not_told():
    """A tilted thorax whose centre may have moved: of four amplitudes three are told, as all four give them."""
    tilt = EFFECTS["thorax_tilt"]
    one = replace(linear_of(4, amplitudes=4), hypothesis=("thorax_tilt",), scale=np.asarray(tilt.prior.scale))
    expected = posterior(one, shared_prior(one.scale))
    found = amplitudes(ranking(one), [tilt], observed(), ["thorax_tilt"], together=1)["thorax_tilt"].channels
    assert tuple(channel.channel for channel in found) == tilt.channels[:3]
    mean = expected.a[:, :3].mean(axis=0)
    np.testing.assert_allclose([channel.value for channel in found], mean, rtol=SAME)
    half = half_interval(np.diagonal(expected.mean_covariance)[:3], float(np.linalg.norm(mean)))
    np.testing.assert_allclose([channel.high - channel.value for channel in found], half, rtol=SAME)
