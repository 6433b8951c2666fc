"""The posterior against dense Gaussian algebra, and the learnt discrepancy against draws from a known one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, multivariate_t, norm
from small_worlds import joint_fit, root_of, searched

from adapt.diagnosis.fit.discrepancy import LOG_SD, NOTHING_OF, TYPICAL, Discrepancy, common_curves, whitening
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.likeliest import likeliest, log_volume
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.posterior import Posterior, modes
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import search_of
from models import load_model
from models.adapted_parameters import ADAPTED, PERSON_SD_MM
from models.effects import EFFECTS
from motions.rhythm_subjects import shipped_subjects

BIAS = "scapula_landmark_bias"
N = len(ADAPTED)

FEW = Discrepancy(0.6, 0.5, 0.8, 0.4, 0.9, 35.0, 0.4, 0.7, 0.6, 0.3, 0.2, 0.8)

INTERPOLATED = 0.02
"""Share of the common variance that is lost between the support points, and with the smallest curves left out."""

FOUND = np.log(1.6)
"""Tolerance for a logarithm: the SD of some ten independent numbers is known to a fifth, and the prior adds as much."""

LAPLACE = 0.7
"""Tolerance in nats of Laplace's method with three or four numbers, and of ``DRAWS`` draws."""

DRAWS = 400

ALIKE = 1e-3
"""SD of the amplitudes between shoulders in prior SDs: practically none."""

AT_THE_TOP = 0.2
"""Largest further step of an amplitude in posterior SDs: steps end below a quarter of a nat."""


def dense_covariance(joint: JointFit, found: Discrepancy) -> np.ndarray:
    """Compute the covariance of one constraint from its definition."""
    shoulders = joint.shoulders
    elevation, along = shoulders.coordinates_deg
    near, near_along = (
        (1.0 + np.sqrt(3.0) * apart) * np.exp(-np.sqrt(3.0) * apart)
        for apart in (np.abs(one[:, None] - one) / found.length_deg for one in (elevation, along))
    )
    of_motion = near_along * near
    of_motion *= shoulders.motion[:, None] == shoulders.motion
    same = shoulders.subject[:, None] == shoulders.subject
    own = found.of_motion_deg**2 * of_motion + found.of_shoulder_deg**2 * near
    common = found.common_motion_deg**2 * of_motion + found.common_deg**2 * near
    return own * same + common + found.noise_deg**2 * np.eye(len(near))


def whitened_covariance(joint: JointFit, found: Discrepancy) -> np.ndarray:
    """Compute the covariance from the factors that the fits use."""
    white = whitening(joint.shoulders, found, common_curves(joint.shoulders, found))
    roots = [np.linalg.inv(one) for one in white.inverse_root]
    curves = np.concatenate([root @ one for root, one in zip(roots, white.curves, strict=True)])
    order = np.argsort(np.concatenate(white.rows))
    every = np.asarray(block_diag(*(root @ root.T for root in roots))) + curves @ curves.T
    return every[np.ix_(order, order)]


def test_what_shoulders_have_in_common_is_carried_by_few_curves():
    joint = joint_fit()
    off = whitened_covariance(joint, FEW) - dense_covariance(joint, FEW)
    assert np.abs(off).max() < INTERPOLATED * (FEW.common_motion_deg**2 + FEW.common_deg**2)


