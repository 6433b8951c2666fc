"""The posterior against dense Gaussian algebra, and the discrepancy against draws from it."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from small_worlds import joint_fit, searched

from adapt.diagnosis.fit.discrepancy import Discrepancy, whitening
from adapt.diagnosis.fit.evidence import Likelihood
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.posterior import Posterior, likeliest, modes
from models.adapted_parameters import ADAPTED, PERSON_SD_MM

BIAS = "scapula_landmark_bias"
N = len(ADAPTED)

FEW = Discrepancy(0.6, 0.5, 0.8, 0.4, 0.9, 35.0)

INTERPOLATED = 0.02
"""Share of the common variance that is lost between the points that carry it, and with the smallest curves."""

FOUND = np.log(1.6)
"""A SD of some ten independent numbers is known to a fifth; the prior adds as much."""

AT_THE_TOP = 0.2
"""Of its SD, by which a step further would move an amplitude: steps end below a quarter of a nat."""


def dense_covariance(joint: JointFit, found: Discrepancy) -> np.ndarray:
    """The covariance of one constraint, written out."""
    shoulders = joint.shoulders
    elevation, along = shoulders.course_deg
    near = np.exp(-0.5 * ((elevation[:, None] - elevation) / found.length_deg) ** 2)
    of_motion = np.exp(-0.5 * ((along[:, None] - along) / found.length_deg) ** 2) * near
    of_motion *= shoulders.motion[:, None] == shoulders.motion
    same = shoulders.subject[:, None] == shoulders.subject
    own = found.of_motion_deg**2 * of_motion + found.of_shoulder_deg**2 * near
    common = found.common_motion_deg**2 * of_motion + found.common_deg**2 * near
    return own * same + common + found.noise_deg**2 * np.eye(len(near))


def whitened_covariance(joint: JointFit, found: Discrepancy) -> np.ndarray:
    """The same from the factors that the fits use."""
    white = whitening(joint.shoulders, found)
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
    likelihood = Likelihood(joint.model, whitening(shoulders, FEW))
    found = likelihood.evidence(theta, y, Z).given(where, here, mean, scale).log_evidence

    by_theta = np.zeros((*y.shape, len(theta), N))
    by_theta[np.arange(len(y)), :, shoulders.subject] = Z[..., :N]
    flat = by_theta.reshape(y.size, -1)
    of_theta = np.kron(np.eye(len(theta)) + 1.0, np.diag(PERSON_SD_MM**2))
    by_amplitude = Z[..., N + where].reshape(y.size, -1)
    middle = y.ravel() + flat @ (joint.model.theta_mm - theta).ravel() + by_amplitude @ (mean - here)
    covariance = np.kron(whitened_covariance(joint, FEW), np.eye(3))
    covariance += flat @ of_theta @ flat.T + (by_amplitude * scale**2) @ by_amplitude.T
    density = -0.5 * (np.linalg.slogdet(covariance).logabsdet + middle @ np.linalg.solve(covariance, middle))
    assert found == pytest.approx(density, rel=1e-9)  # but for the powers of 2 pi


def test_at_the_mode_the_linear_model_stays_where_it_is():
    search = searched(BIAS)
    node = search.nodes[(BIAS,)]
    given = search.given(node.posterior, node.hypothesis)
    assert np.linalg.norm(given.root.T @ (given.amplitude - node.posterior.amplitude)) < AT_THE_TOP


def test_two_starts_find_one_mode():
    search = searched(BIAS)
    at = search.nodes[(BIAS,)].posterior
    far = at.theta_mm + 0.5 * PERSON_SD_MM, at.amplitude + 1.0
    (other,) = modes(search.joint, search.likelihood, [at.hypothesis], [far[0]], [far[1]])
    given, again = (search.given(one, one.hypothesis) for one in (at, other))
    assert again.log_evidence == pytest.approx(given.log_evidence, abs=0.5)
    assert np.linalg.norm(given.root.T @ (again.amplitude - given.amplitude)) < AT_THE_TOP


@pytest.mark.parametrize(
    "true", [FEW._replace(of_shoulder_deg=0.2, common_deg=0.2), FEW._replace(noise_deg=0.3, of_motion_deg=1.5)]
)
def test_the_discrepancy_that_drew_the_data_is_found(true):
    joint = joint_fit()
    root = np.linalg.cholesky(dense_covariance(joint, true))
    generator = np.random.default_rng(8)
    found = []
    for _ in range(4):
        y = root @ generator.standard_normal((len(root), 3))
        Z = np.zeros((*y.shape, N + len(joint.candidates.scale)))
        evidence = Likelihood(joint.model, whitening(joint.shoulders, true)).evidence(joint.model.theta_mm, y, Z)
        at = Posterior((), joint.model.theta_mm, np.zeros(0), y, Z, evidence)
        found.append(np.log(likeliest(joint, at, FEW)))
    off = np.mean(found, axis=0) - np.log(true)
    assert abs(off[0]) < FOUND
    assert abs(off[1]) < FOUND


def test_neighbouring_postures_tell_little_of_what_is_smooth():
    """A constant over the seven postures of a motion: between one number and three, not seven."""
    shoulders = joint_fit().shoulders
    white = whitening(shoulders, Discrepancy(0.05, 1.0, 0.01, 0.01, 0.01, 60.0))
    ones = [inverse @ np.ones(len(rows)) for rows, inverse in zip(white.rows, white.inverse_root, strict=True)]
    numbers = sum(float(one @ one) for one in ones) / (len(shoulders.subjects) * len(shoulders.kinds))
    assert 0.9 < numbers < 3.0
