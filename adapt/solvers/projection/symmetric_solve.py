"""The solution of a small symmetric system, written out: machine code has no LAPACK."""

import functools

import jax.numpy as jnp
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