def test_the_evidence_is_the_density_of_the_data_with_all_else_integrated_out():
    joint = joint_fit()
    generator = np.random.default_rng(4)
    shoulders, candidates = joint.shoulders, joint.candidates
    where = candidates.where((BIAS,))
    theta = joint.model.theta_mm + PERSON_SD_MM * generator.standard_normal(joint.model.theta_mm.shape)
    y = generator.standard_normal((len(shoulders.subject), 3))
    Z = generator.standard_normal((*y.shape, N + len(candidates.scale)))
    here = generator.standard_normal(len(where))
    mean, scale = candidates.mean[where], candidates.scale[where]
    likelihood = Likelihood.of(joint, FEW)
    found = likelihood.evidence(theta, y, Z, np.arange(len(candidates.scale)), np.zeros(len(candidates.scale))).given(
        where, here, mean, scale
    )

    def of_shoulders(slopes: np.ndarray) -> np.ndarray:
        """Return slopes in the parameters of all shoulders: each row depends on those of its own shoulder."""
        every = np.zeros((*y.shape, len(theta), slopes.shape[2]))
        every[np.arange(len(y)), :, shoulders.subject] = slopes
        return every.reshape(y.size, -1)

    flat, by_amplitudes = of_shoulders(Z[..., :N]), of_shoulders(Z[..., N + where])
    of_theta = np.kron(np.eye(len(theta)) + 1.0, np.diag(PERSON_SD_MM**2))
    of_amplitudes = np.kron(FEW.between_shoulders**2 * np.eye(len(theta)) + 1.0, np.diag(scale**2))
    middle = (
        y.ravel() + flat @ (joint.model.theta_mm - theta).ravel() + by_amplitudes @ np.tile(mean - here, len(theta))
    )
    covariance = np.kron(whitened_covariance(joint, FEW), np.eye(3))
    covariance += flat @ of_theta @ flat.T + by_amplitudes @ of_amplitudes @ by_amplitudes.T
    density = -0.5 * (np.linalg.slogdet(covariance).logabsdet + middle @ np.linalg.solve(covariance, middle))
    assert found.log_evidence == pytest.approx(density, rel=1e-9)  # except for the powers of 2 pi
    towards = Z[..., N + where].reshape(y.size, -1) * scale**2
    moved = -towards.T @ np.linalg.solve(covariance, middle)
    left = np.diag(scale**2) - towards.T @ np.linalg.solve(covariance, towards)
    np.testing.assert_allclose(found.amplitude, mean + moved, rtol=1e-8)
    root = root_of(found)
    np.testing.assert_allclose(np.linalg.inv(root @ root.T), left, rtol=1e-7)
    every = of_amplitudes @ by_amplitudes.T
    expected = mean - (every @ np.linalg.solve(covariance, middle)).reshape(len(theta), -1)
    np.testing.assert_allclose(found.of_shoulders, expected, rtol=1e-8)


