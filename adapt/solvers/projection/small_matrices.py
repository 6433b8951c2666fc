"""Linear algebra of small matrices, written out: machine code has no LAPACK."""

import functools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motions.arrays import Array


def symmetric_solve(A: Float[Array, "n n"], B: Float[Array, "n m"]) -> tuple[Float[Array, "n m"], Array]:
    """Compute A^-1 B of a symmetric A by L D L', and the smallest pivot."""
    n = len(A)
    L, D = [[jnp.zeros(())] * n for _ in range(n)], []
    for j in range(n):
        D.append(A[j, j] - sum((L[j][k] ** 2 * D[k] for k in range(j)), jnp.zeros(())))
        for i in range(j + 1, n):
            L[i][j] = (A[i, j] - sum((L[i][k] * L[j][k] * D[k] for k in range(j)), jnp.zeros(()))) / D[j]
    x = [B[i] for i in range(n)]
    for i in range(n):
        x[i] = x[i] - sum((L[i][j] * x[j] for j in range(i)), jnp.zeros(()))
    x = [one / d for one, d in zip(x, D, strict=True)]
    for i in reversed(range(n)):
        x[i] = x[i] - sum((L[j][i] * x[j] for j in range(i + 1, n)), jnp.zeros(()))
    return jnp.stack(x), functools.reduce(jnp.minimum, D)


def inverse_root(V: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    """Compute the inverse of the lower Cholesky factor."""
    a = jnp.sqrt(V[0, 0])
    b, d = V[1, 0] / a, V[2, 0] / a
    c = jnp.sqrt(V[1, 1] - b * b)
    e = (V[2, 1] - d * b) / c
    f = jnp.sqrt(V[2, 2] - d * d - e * e)
    zero = jnp.zeros(())
    p, q, r = 1.0 / a, 1.0 / c, 1.0 / f
    s, u = -b * p * q, -e * q * r
    return jnp.stack([jnp.stack([p, zero, zero]), jnp.stack([s, q, zero]), jnp.stack([-(d * p + e * s) * r, u, r])])


def null_basis(G: Float[Array, "m n"]) -> Float[Array, "n n-m"]:
    """Compute orthonormal columns x with G x = 0, by the Householder reflections that make G' triangular."""
    m, n = G.shape
    columns, mirrors = [G[k] for k in range(m)], []
    for k in range(m):
        below = columns[k][k:]
        size = jnp.sqrt(jnp.sum(below * below))
        away = below[0] + jnp.where(below[0] < 0.0, -size, size)  # the sign avoids cancellation
        mirror = jnp.concatenate([jnp.zeros(k), away[None], below[1:]])
        mirrors.append(mirror * jnp.sqrt(2.0 / jnp.sum(mirror * mirror)))
        columns = [_reflected(one, mirrors[-1]) for one in columns]
    last = [jnp.asarray(one) for one in np.eye(n)[m:]]
    return jnp.stack([functools.reduce(_reflected, reversed(mirrors), one) for one in last], axis=1)


def _reflected(x: Float[Array, " n"], mirror: Float[Array, " n"]) -> Float[Array, " n"]:
    return x - mirror * jnp.sum(mirror * x)
