"""Draws of the amplitudes of an adaptation: what noise, and all that no cause explains, leave open.

The adaptation a* minimises E + prior, whose Hessian in the amplitudes is H with the adapted parameters of every
shoulder taken out. The slope there is off by S e + T d + U v if y is off by e, the thorax of the persons by d from that
of the set, and the amplitudes of a shoulder by v from their mean. e has the covariance C of ``fit.discrepancy``, d and
v those of ``fit.evidence``, P and Q:

    a ~ N(a*, H^-1 (S C S' + T P T' + U Q U') H^-1)
"""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.search import Search
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_DRAWS, _SEED = 400, 5


def draws_of(search: Search, hypothesis: Hypothesis) -> Float[np.ndarray, "draws own"]:
    """Draw the amplitudes of a hypothesis, in its order."""
    scale = search.joint.candidates.scale[search.joint.candidates.where(hypothesis)]
    variances, vectors = np.linalg.eigh(amplitude_covariance(search, hypothesis) / np.outer(scale, scale))
    normal = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(scale)))
    off = normal * np.sqrt(np.maximum(variances, 0.0)) @ vectors.T  # rounding may leave less than 0
    return search.adaptation(hypothesis).fitted.amplitude[0] + scale * off


def amplitude_covariance(search: Search, hypothesis: Hypothesis) -> Float[np.ndarray, "own own"]:
    """Compute H^-1 (S C S' + T P T' + U Q U') H^-1."""
    adaptation, joint = search.adaptation(hypothesis), search.joint
    likelihood, where = search.likelihood, joint.candidates.where(hypothesis)
    white, sd = likelihood.whitening, likelihood.between * joint.candidates.scale[where]
    matrices = adaptation.matrices(where)
    hessian = np.diag(2.0 / joint.candidates.scale[where] ** 2)
    own, common, thorax = np.zeros(hessian.shape), 0.0, 0.0
    for subject, rows in enumerate(white.rows):
        theta, (lower, upper) = adaptation.fitted.theta_mm[subject], joint.model.bounds_mm[:, subject]
        free = np.flatnonzero((theta > lower) & (theta < upper))
        cross = matrices[subject][free, _N:]
        follows = np.linalg.solve(matrices[subject][np.ix_(free, free)], cross)
        hessian += matrices[subject][_N:, _N:] - cross.T @ follows
        Z = adaptation.Z[rows]
        slopes = Z[..., _N + where] - Z[..., free] @ follows
        weight = 2.0 * joint.model.weight * joint.shoulders.weights[rows] / len(rows)
        root = np.linalg.inv(white.inverse_root[subject])
        by_number = np.einsum("rq,rca->qca", root * weight[:, None], slopes)
        own += np.einsum("qca,qcb->ab", by_number, by_number)
        common = common + np.einsum("qca,qj->acj", by_number, white.curves[subject])
        by_amplitudes = np.einsum("rca,rcb->ab", weight[:, None, None] * slopes, Z[..., _N + where]) * sd
        own += by_amplitudes @ by_amplitudes.T
        by_thorax = follows.T @ adaptation.thorax.matrix[subject][free] * likelihood.sd_mm[subject]
        own += by_thorax @ by_thorax.T
        thorax = thorax + by_thorax
    shared = np.concatenate([np.reshape(common, (len(where), -1)), thorax], axis=1)
    inverse = np.linalg.inv(hessian)
    return inverse @ (own + shared @ shared.T) @ inverse