def test_a_shoulder_that_is_drawn_twice_counts_as_two_alike():
    search = searched(BIAS)
    at, candidates = search.nodes[(BIAS,)].posterior, search.joint.candidates
    given, where = search.given(at, (BIAS,)), candidates.where((BIAS,))
    times = np.array([[2.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    drawn = at.evidence.of(np.array([0, 0, 2]))
    twice = drawn.given(where, at.amplitude, candidates.mean[where], candidates.scale[where])
    np.testing.assert_allclose(given.resampled(times), [twice.log_evidence, given.log_evidence], rtol=1e-10)
    for one, expected in zip(times, (twice, given), strict=True):
        amplitude, root = given.amplitude_of(one)
        np.testing.assert_allclose(amplitude, expected.amplitude, rtol=1e-9)
        np.testing.assert_allclose(root, root_of(expected), rtol=1e-9)


def test_the_quadratic_is_what_is_white_squared_a_step_away():
    """Check the quadratic against the squared norm of the whitened vector after a step.

    The vector is linear in the parameters, and in the factors of curves that shoulders share.
    """
    joint = joint_fit()
    generator = np.random.default_rng(6)
    seen = (joint.shoulders.subject != 1) | (np.arange(len(joint.shoulders.subject)) % 3 > 0)  # fewer rows of one
    likelihood = Likelihood.of(joint, FEW, seen)
    rows, subjects, n = int(seen.sum()), len(joint.shoulders.subjects), N + 2
    y, slopes = generator.standard_normal((2, rows, 3)), generator.standard_normal((2, rows, 3, n))
    theta = joint.model.theta_mm + generator.standard_normal((2, subjects, N))
    f = generator.standard_normal((2, likelihood.shared))
    own = np.split(y, np.cumsum([len(one) for one in likelihood.whitening.rows])[:-1], axis=1)
    squares = [
        ((root @ one) ** 2).sum(axis=(1, 2)) for root, one in zip(likelihood.whitening.inverse_root, own, strict=True)
    ]
    white, _ = likelihood.values(y, theta, 0.0 * f)
    np.testing.assert_allclose((white**2).sum(axis=(2, 3)), np.transpose(squares), rtol=1e-12)
    M = likelihood.quadratic(y, slopes, theta, f)
    step = generator.standard_normal(likelihood.shared + n)
    of_f, own = step[N : N + likelihood.shared], np.delete(step, np.s_[N : N + likelihood.shared])
    white, prior = likelihood.values(y + slopes @ own, theta + step[:N], f + of_f)
    z = np.append(step, 1.0)
    expected = (white**2).sum(axis=(2, 3)) + (prior**2).sum(axis=2)
    np.testing.assert_allclose(np.einsum("i,gsij,j->gs", z, M, z), expected, rtol=1e-10)


def test_at_the_mode_the_linear_model_stays_where_it_is():
    """Check with amplitudes that all shoulders share, as at the mode."""
    search = searched(BIAS)
    at, likelihood = search.nodes[(BIAS,)].posterior, replace(search.likelihood, between=ALIKE)
    (found,) = modes(search.joint, likelihood, [at.hypothesis], [at.theta_mm], [at.amplitude])
    given = search.given(found, found.hypothesis)
    assert np.linalg.norm(root_of(given).T @ (given.amplitude - found.amplitude)) < AT_THE_TOP
    off = (given.of_shoulders - given.amplitude) / np.array(EFFECTS[BIAS].prior.scale)
    assert np.abs(off).max() < 10.0 * ALIKE


def test_two_starts_find_one_mode():
    search = searched(BIAS)
    at = search.nodes[(BIAS,)].posterior
    far = at.theta_mm + 0.5 * PERSON_SD_MM, at.amplitude + 1.0
    (other,) = modes(search.joint, search.likelihood, [at.hypothesis], [far[0]], [far[1]])
    given, again = (search.given(one, one.hypothesis) for one in (at, other))
    assert again.log_evidence == pytest.approx(given.log_evidence, abs=0.5)
    assert np.linalg.norm(root_of(given).T @ (again.amplitude - given.amplitude)) < AT_THE_TOP


@pytest.mark.parametrize(
    "true",
    [
        FEW._replace(of_shoulder_deg=0.2, common_deg=0.2),
        FEW._replace(noise_deg=0.3, of_motion_deg=1.5, length_deg=80.0),
    ],
)
def test_the_discrepancy_that_drew_the_data_is_found(true):
    """Check noise that is small beside a smooth part, in postures 20 deg apart, with a long length scale."""
    joint = joint_fit()
    found = [np.log(likeliest(joint, drawn(joint, true, seed)).discrepancy) for seed in range(4)]
    off = np.mean(found, axis=0) - np.log(true)
    assert abs(off[0]) < FOUND
    assert abs(off[1]) < FOUND


def drawn(joint: JointFit, true: Discrepancy, seed: int) -> Posterior:
    """Draw y from a discrepancy, where neither parameters nor causes have an influence."""
    root = np.linalg.cholesky(dense_covariance(joint, true))
    y = root @ np.random.default_rng((8, seed)).standard_normal((len(root), 3))
    Z, every = np.zeros((*y.shape, N + len(joint.candidates.scale))), np.arange(len(joint.candidates.scale))
    evidence = Likelihood.of(joint, true).evidence(joint.model.theta_mm, y, Z, every, np.zeros(len(every)))
    return Posterior((), joint.model.theta_mm, np.zeros(0), y, Z, evidence)


def log_density(joint: JointFit, y: np.ndarray, found: Discrepancy) -> float:
    """Compute the log density of y from the definition of its covariance."""
    covariance: Any = dense_covariance(joint, found)  # SciPy has no types; its default of 1 reads as an int
    return float(multivariate_normal(np.zeros(len(y)), covariance).logpdf(y.T).sum())


NOISE = TYPICAL._replace(**dict.fromkeys(NOTHING_OF["noise"], 0.0))
"""Nothing but noise."""

OWN = NOISE._replace(of_shoulder_deg=1.0, of_motion_deg=0.5)
COMMON = OWN._replace(common_deg=1.0, common_motion_deg=0.5)


def log_probability(joint: JointFit, at: Posterior, left: str) -> float:
    """Compute the log probability of the data with a belief, from the definition at its hyperparameters."""
    belief = likeliest(joint, at, left)
    return log_density(joint, at.y, belief.discrepancy) + belief.log_volume


@pytest.mark.parametrize(("true", "right"), [(NOISE, "noise"), (OWN, "own"), (COMMON, "common")])
def test_the_belief_that_drew_the_data_is_the_most_probable(true, right):
    """Check that free hyperparameters cost what they explain by chance: the widest belief always fits best."""
    joint = joint_fit()
    for seed in range(3):
        at = drawn(joint, true, seed)
        by_belief = {left: log_probability(joint, at, left) for left in NOTHING_OF}
        assert max(by_belief, key=by_belief.__getitem__) == right


@pytest.mark.parametrize("left", ["noise", "own"])
def test_the_integral_over_the_hyperparameters_is_that_of_draws_from_their_prior(left):
    """Check against the mean density over draws from a wide distribution about the mode, weighted by the prior."""
    joint, generator = joint_fit(), np.random.default_rng(5)
    at = drawn(joint, OWN, 0)
    found = likeliest(joint, at, left).discrepancy
    names = [name for name in ("noise_deg", "of_motion_deg", "of_shoulder_deg", "length_deg") if getattr(found, name)]
    sd, median = (np.array([one[Discrepancy._fields.index(name)] for name in names]) for one in (LOG_SD, TYPICAL))
    mode = np.log([getattr(found, name) for name in names] / median) / sd
    covariance: Any = 0.25 * np.eye(len(names))
    wide = multivariate_t(mode, covariance, df=3, seed=generator)
    z = wide.rvs(DRAWS).reshape(DRAWS, -1)
    each = np.array(
        [
            log_density(joint, at.y, found._replace(**dict(zip(names, median * np.exp(sd * one), strict=True))))
            for one in z
        ]
    )
    log_integral = logsumexp(each + norm.logpdf(z).sum(axis=1) - wide.logpdf(z)) - np.log(DRAWS)
    assert log_probability(joint, at, left) == pytest.approx(log_integral, abs=LAPLACE)


def test_the_integral_of_a_gaussian_is_exact():
    """Check a likelihood exp(-(z - m)'A(z - m) / 2), whose integral is exp(-m'(I + A^-1)^-1 m / 2) / |I + A|^1/2."""
    A, m = np.array([[3.0, 0.8], [0.8, 2.0]]), np.array([0.7, -1.1])
    z = np.linalg.solve(np.eye(2) + A, A @ m)
    log_integral = -0.5 * (m @ np.linalg.solve(np.eye(2) + np.linalg.inv(A), m) + np.linalg.slogdet(np.eye(2) + A)[1])
    found = log_volume(lambda x: 0.5 * float(x @ x + (x - m) @ A @ (x - m)), z)
    assert found - 0.5 * (z - m) @ A @ (z - m) == pytest.approx(log_integral, abs=1e-10)


def test_neighbouring_postures_tell_little_of_what_is_smooth():
    """Check a constant over the seven postures of a motion: it counts as one to three numbers, not seven."""
    shoulders = joint_fit().shoulders
    smooth = FEW._replace(
        noise_deg=0.05,
        of_motion_deg=1.0,
        of_shoulder_deg=0.01,
        common_motion_deg=0.01,
        common_deg=0.01,
        length_deg=60.0,
    )
    white = whitening(shoulders, smooth, common_curves(shoulders, smooth))
    ones = [inverse @ np.ones(len(rows)) for rows, inverse in zip(white.rows, white.inverse_root, strict=True)]
    numbers = sum(float(one @ one) for one in ones) / (len(shoulders.subjects) * len(shoulders.kinds))
    assert 0.9 < numbers < 3.0


def test_the_last_digit_of_the_start_does_not_decide_where_the_mode_is():
    """Check two starts that differ by rounding, for shipped subjects, whose chains R2 hardly closes.

    Unlimited first steps would open some chains, and then end anywhere.
    """
    shoulders, _ = usable(shipped_subjects())
    search = search_of(load_model("R2"), shoulders, [EFFECTS["ac_offset"]])
    likelihood, start = Likelihood.of(search.joint, TYPICAL), search.without_causes.theta_mm
    found = [
        modes(search.joint, likelihood, [("ac_offset",)], [theta], [np.zeros(5)])[0]
        for theta in (start, start * (1.0 + 1e-15))
    ]
    np.testing.assert_allclose(found[1].amplitude, found[0].amplitude, rtol=1e-6)
    np.testing.assert_allclose(found[1].theta_mm, found[0].theta_mm, atol=1e-6)


def test_of_the_modes_of_a_set_that_of_most_evidence_is_kept():
    """Check a start with remote bones and sizes, which leads to a lower mode or to none."""
    search = searched("scapula_landmark_bias")
    (name,) = best = search.best.hypothesis
    good = search.nodes.pop(best)
    far = replace(
        good,
        posterior=replace(
            good.posterior, theta_mm=good.posterior.theta_mm + 60.0, amplitude=-9.0 * good.posterior.amplitude
        ),
    )
    worse = search._modes([best], [far.posterior.theta_mm], [far.posterior.amplitude])[0]
    assert search._value(worse, best) < good.value - 1.0, "else it shows nothing"
    assert search.fit((name,), far).value > good.value - 0.5
    assert search._add(worse).value > good.value - 0.5
