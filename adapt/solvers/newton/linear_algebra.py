"""Small dense linear algebra by components: every number of a vector or a matrix is an array over the problems.

A batch costs one LAPACK call per matrix. For 3 x 3 and 6 x 6 the loops below, unrolled while a kernel is written, are
many times faster, and they run on numpy arrays, on JAX arrays and in machine code.
"""

from motions.arrays import Array, xp

Components = list[Array]
"""Vector as a list of its components."""

Rows = list[Components]
"""Lower triangle of a matrix: row i has its first i (or i + 1) elements."""


def largest(components: Components) -> Array:
    """Find max |x_i|."""
    result = abs(components[0])
    for x in components[1:]:
        result = xp.maximum(result, abs(x))
    return result


def product(a: Components, b: Components) -> Array:
    """Compute the inner product sum a_i b_i."""
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def column(rows: list[Components], k: int) -> Components:
    """Take the k-th entry of each row."""
    return [row[k] for row in rows]


def factorised(rows: Rows, floor: Array) -> tuple[Rows, Components, Array]:
    """Factorise A = L D L', given by its lower triangle; a pivot below ``floor`` is raised to it.

    Return L below its diagonal, 1 / D, and where no pivot was below ``floor``.
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


def forward(lower: Rows, b: Components) -> Components:
    """Solve L x = b: x = L^-1 b."""
    x = list(b)
    for i in range(len(x)):
        for j in range(i):
            x[i] = x[i] - lower[i][j] * x[j]
    return x


def backward(lower: Rows, b: Components) -> Components:
    """Solve L' x = b: x = L'^-1 b."""
    x = list(b)
    for i in reversed(range(len(x))):
        for j in range(i + 1, len(x)):
            x[i] = x[i] - lower[j][i] * x[j]
    return x
