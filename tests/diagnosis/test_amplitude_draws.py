"""The covariance of the amplitudes against refits of the linear model to data drawn from what it says."""

import numpy as np
from small_worlds import searched

from adapt.diagnosis.inference.amplitude_draws import amplitude_covariance, draws_of
from models.adapted_parameters import ADAPTED, PERSON_SD_MM

BIAS = "scapula_landmark_bias"
N = len(ADAPTED)

DRAWS = 4000
CHANCE = 0.12
"""Relative, of a covariance of so many draws: five standard errors."""


def test_the_covariance_is_that_of_refits_to_other_noise_discrepancies_thoraces_and_amplitudes():
    """All parameters at once, by one dense system, the bounds being far."""
    search = searched(BIAS)
    joint, linearised = search.joint, search.adaptation((BIAS,))
    where, white = joint.candidates.where((BIAS,)), search.likelihood.whitening
    matrices = linearised.matrices(where)
    subjects, own = len(white.rows), len(where)
    system = np.zeros((subjects * N + own, subjects * N + own))
    shared = slice(subjects * N, None)
    system[shared, shared] = np.diag(2.0 / joint.candidates.scale[where] ** 2)
    generator = np.random.default_rng(2)
    right = np.zeros((len(system), DRAWS))
    curves = generator.standard_normal((3, white.curves[0].shape[1], DRAWS))
    mean_thorax = generator.standard_normal((N, DRAWS))
    for subject, rows in enumerate(white.rows):
        mine = slice(subject * N, (subject + 1) * N)
        system[mine, mine] += matrices[subject][:N, :N]
        system[mine, shared] += matrices[subject][:N, N:]
        system[shared, mine] += matrices[subject][N:, :N]
        system[shared, shared] += matrices[subject][N:, N:]
        root = np.linalg.inv(white.inverse_root[subject])
        off = np.einsum("rq,cqd->rcd", root, generator.standard_normal((3, len(rows), DRAWS)))
        off += np.einsum("rj,cjd->rcd", root @ white.curves[subject], curves)
        Z = linearised.Z[rows][..., np.concatenate([np.arange(N), N + where])]
        sd = search.likelihood.between * joint.candidates.scale[where]
        off += np.einsum("rca,ad->rcd", Z[..., N:], sd[:, None] * generator.standard_normal((own, DRAWS)))
        weight = 2.0 * joint.model.weight * joint.shoulders.weights[rows] / len(rows)
        slope = np.einsum("r,rca,rcd->ad", weight, Z, off)
        thorax = PERSON_SD_MM[:, None] * (generator.standard_normal((N, DRAWS)) + mean_thorax)
        slope[:N] += linearised.thorax.matrix[subject] @ thorax
        right[mine] += slope[:N]
        right[shared] += slope[N:]
    moved = -np.linalg.solve(system, right)[shared]
    found = amplitude_covariance(search, (BIAS,))
    sd = np.sqrt(np.diag(found))
    np.testing.assert_allclose(np.cov(moved) / np.outer(sd, sd), found / np.outer(sd, sd), atol=CHANCE)


def test_draws_spread_about_the_fit_as_the_covariance_says():
    search = searched(BIAS)
    found, draws = amplitude_covariance(search, (BIAS,)), draws_of(search, (BIAS,))
    error = np.sqrt(np.diag(found) / len(draws))
    assert (np.abs(draws.mean(axis=0) - search.adaptation((BIAS,)).fitted.amplitude[0]) < 4.0 * error).all()
    np.testing.assert_allclose(draws.std(axis=0), np.sqrt(np.diag(found)), rtol=0.2)
