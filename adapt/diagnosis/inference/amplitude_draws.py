"""Draws of the amplitudes of a fit: what the noise leaves open, and what other persons and motions would say.

The fit a* has the Hessian H of E + prior, and motion c of a subject the gradient g_c, the adapted parameters of every
subject taken out. A draw is (BayesBag, Huggins and Miller 2023)

    a = a* - H^-1 sum_c (weight_c - 1) g_c + chol(2 w v / (6 m) H^-1) normal

with the weights of the bootstrap that the probabilities use, v the variance of one of the three components of y that
the unseen folds show, and m the independent postures of a subject; 6 because J_p is |y|^2 / 6.
"""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.inference.weights import fold_weights
from models.adapted_parameters import ADAPTED
from models.girdle import CONSTRAINTS
from motions.table import ANGLES

_N = len(ADAPTED)

_DRAWS, _NOISE_SEED, _WEIGHT_SEED = 400, 5, 6


def draws_of(search: Search, node: Node) -> Float[np.ndarray, "draws own"]:
    """Draw the amplitudes of a fit, in the order of its hypothesis."""
    scale = search.joint.candidates.scale[search.joint.candidates.where(node.hypothesis)]
    hessian, scores, person = scores_by_motion(search, node)
    # in units of the prior the Hessian is at least 2 I, whatever the data hold
    root = np.linalg.cholesky(hessian * np.outer(scale, scale))
    normal = np.random.default_rng(_NOISE_SEED).standard_normal((len(scale), _DRAWS))
    noise = _noise_sd(search, node) * np.linalg.solve(root.T, normal)
    resampled = (1.0 - fold_weights(person, _DRAWS, _WEIGHT_SEED)) @ scores * scale
    others = np.linalg.solve(root.T, np.linalg.solve(root, resampled.T))
    return node.fitted.amplitude[0] + scale * (noise + others).T


def _noise_sd(search: Search, node: Node) -> float:
    """Compute the square root of 2 w v / (6 m)."""
    constraints, subjects = len(CONSTRAINTS), len(search.joint.shoulders.subjects)
    variance = float(search.folds.by_fold(node.predicted.squares.sum(axis=1)).mean()) / constraints
    postures = search.independence.numbers / constraints * len(search.folds.subject) / subjects
    return float(np.sqrt(2.0 * search.joint.model.weight * variance / (len(ANGLES) * postures)))


def scores_by_motion(search: Search, node: Node) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give H, and g_c and the person of each motion of each subject."""
    linearised, shoulders = node.linearised, search.joint.shoulders
    where = search.joint.candidates.where(node.hypothesis)
    _, matrices = linearised.normal_equations(where)
    gradients = linearised.gradients(where)
    hessian = np.diag(2.0 / search.joint.candidates.scale[where] ** 2)
    scores, person = [], []
    for k in range(len(shoulders.subjects)):
        theta, (lower, upper) = node.fitted.theta_mm[k], search.joint.model.bounds_mm[:, k]
        free = np.flatnonzero((theta > lower) & (theta < upper))
        own, cross = matrices[k][np.ix_(free, free)], matrices[k][free, _N:]
        follows = np.linalg.solve(own, cross)
        hessian = hessian + matrices[k][_N:, _N:] - cross.T @ follows
        scores.append(gradients[k][:, _N:] - gradients[k][:, free] @ follows)
        person.append(np.full(len(gradients[k]), shoulders.person[k]))
    return hessian, np.concatenate(scores), np.concatenate(person)
