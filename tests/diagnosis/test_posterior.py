"""The posterior against dense Gaussian algebra, and the learnt discrepancy against draws from a known one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from small_worlds import joint_fit, root_of, searched

from adapt.diagnosis.fit.discrepancy import TYPICAL, Discrepancy, common_curves, whitening
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.likeliest import likeliest
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
    root = np.linalg.cholesky(dense_covariance(joint, true))
    generator = np.random.default_rng(8)
    found = []
    for _ in range(4):
        y = root @ generator.standard_normal((len(root), 3))
        Z = np.zeros((*y.shape, N + len(joint.candidates.scale)))
        every = np.arange(len(joint.candidates.scale))
        evidence = Likelihood.of(joint, true).evidence(joint.model.theta_mm, y, Z, every, np.zeros(len(every)))
        at = Posterior((), joint.model.theta_mm, np.zeros(0), y, Z, evidence)
        found.append(np.log(likeliest(joint, at)))
    off = np.mean(found, axis=0) - np.log(true)
    assert abs(off[0]) < FOUND
    assert abs(off[1]) < FOUND


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
