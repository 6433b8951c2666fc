"""Evidence and means against dense Gaussian algebra: all subjects stacked, every covariance written out."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from adapt.diagnosis.fit.linear_evidence import (
    AmplitudeStatistics,
    agreeing_signs,
    amplitude_statistics,
    inner_products,
    log_evidence,
    log_sum,
    posterior,
)
from adapt.diagnosis.fit.linear_model import (
    BETWEEN_SUBJECTS,
    AmplitudePrior,
    LinearisedFit,
    common_shift,
    independent_prior,
    shared_prior,
)
from models.adapted_parameters import ADAPTED, PRIOR_SD_MM

SAME = 1e-9
"""Relative: two ways through linear systems whose condition is below 1e4 leave 1e-12."""

_NORMAL: Any = multivariate_normal
"""Its type would have the covariance a number."""

SUBJECTS, RESIDUALS, AMPLITUDES, MORE = 3, 11, 4, 2


ALL, EACH = np.ones(6), np.array([0.4, 1.2, 0.7, 0.3, 2.0, 0.5])
"""Spreads of the adapted parameters."""


def linear_of(seed: int = 0, amplitudes: int = AMPLITUDES, spread: np.ndarray | float = 1.0) -> LinearisedFit:
    """Random columns and residuals of three subjects."""
    generator = np.random.default_rng(seed)

    def normal(*shape):
        return generator.standard_normal((SUBJECTS, *shape))

    X, A = normal(RESIDUALS, 6), normal(RESIDUALS, amplitudes)
    u, a, y = normal(6), normal(amplitudes), normal(RESIDUALS)
    return LinearisedFit(
        hypothesis=("a",),
        z=np.zeros((6 + amplitudes, SUBJECTS)),
        nearest=np.zeros((6, 1, SUBJECTS)),
        y=y,
        X=X,
        A=A,
        scale=generator.uniform(0.5, 2.0, amplitudes),
        u=u,
        a=a,
        linear=np.einsum("srk,sk->sr", X, u) + np.einsum("srk,sk->sr", A, a) - y,
        root=normal(1, RESIDUALS, RESIDUALS),
        by_angle=normal(1, RESIDUALS, 6),
        spread=np.full(6, spread),
    )


def shifted(scale: np.ndarray) -> AmplitudePrior:
    """Amplitudes about a mean that is not zero, each with its own spreads."""
    k = np.arange(len(scale))
    return AmplitudePrior(scale * (1.0 - 0.7 * k), scale * (0.4 + 0.2 * k), scale * 0.3 / (1.0 + k))


def fixed_common(scale: np.ndarray) -> AmplitudePrior:
    """A common part known beforehand in its first amplitude, no spread between subjects in its last."""
    beforehand = shifted(scale)
    common, between = beforehand.common.copy(), beforehand.between.copy()
    common[0], between[-1] = 0.0, 0.0
    return replace(beforehand, common=common, between=between)


PRIORS = {"alike": shared_prior, "unlike": independent_prior, "shifted": shifted, "fixed": fixed_common}
each_prior = pytest.mark.parametrize("prior", PRIORS.values(), ids=PRIORS)


@dataclass(frozen=True)
class Dense:
    """What all subjects together say, from one Gaussian of (u, a of each subject; common amplitude)."""

    log_evidence: float
    common: np.ndarray
    covariance: np.ndarray
    u: np.ndarray
    a: np.ndarray
    mean_covariance: np.ndarray


def dense(
    fitted: LinearisedFit, beforehand: AmplitudePrior, noise: float = 1.0, spread: np.ndarray | float = 1.0
) -> Dense:
    """Unknowns in the order u of all subjects, a of all subjects, the common amplitude."""
    S, R, K = fitted.A.shape
    common, between = np.diag(beforehand.common**2), np.diag(beforehand.between**2)
    n_u, n_a = 6 * S, K * S
    mean = np.concatenate([np.zeros(n_u), np.tile(beforehand.mean, S + 1)])
    P = np.zeros((n_u + n_a + K, n_u + n_a + K))
    P[:n_u, :n_u] = np.diag(np.tile(spread * np.ones(6), n_u // 6) ** 2)
    P[n_u:, n_u:] = np.kron(np.ones((S + 1, S + 1)), common)
    P[n_u : n_u + n_a, n_u : n_u + n_a] += np.kron(np.eye(S), between)
    H = np.zeros((S * R, len(P)))
    for s in range(S):
        rows = slice(s * R, (s + 1) * R)
        H[rows, 6 * s : 6 * s + 6] = fitted.X[s]
        H[rows, n_u + K * s : n_u + K * (s + 1)] = fitted.A[s]
    y = fitted.linear.ravel()
    C = H @ P @ H.T + noise**2 * np.eye(S * R)
    log = _NORMAL.logpdf(y, H @ mean, C) + 0.5 * S * R * np.log(2.0 * np.pi)
    gain = P @ H.T @ np.linalg.inv(C)
    after, left = mean + gain @ (y - H @ mean), P - gain @ H @ P
    average = np.zeros((K, len(P)))
    average[:, n_u : n_u + n_a] = np.tile(np.eye(K), S) / S
    return Dense(
        log_evidence=float(log),
        common=after[-K:],
        covariance=left[-K:, -K:],
        u=after[:n_u].reshape(S, 6),
        a=after[n_u : n_u + n_a].reshape(S, K),
        mean_covariance=average @ left @ average.T,
    )


def assert_same(found, expected) -> None:
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=SAME * max(1.0, np.abs(expected).max()))


# --- the dense answer -----------------------------------------------------------------------------


@each_prior
@pytest.mark.parametrize("seed", [0, 1])
def test_evidence_and_all_means_are_those_of_the_dense_gaussian(prior, seed):
    fitted = linear_of(seed)
    found, expected = posterior(fitted, prior(fitted.scale)), dense(fitted, prior(fitted.scale))
    for name in vars(expected):
        assert_same(getattr(found, name), getattr(expected, name))


@each_prior
def test_log_evidence_of_the_statistics_is_that_of_the_posterior(prior):
    fitted = linear_of(2)
    beforehand = prior(fitted.scale)
    assert_same(log_evidence(amplitude_statistics(fitted), beforehand), posterior(fitted, beforehand).log_evidence)


def test_no_amplitudes_leave_the_evidence_of_the_adapted_parameters():
    fitted = linear_of(3, amplitudes=0)
    found, expected = posterior(fitted, shared_prior(fitted.scale)), dense(fitted, shared_prior(fitted.scale))
    assert_same(found.log_evidence, expected.log_evidence)
    assert_same(amplitude_statistics(fitted).log, expected.log_evidence)
    assert_same(found.u, expected.u)
    assert found.common.shape == (0,)


def test_extra_columns_are_further_amplitudes_with_a_prior_of_their_own():
    fitted = linear_of(4)
    more = np.random.default_rng(5).standard_normal((SUBJECTS, RESIDUALS, MORE))
    beforehand = shifted(fitted.scale) + independent_prior(np.array([0.7, 1.3]))
    wider = replace(fitted, A=np.concatenate([fitted.A, more], axis=2))
    assert_same(log_evidence(inner_products(fitted, more).at(), beforehand), dense(wider, beforehand).log_evidence)


def test_extra_columns_that_cannot_act_change_nothing():
    fitted = linear_of(6)
    more = np.random.default_rng(7).standard_normal((SUBJECTS, RESIDUALS, MORE))
    beforehand = shared_prior(fitted.scale)
    with_more = log_evidence(inner_products(fitted, more).at(), beforehand + shared_prior(np.zeros(MORE)))
    assert_same(with_more, log_evidence(amplitude_statistics(fitted), beforehand))


# --- other noise, other spread --------------------------------------------------------------------


@each_prior
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_other_noise_is_that_of_the_dense_gaussian(prior, factor):
    """Whitened anew by the share: the density of what is seen changes its unit with it."""
    fitted = linear_of(8)
    found = posterior(fitted.with_noise(factor), prior(fitted.scale))
    expected = dense(fitted, prior(fitted.scale), noise=factor)
    assert_same(found.log_evidence - fitted.y.size * np.log(factor), expected.log_evidence)
    for name in ("common", "covariance", "u", "a", "mean_covariance"):
        assert_same(getattr(found, name), getattr(expected, name))


@each_prior
def test_noise_integrated_out_is_the_mixture_of_the_dense_gaussians(prior):
    fitted, beforehand = linear_of(), prior(linear_of().scale)
    factors = [(0.8, 0.3), (1.0, 0.5), (1.3, 0.2)]
    found = log_sum(log_evidence(inner_products(fitted).over(factors), beforehand))
    expected = [np.log(weight) + dense(fitted, beforehand, noise=factor).log_evidence for factor, weight in factors]
    assert found == pytest.approx(np.logaddexp.reduce(expected), rel=SAME)


def test_more_columns_keep_their_meaning_at_other_noise():
    """A column acts on the measurement: as columns of the hypothesis do."""
    fitted = linear_of()
    less = replace(fitted, A=fitted.A[..., :3], scale=fitted.scale[:3], linear=fitted.linear)
    whole, split = inner_products(fitted).at(0.7), inner_products(less, fitted.A[..., 3:]).at(0.7)
    np.testing.assert_allclose(split.information, whole.information, rtol=SAME, atol=SAME)
    np.testing.assert_allclose(split.gradient, whole.gradient, rtol=SAME, atol=SAME)
    assert split.log == pytest.approx(whole.log, rel=SAME)


def test_other_noise_and_back_is_the_same():
    fitted = linear_of(9)
    again = fitted.with_noise(0.5).with_noise(2.0)
    for name in ("y", "X", "A", "linear", "root"):
        assert_same(getattr(again, name), getattr(fitted, name))
    assert_same(fitted.with_noise(0.5).y, 2.0 * fitted.y)


@pytest.mark.parametrize("spread", [EACH, 1.7 * ALL], ids=["each its own", "all alike"])
def test_other_spread_is_that_of_the_dense_gaussian(spread):
    """u is counted in units of the spread."""
    fitted = linear_of(10)
    found, beforehand = posterior(fitted.with_spread(spread), shared_prior(fitted.scale)), shared_prior(fitted.scale)
    expected = dense(fitted, beforehand, spread=spread)
    assert_same(found.log_evidence, expected.log_evidence)
    assert_same(spread * found.u, expected.u)
    assert_same(found.a, expected.a)


def test_a_spread_is_of_the_original_parameters_not_of_the_last_ones():
    """And it moves neither residuals nor what the parameters are: X u stays."""
    fitted = linear_of(11)
    twice, once = fitted.with_spread(EACH).with_spread(0.7 * ALL), fitted.with_spread(0.7 * ALL)
    for name in ("X", "u", "spread"):
        assert_same(getattr(twice, name), getattr(once, name))
    assert_same(np.einsum("srk,sk->sr", once.X, once.u), np.einsum("srk,sk->sr", fitted.X, fitted.u))


@pytest.mark.parametrize("spread", [None, 0.7 * ALL], ids=["as made", "another"])
def test_products_of_another_spread_are_those_of_the_dense_gaussian(spread):
    """Taken at spreads of their own; then of those asked for, with what all subjects share in ``PRIOR_SD_MM`` still."""
    fitted = linear_of(15)
    made = inner_products(fitted.with_spread(EACH))
    of_these = EACH if spread is None else spread
    beforehand = shifted(fitted.scale)
    assert_same(
        log_evidence(made.at(spread=spread), beforehand),
        dense(fitted, beforehand, spread=of_these).log_evidence,
    )
    wider = replace(fitted, A=np.concatenate([fitted.A, fitted.X], axis=2))
    beforehand = beforehand + common_shift(0.5)
    found = log_evidence(made.with_shift().at(spread=spread), beforehand)
    assert_same(found, dense(wider, beforehand, spread=of_these).log_evidence)


# --- what subjects have in common -----------------------------------------------------------------


@pytest.mark.parametrize("spread", [ALL, EACH], ids=["all alike", "each its own"])
def test_a_common_shift_is_that_of_the_dense_gaussian(spread):
    """It is in units of ``PRIOR_SD_MM``, whatever the spread between subjects is."""
    fitted = linear_of(20)
    wider = replace(fitted, A=np.concatenate([fitted.A, fitted.X], axis=2))
    beforehand = shifted(fitted.scale) + common_shift(0.5)
    found = log_evidence(inner_products(fitted).with_shift().at(spread=spread), beforehand)
    assert_same(found, dense(wider, beforehand, spread=spread).log_evidence)


@pytest.mark.parametrize("seed", range(6))
def test_signs_are_turned_to_those_with_the_most_evidence(seed):
    fitted = linear_of(seed, amplitudes=2)
    beforehand = shared_prior(fitted.scale)
    patterns = [np.array([1.0, *signs]) for signs in product([1.0, -1.0], repeat=SUBJECTS - 1)]
    turnings = [replace(fitted, A=signs[:, None, None] * fitted.A) for signs in patterns]
    expected = max(dense(one, beforehand).log_evidence for one in turnings)
    statistics = amplitude_statistics(fitted)
    assert_same(log_evidence(statistics.with_signs(agreeing_signs(statistics, beforehand)), beforehand), expected)


def test_turning_begins_near_the_best_signs():
    """Subjects that pull by (3, -2), (1, -1), (-3, -4), (-3, -4) and (0, 1): with the last one turned the sum is
    (-2, -12), 148 squared. One by one from elsewhere it may end at (10, 6), 136, where no single turn adds."""
    gradient = np.array([[3.0, -2.0], [1.0, -1.0], [-3.0, -4.0], [-3.0, -4.0], [0.0, 1.0]])
    statistics = AmplitudeStatistics(log=np.zeros(()), information=np.zeros((5, 2, 2)), gradient=gradient)
    sign = agreeing_signs(statistics, shared_prior(np.ones(2)))
    assert np.sum((sign @ gradient) ** 2) == pytest.approx(148.0)


@each_prior
def test_many_draws_at_once_are_each_by_itself(prior):
    one, other = linear_of(21), replace(linear_of(21), linear=linear_of(22).linear)
    beforehand, each = prior(one.scale), [inner_products(products) for products in (one, other)]
    both = replace(
        each[0],
        with_data=np.stack([products.with_data for products in each]),
        square=np.stack([np.asarray(products.square) for products in each]),
    )
    for change in (
        lambda products: products.at(0.8, 0.5),
        lambda products: products.at().with_signs(agreeing_signs(products.at(), shared_prior(one.scale))),
    ):
        expected = [float(log_evidence(change(products), beforehand)) for products in each]
        assert_same(log_evidence(change(both), beforehand), expected)


# --- what must not matter -------------------------------------------------------------------------


@each_prior
def test_the_unit_of_an_amplitude_does_not_matter(prior):
    fitted = linear_of(12)
    unit = np.array([10.0, 0.1, 3.0, 1.0])
    other = replace(fitted, A=fitted.A / unit, a=fitted.a * unit, scale=fitted.scale * unit)
    beforehand = prior(fitted.scale)
    found = posterior(other, AmplitudePrior(*(unit * value for value in vars(beforehand).values())))
    expected = posterior(fitted, beforehand)
    assert_same(found.log_evidence, expected.log_evidence)
    assert_same(found.common, unit * expected.common)
    assert_same(found.a, unit * expected.a)
    assert_same(found.covariance, np.outer(unit, unit) * expected.covariance)
    assert_same(found.mean_covariance, np.outer(unit, unit) * expected.mean_covariance)


@each_prior
def test_turned_residuals_and_another_order_of_subjects_change_nothing(prior):
    fitted = linear_of(13)
    Q, _ = np.linalg.qr(np.random.default_rng(14).standard_normal((RESIDUALS, RESIDUALS)))
    order = np.array([2, 0, 1])
    with_signs = {
        name: np.einsum("ij,sj...->si...", Q, getattr(fitted, name)[order]) for name in ("y", "X", "A", "linear")
    }
    found = posterior(replace(fitted, **with_signs), prior(fitted.scale))
    expected = posterior(fitted, prior(fitted.scale))
    assert_same(found.log_evidence, expected.log_evidence)
    assert_same(found.common, expected.common)
    assert_same(found.a, expected.a[order])


# --- priors ---------------------------------------------------------------------------------------


def test_the_prior_of_the_adapted_parameters_is_about_the_published_spread():
    """Table 6.5, R2; the order is that of ADAPTED."""
    published_mm = {"M_y": 31.0, "M_z": 6.0, "A_x": 3.0, "A_y": 24.0, "A_z": 17.0, "conoid_length": 2.0}
    assert tuple(published_mm) == ADAPTED
    factor = PRIOR_SD_MM / np.array([*published_mm.values()])
    assert (np.abs(np.log2(factor)) <= 1.0).all()


def test_alike_and_unlike_give_one_subject_the_same_prior():
    """Of a single amplitude: common and deviation together, so the evidence of one subject cannot tell them apart."""
    fitted = linear_of(16)
    one = replace(fitted, **{name: getattr(fitted, name)[:1] for name in ("y", "X", "A", "u", "a", "linear", "root")})
    statistics = amplitude_statistics(one)
    assert_same(
        log_evidence(statistics, shared_prior(fitted.scale)), log_evidence(statistics, independent_prior(fitted.scale))
    )
    statistics = amplitude_statistics(fitted)
    assert (
        abs(
            log_evidence(statistics, shared_prior(fitted.scale))
            - log_evidence(statistics, independent_prior(fitted.scale))
        )
        > 1e3 * SAME
    )


def test_blocks_add_up_and_scale():
    scale = np.array([1.0, 3.0])
    both = (shared_prior(scale) + independent_prior(scale)) * 2.0
    assert_same(both.common, [2.0, 6.0, 0.0, 0.0])
    assert_same(both.between[:2], 2.0 * BETWEEN_SUBJECTS * scale)
    assert_same(both.between[2:] ** 2, (1.0 + BETWEEN_SUBJECTS**2) * (2.0 * scale) ** 2)
    assert_same((shifted(scale) * 2.0).mean, 2.0 * shifted(scale).mean)
