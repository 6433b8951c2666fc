"""The stiffness of a posture's matrix: the least that makes it positive definite, ten times as much, or none."""

import jax
import numpy as np

from adapt.elimination import STIFFER, STIFFNESS, Elimination
from adapt.newton import PIVOT_FLOOR
from models import load_model
from models.derivatives import chain, feet
from motions.rotations import DEG
from motions.simulation import simulate_subjects

WEIGHT = 1000.0
"""Of every angle; any number would do."""


def pivots(K: np.ndarray) -> np.ndarray:
    """D of K = L D L'."""
    L = np.linalg.cholesky(K)
    return np.diag(L) ** 2


def definite(K: np.ndarray) -> bool:
    try:
        return bool((pivots(K) > PIVOT_FLOOR * WEIGHT).all())
    except np.linalg.LinAlgError:
        return False


def test_no_more_stiffness_than_it_takes():
    """Postures with multipliers so large that many are at no minimum: each case is met, and told by LAPACK."""
    q = simulate_subjects(20, seed=3).angles_deg.T / DEG
    count = q.shape[1]
    girdle = jax.tree.map(lambda x: np.repeat(np.asarray(x)[..., None], count, axis=-1), load_model("R2").girdle)
    theta = [*girdle.centre_mm[1:], *girdle.semi_axes_mm, girdle.conoid_length_mm]
    multipliers = np.random.default_rng(8).normal(size=(3, count)) * 40.0
    at = chain(girdle, list(q), theta, list(multipliers), feet(girdle, list(q), theta))
    weights = [np.full(count, WEIGHT)] * 6
    found = Elimination(at, weights, [np.zeros(count)] * 6, parameters=False)

    G = np.array(at.G)
    H = np.empty((6, 6, count))
    for i in range(6):
        for j in range(i + 1):
            H[i, j] = H[j, i] = at.qq[i][j] + (WEIGHT if i == j else 0.0)
    least = STIFFNESS * WEIGHT / (G**2).sum(axis=1)
    met = []
    for k in range(count):
        enough = [s for s in (1.0, STIFFER) if definite(H[..., k] + G[..., k].T @ (s * least[:, k, None] * G[..., k]))]
        assert found.convex[k] == bool(enough)
        expected = least[:, k] * (enough[0] if enough else STIFFER)
        np.testing.assert_allclose([s[k] for s in found.stiffness], expected, rtol=1e-12)
        met.append(enough[0] if enough else None)
    assert {1.0, STIFFER, None} == set(met)
