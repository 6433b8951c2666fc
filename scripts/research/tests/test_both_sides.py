# pyright: reportArgumentType=false, reportCallIssue=false
# (SciPy has no types)
"""The prior from the other side and the likelihood of a pair, against the dense joint Gaussian of sizes and data."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from scripts.research.person.study_both_sides import (
    Told,
    minus_two_log_likelihood,
    pairings,
    sides_of,
    told_by_other_side,
)

SIZES, SEEN, NOISE = 4, 3, 0.5
CORRELATION = np.array([0.9, 0.5, 0.0, 0.7])


@pytest.fixture(scope="module")
def shoulders():
    """Return random Jacobians and data of both sides."""
    random = np.random.default_rng(0)
    return random.normal(size=(2, SEEN, SIZES)), random.normal(size=(2, SEEN))


def alone(slopes: np.ndarray, seen: np.ndarray) -> Told:
    """Compute the posterior of one side's sizes ~ N(0, 1)."""
    covariance = np.linalg.inv(np.eye(SIZES) + slopes.T @ slopes / NOISE**2)
    return Told(covariance @ slopes.T @ seen / NOISE**2, covariance)


def joint(correlation: np.ndarray) -> np.ndarray:
    """Return the prior covariance of the sizes of both sides."""
    return np.block([[np.eye(SIZES), np.diag(correlation)], [np.diag(correlation), np.eye(SIZES)]])


def test_the_other_side_is_the_conditional_of_the_joint_gaussian(shoulders):
    slopes, seen = shoulders
    sizes = joint(CORRELATION)
    across = sizes[:SIZES, SIZES:] @ slopes[1].T
    of_seen = slopes[1] @ slopes[1].T + NOISE**2 * np.eye(SEEN)
    told = told_by_other_side(alone(slopes[1], seen[1]), CORRELATION)
    np.testing.assert_allclose(told.mean, across @ np.linalg.solve(of_seen, seen[1]), atol=1e-12)
    np.testing.assert_allclose(told.covariance, np.eye(SIZES) - across @ np.linalg.solve(of_seen, across.T), atol=1e-12)


def test_likelihood_of_a_pair_is_that_of_all_numbers_seen(shoulders):
    slopes, seen = shoulders
    both = np.block([[slopes[0], np.zeros((SEEN, SIZES))], [np.zeros((SEEN, SIZES)), slopes[1]]])

    def value(correlation: np.ndarray) -> float:
        covariance = both @ joint(correlation) @ both.T + NOISE**2 * np.eye(2 * SEEN)
        return -2.0 * multivariate_normal(np.zeros(2 * SEEN), covariance).logpdf(seen.ravel())

    ours = minus_two_log_likelihood(*(alone(slopes[k], seen[k]) for k in (0, 1)), CORRELATION)
    assert ours == pytest.approx(value(CORRELATION) - value(np.zeros(SIZES)), rel=1e-10)


def test_sides_are_of_a_person_and_strangers_are_nobody_s_own():
    pairs = sides_of(["A_left", "A_right", "B", "C l", "D.left", "C r", "D.right"])
    np.testing.assert_array_equal(pairs, [[0, 1], [3, 5], [4, 6]])
    own, *strangers = pairings(pairs)
    np.testing.assert_array_equal(own, pairs)
    assert len(strangers) == 2
    for way in strangers:
        assert not (way[:, 1] == pairs[:, 1]).any()
