"""Small dense linear algebra and derivatives, written out and elementwise over a trailing batch.

LAPACK through a batched call costs one library call a matrix on a CPU; for 3 x 3 and 6 x 6 the loops below, unrolled
while tracing, are many times faster there and on a GPU, and they batch, differentiate and transpose like arithmetic.
Vectors are ``(n, *batch)``, matrices ``(m, n, *batch)``.
"""

from collections.abc import Callable

import jax
from jaxtyping import Bool, Float

from motions.arrays import Array, xp

ElementwiseFunction = Callable[[Float[Array, " n *batch"]], Array]
"""A function whose output at one element of the batch depends on its input at that element alone."""


def matvec(A: Float[Array, " m n *batch"], x: Float[Array, " n *batch"]) -> Float[Array, " m *batch"]:
    """Multiply A x."""
    return xp.sum(A * x[None], axis=1)


def matmul(A: Float[Array, " m n *batch"], B: Float[Array, " n k *batch"]) -> Float[Array, " m k *batch"]:
    """Multiply A B."""
    return xp.sum(A[:, :, None] * B[None], axis=1)


def transpose(A: Float[Array, " m n *batch"]) -> Float[Array, " n m *batch"]:
    """Transpose A; the batch stays untouched."""
    return xp.swapaxes(A, 0, 1)


def diagonal(d: Float[Array, " n *batch"]) -> Float[Array, " n n *batch"]:
    """Build the diagonal matrix diag(d)."""
    return xp.eye(d.shape[0]).reshape(d.shape[0], d.shape[0], *[1] * (d.ndim - 1)) * d[None]


def trace(A: Float[Array, " n n *batch"]) -> Float[Array, " *batch"]:
    """Sum the diagonal."""
    return xp.trace(A, axis1=0, axis2=1)


def largest(x: Float[Array, " n *batch"]) -> Float[Array, " *batch"]:
    """Find max |x_i|."""
    return xp.max(abs(x), axis=0)


Rows = list[list[Array]]
"""The lower triangle of a matrix, entry by entry: row i has its first i (or i + 1) elements."""


def factorised(rows: Rows, floor: Array) -> tuple[Rows, list[Array], Array]:
    """Factorise A = L D L', given by its lower triangle; a pivot below ``floor`` is raised to it.

    The result is L below its diagonal, 1 / D and where no pivot was below ``floor``.
    """
    n = len(rows)
    lower: Rows = [list(row[:-1]) for row in rows]
    pivots, inverse, positive = [], [], floor <= floor
    for j in range(n):
        scaled = [lower[j][k] * pivots[k] for k in range(j)]
        pivot = rows[j][j] - sum(lower[j][k] * scaled[k] for k in range(j))
        positive &= pivot > floor
        pivots.append(xp.maximum(pivot, floor))
        inverse.append(1.0 / pivots[j])
        for i in range(j + 1, n):
            inner = sum(lower[i][k] * scaled[k] for k in range(j))
            lower[i][j] = (rows[i][j] - inner) * inverse[j]
    return lower, inverse, positive


def forward(lower: Rows, b: list[Array]) -> list[Array]:
    """Solve L x = b: x = L^-1 b, b a list of components."""
    x = list(b)
    for i in range(len(x)):
        for j in range(i):
            x[i] = x[i] - lower[i][j] * x[j]
    return x


def backward(lower: Rows, b: list[Array]) -> list[Array]:
    """Solve L' x = b: x = L'^-1 b, b a list of components."""
    x = list(b)
    for i in reversed(range(len(x))):
        for j in range(i + 1, len(x)):
            x[i] = x[i] - lower[j][i] * x[j]
    return x


class Factor:
    """A = L D L' of a symmetric matrix. A pivot below ``floor`` is raised to it, so the factor is positive definite.

    ``positive`` tells where no pivot was raised, that is, where the factor is that of A itself.
    """

    positive: Bool[Array, " *batch"]

    def __init__(self, A: Float[Array, " n n *batch"], floor: Float[Array, " *batch"]):
        rows = [[A[i, j] for j in range(i + 1)] for i in range(A.shape[0])]
        self.lower, self.inverse_pivots, self.positive = factorised(rows, floor)

    def solve(self, B: Float[Array, " n k *batch"]) -> Float[Array, " n k *batch"]:
        """Solve A X = B: X = A^-1 B."""
        n = len(self.inverse_pivots)
        x = [B[i] for i in range(n)]
        for i in range(n):
            for j in range(i):
                x[i] = x[i] - self.lower[i][j][None] * x[j]
        x = [x[i] * self.inverse_pivots[i][None] for i in range(n)]
        for i in reversed(range(n)):
            for j in range(i + 1, n):
                x[i] = x[i] - self.lower[j][i][None] * x[j]
        return xp.stack(x)

    def solve_vector(self, b: Float[Array, " n *batch"]) -> Float[Array, " n *batch"]:
        """Solve A x = b: x = A^-1 b."""
        return self.solve(b[:, None])[:, 0]

    def otherwise(self, other: "Factor") -> "Factor":
        """Take this factor where it is positive, the other one elsewhere."""

        def pick(mine, others):
            return xp.where(self.positive, mine, others)

        result = object.__new__(Factor)
        result.lower = [
            [pick(a, b) for a, b in zip(*rows, strict=True)] for rows in zip(self.lower, other.lower, strict=True)
        ]
        result.inverse_pivots = [pick(a, b) for a, b in zip(self.inverse_pivots, other.inverse_pivots, strict=True)]
        result.positive = self.positive | other.positive
        return result


def jacobian(f: ElementwiseFunction, x: Float[Array, " n *batch"]) -> Float[Array, " m n *batch"]:
    """Differentiate an elementwise function, df/dx: n forward passes, batched."""
    n = x.shape[0]
    basis = xp.eye(n).reshape(n, n, *[1] * (x.ndim - 1))

    def column(direction):
        return jax.jvp(f, (x,), (xp.broadcast_to(direction, x.shape),))[1]

    return jax.vmap(column, out_axes=1)(basis)


def gradient(f: ElementwiseFunction, x: Float[Array, " n *batch"]) -> Float[Array, " n *batch"]:
    """Differentiate a scalar elementwise function, df/dx: one reverse pass."""
    return jax.grad(lambda x: xp.sum(f(x)))(x)


def hessian(f: ElementwiseFunction, x: Float[Array, " n *batch"]) -> Float[Array, " n n *batch"]:
    """Compute the second derivatives of a scalar elementwise function, forward over reverse."""
    return jacobian(lambda y: gradient(f, y), x)
