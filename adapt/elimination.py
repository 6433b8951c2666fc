"""One posture's conditions eliminated, by components: ``adapt.newton.eliminate`` written for speed.

With H = W + d2(lambda'g)/dq2, C = d2(lambda'g)/dq dtheta and the stiffness s = diag(s_k) on the range of G', which
changes no solution since G dq + T dtheta = -g:

    L D L' = H + G' s G =: K,   S = G K^-1 G',   rho = g - G K^-1 W (q - s),   tau = T - G K^-1 C
    mu = S^-1 (rho + tau dtheta),   lambda = mu - s (g + T dtheta),   dq = -K^-1 (W (q - s) + C dtheta + G' mu)

A posture whose K is not positive definite is no minimum there and goes without curvature, C and s (Gauss-Newton).
"""

from adapt.linalg import backward, factorised, forward
from adapt.newton import PIVOT_FLOOR, UNMEASURED_WEIGHT
from models.derivatives import Chain
from motions.arrays import Array, xp

STIFFNESS = 20.0
"""s_k |G_k|^2 over the largest weight: makes H definite on the range of G' (see ``adapt.newton``). Of 5 to 100 the
one with the fewest iterations on simulated subjects."""

Components = list[Array]


def largest(components: Components) -> Array:
    """max |x_i|."""
    result = abs(components[0])
    for x in components[1:]:
        result = xp.maximum(result, abs(x))
    return result


def product(a: Components, b: Components) -> Array:
    """sum a_i b_i."""
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def column(rows: list[Components], k: int) -> Components:
    """The k-th entry of each row."""
    return [row[k] for row in rows]


def augmented(target: Components, stiffness: Components, g: Components) -> Array:
    """lambda'g + 1/2 g' s g: what the merit adds to the objective."""
    return product([m + 0.5 * s * x for m, s, x in zip(target, stiffness, g, strict=True)], g)


def stationarity(at: Chain, pull: Components, multipliers: Components) -> Array:
    """max |W (q - s) + G' lambda|."""
    return largest([x + product(column(at.G, k), multipliers) for k, x in enumerate(pull)])


class Elimination:
    """dq and lambda of postures as affine functions of the parameters' steps; ``pull`` is W (q - s).

    ``coupled`` parameters are the first ones of T that have a C; without any it is the step of a posture fit.
    """

    def __init__(self, at: Chain, weights: Components, pull: Components, T: list[Components], coupled: int):
        scale = weights[0]
        for w in weights[1:]:
            scale = xp.maximum(scale, w)
        damped = [xp.maximum(w, UNMEASURED_WEIGHT * scale) for w in weights]
        self.at, self.T, self.coupled = at, T, coupled
        self.stiffness = [STIFFNESS * scale / product(row, row) for row in at.G]
        stiff = [[s * x for x in row] for s, row in zip(self.stiffness, at.G, strict=True)]
        K = [[at.qq[i][j] + product(column(stiff, i), column(at.G, j)) for j in range(i + 1)] for i in range(6)]
        for i, w in enumerate(damped):
            K[i][i] += w
        L, inverse, convex = factorised(K, PIVOT_FLOOR * scale)
        self.convex = convex
        self.lower = [[xp.where(convex, x, 0.0) for x in row] for row in L]
        self.inverse = [xp.where(convex, x, 1.0 / w) for x, w in zip(inverse, damped, strict=True)]
        self.used = [xp.where(convex, s, 0.0) for s in self.stiffness]
        C = [[xp.where(convex, x, 0.0) for x in column(at.qu, k)] for k in range(coupled)]
        self.sides = [forward(self.lower, side) for side in (*at.G, *C, pull)]
        self.weighed = [[x * d for x, d in zip(side, self.inverse, strict=True)] for side in self.sides]
        S = [[self._gram(i, j) for j in range(i + 1)] for i in range(3)]
        self._S, self._S_inverse, _ = factorised(S, 0.0 * scale)
        rho = [g - self._gram(i, -1) for i, g in enumerate(at.g)]
        columns = len(T[0]) if T else 0
        self.tau = [column(T, k) for k in range(columns)]
        for k in range(coupled):
            self.tau[k] = [x - self._gram(i, 3 + k) for i, x in enumerate(self.tau[k])]
        self.constant, self.linear = self._solved(rho), [self._solved(x) for x in self.tau]

    def _gram(self, a: int, b: int) -> Array:
        return product(self.sides[a], self.weighed[b])

    def _solved(self, b: Components) -> Components:
        return backward(self._S, [x * d for x, d in zip(forward(self._S, b), self._S_inverse, strict=True)])

    def slope(self, i: int) -> Array:
        """What the postures add to the right-hand side of parameter i, after their own steps."""
        b = product(self.tau[i], self.constant)
        b -= sum(s * row[i] * g for s, row, g in zip(self.used, self.T, self.at.g, strict=True))
        return b - self._gram(3 + i, -1) if i < self.coupled else b

    def curvature(self, i: int, j: int) -> Array:
        """What they add to the matrix, U - C' K^-1 C + tau' S^-1 tau - T' s T."""
        entry = product(self.tau[i], self.linear[j])
        entry -= sum(s * row[i] * row[j] for s, row in zip(self.used, self.T, strict=True))
        if i >= self.coupled:
            return entry
        return entry + xp.where(self.convex, self.at.uu[i][j], 0.0) - self._gram(3 + i, 3 + j)

    def moved(self, d: Components) -> tuple[Components, Components]:
        """dq and the new lambda for the parameters' steps d."""
        mu = self.constant
        if d:
            mu = [c + product(column(self.linear, i), d) for i, c in enumerate(mu)]
        multipliers = [
            m - s * (g + product(row, d) if d else g)
            for m, s, g, row in zip(mu, self.used, self.at.g, self.T or [[]] * 3, strict=True)
        ]
        back = []
        for i in range(6):
            x = self.weighed[-1][i] + product(column(self.weighed[:3], i), mu)
            if d:
                x += product(column(self.weighed[3:-1], i), d[: self.coupled])
            back.append(-x)
        return backward(self.lower, back), multipliers
