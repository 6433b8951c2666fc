"""Amplitudes that go together: columns by hand, and evidence against a dense Gaussian of what they are made of."""

from typing import Any

import numpy as np
import pytest
from made_effects import without_details
from scipy.stats import multivariate_normal

from adapt.diagnosis.fit.linear_evidence import AmplitudeStatistics, common_amplitude
from adapt.diagnosis.fit.linear_model import AmplitudePrior, shared_prior
from adapt.diagnosis.inference.one_course import OneCourse, one_course
from models.effects import EFFECTS
from models.effects.prior import COURSE_SD

SAME = 1e-9
"""Relative: two ways through well-conditioned linear systems."""

_NORMAL: Any = multivariate_normal
"""Its type would have the covariance a number."""

GAP, BIAS = EFFECTS["scapulothoracic_gap"], without_details(EFFECTS["scapula_landmark_bias"])
SUBJECTS, DEPARTURES, BESIDE = 4, 2, 1
COLUMNS = 6 + 3 + 2 * DEPARTURES + BESIDE
"""TS and AI with three terms each, a bias of three channels, departures of TS and AI, one more column."""

FREE = np.array([2.0, 0.3, -0.1, -4.0, 0.2, 0.5, 3.0, -1.0, 2.0, 0.1, 0.2, 0.3, 0.4, 9.0])


def columns(seed: int = 0, count: int = COLUMNS) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((SUBJECTS, 20, count))


def statistics_of(A: np.ndarray, y: np.ndarray) -> AmplitudeStatistics:
    """Without adapted parameters."""
    log = np.asarray(-0.5 * (y**2).sum())
    return AmplitudeStatistics(log, np.swapaxes(A, 1, 2) @ A, np.einsum("src,sr->sc", A, y))


def prior() -> AmplitudePrior:
    scale = [*np.asarray(GAP.prior_sd), *np.asarray(BIAS.prior_sd), *[0.7] * 2 * DEPARTURES, 5.0]
    return shared_prior(np.array(scale))


def together(A: np.ndarray, y: np.ndarray) -> OneCourse:
    return one_course(statistics_of(A, y), prior(), FREE, [GAP, BIAS], DEPARTURES)


def test_channels_share_the_terms_and_departures_of_their_course():
    A, y = columns(), np.ones((SUBJECTS, 20))
    found = together(A, y)
    np.testing.assert_array_equal(found.kept, [0, 3, 6, 7, 8, 13])
    ts, ai = FREE[[0, 3]]
    made = [ts * A[..., one] + ai * A[..., other] for one, other in ((1, 4), (2, 5), (9, 11), (10, 12))]
    B = np.concatenate([A[..., found.kept], np.stack(made, axis=-1)], axis=-1)
    expected = statistics_of(B, y)
    np.testing.assert_allclose(found.statistics.information, expected.information, rtol=SAME, atol=SAME)
    np.testing.assert_allclose(found.statistics.gradient, expected.gradient, rtol=SAME, atol=SAME)


def test_two_effects_with_a_course_have_one_each():
    """Conoid (3 amplitudes) and gap (6), then the departures of the conoid and those of TS and of AI."""
    pair, count = [EFFECTS["conoid_strain"], GAP], 9 + 3 * DEPARTURES
    A, free, block = columns(count=count), np.arange(1.0, count + 1.0), shared_prior(np.ones(count))
    found = one_course(statistics_of(A, np.ones((SUBJECTS, 20))), block, free, pair, DEPARTURES)
    np.testing.assert_array_equal(found.kept, [0, 3, 6])
    own = [A[..., 1], A[..., 2], A[..., 9], A[..., 10]]
    others = [4.0 * A[..., k] + 7.0 * A[..., j] for k, j in ((4, 7), (5, 8), (11, 13), (12, 14))]
    B = np.stack([*np.moveaxis(A[..., found.kept], -1, 0), *own, *others], axis=-1)
    expected = statistics_of(B, np.ones((SUBJECTS, 20)))
    np.testing.assert_allclose(found.statistics.gradient, expected.gradient, rtol=SAME, atol=SAME)
    assert found.along.shape == (11, 2)


def test_what_they_may_be_beforehand():
    found, scale = together(columns(), np.ones((SUBJECTS, 20))), prior().common
    np.testing.assert_allclose(found.prior.common, [*scale[found.kept], *COURSE_SD[1:], 1.0, 1.0])
    np.testing.assert_allclose(found.prior.between, [*0.1 * scale[found.kept], 0.0, 0.0, 0.0, 0.0])
    size = 0.25 * np.array([2.0, -4.0, 3.0, -1.0, 2.0])
    np.testing.assert_allclose(found.along[:5], np.stack([size * [1, 1, 0, 0, 0], size * [0, 0, 1, 1, 1]], axis=1))
    np.testing.assert_array_equal(found.along[5:], 0.0)


def test_evidence_is_that_of_one_gaussian_over_all_subjects():
    A = columns(3)
    y = np.random.default_rng(4).standard_normal((SUBJECTS, 20)) * 3.0
    found = together(A, y)
    ts, ai = FREE[[0, 3]]
    made = [ts * A[..., one] + ai * A[..., other] for one, other in ((1, 4), (2, 5), (9, 11), (10, 12))]
    B = np.concatenate([A[..., found.kept], np.stack(made, axis=-1)], axis=-1)
    own = np.diag(found.prior.between**2) + found.along @ found.along.T
    common = np.concatenate(B) @ np.diag(found.prior.common)
    C = np.eye(SUBJECTS * 20) + common @ common.T
    for s in range(SUBJECTS):
        rows = slice(20 * s, 20 * s + 20)
        C[rows, rows] += B[s] @ own @ B[s].T
    dense = _NORMAL.logpdf(y.ravel(), np.zeros(len(C)), C) + 0.5 * len(C) * np.log(2.0 * np.pi)
    log, mean, covariance = common_amplitude(found.statistics, found.prior, found.along)
    assert log == pytest.approx(dense, rel=SAME)
    cross = np.diag(found.prior.common) @ common.T
    np.testing.assert_allclose(mean, cross @ np.linalg.solve(C, y.ravel()), rtol=1e-6, atol=SAME)
    expected = np.diag(found.prior.common**2) - cross @ np.linalg.solve(C, cross.T)
    np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=SAME)


def test_many_draws_are_weighed_as_each_alone():
    A = columns(5)
    y = np.random.default_rng(6).standard_normal((3, SUBJECTS, 20))
    free = np.random.default_rng(7).standard_normal((3, COLUMNS))
    one = statistics_of(A, y[0])
    many = AmplitudeStatistics(-0.5 * (y**2).sum(axis=(1, 2)), one.information, np.einsum("src,dsr->dsc", A, y))
    found = one_course(many, prior(), free, [GAP, BIAS], DEPARTURES)
    log, mean, _ = common_amplitude(found.statistics, found.prior, found.along)
    for draw in range(3):
        alone = one_course(statistics_of(A, y[draw]), prior(), free[draw], [GAP, BIAS], DEPARTURES)
        expected = common_amplitude(alone.statistics, alone.prior, alone.along)
        assert log[draw] == pytest.approx(expected[0], rel=SAME)
        np.testing.assert_allclose(mean[draw], expected[1], rtol=1e-6, atol=SAME)
