"""One Newton step of a posture's optimality conditions, with the adapted parameters left free, by components.

The angles q of a posture minimise 1/2 (q - s)' W (q - s) subject to g(q, theta) = 0. The optimality conditions,
linearised at (q, theta) with multipliers lambda, are nine equations:

    H dq + C dtheta + G' lambda = -W (q - s),    G dq + T dtheta = -g

With H = W + d2(lambda'g)/dq2, C = d2(lambda'g)/dq dtheta and a penalty s = diag(s_k) on the range of G', which changes
no solution:

    L D L' = H + G' s G =: K,   S = G K^-1 G',   rho = g - G K^-1 W (q - s),   tau = T - G K^-1 C
    mu = S^-1 (rho + tau dtheta),   lambda = mu - s (g + T dtheta),   dq = -K^-1 (W (q - s) + C dtheta + G' mu)

A posture whose K is not positive definite, even with a larger penalty, is at no minimum; its step omits the curvature,
C and s (Gauss-Newton).
"""

from typing import NamedTuple

from adapt.solvers.newton.linear_algebra import (
    Components,
    Rows,
    backward,
    column,
    factorised,
    forward,
    largest,
    product,
)
from adapt.solvers.solution import CONSTRAINT_TOLERANCE_MM, STATIONARITY_TOLERANCE
from adapt.solvers.unmeasured import damped
from models.adapted_parameters import ELLIPSOID
from models.derivatives import ConstraintDerivatives
from motions.arrays import Array, ByType, repeat_while, xp

RANGE_SPACE_PENALTY = 20.0
"""Penalty s_k |G_k|^2 relative to the largest weight. It makes K positive definite where H is so on the tangent space,
the condition of a minimum. Among values of 5 to 100 it needs the fewest iterations on simulated subjects."""

STEP_LIMIT_RAD = 0.6
"""Longest step of one angle: the linearisation of a rotation has no meaning beyond it."""

PENALTY_GROWTH = 10.0
"""Factor on the penalty where K is not positive definite although H may be so on the tangent space."""

PIVOT_FLOOR = 1e-4
"""Smallest pivot, relative to the largest weight, that counts as positive definite; float32 rounds to a thousandth of
it. Flatter problems continue with the Newton steps of ``adapt.solvers.projection.postures``."""

CLOSED_MM = ByType(CONSTRAINT_TOLERANCE_MM, 5e-4)
"""Tolerance of |g|. In float32 rounding leaves 5e-5 mm, as much as 1e-7 of an ellipsoid of 400 mm."""

STATIONARY = ByType(STATIONARITY_TOLERANCE, 1e-4)
"""Tolerance of |dJ/dq + G' lambda|, deg^2 per degree. In float32 rounding leaves 1e-5."""


def augmented(target: Components, range_space_penalty: Components, g: Components) -> Array:
    """Compute lambda'g + 1/2 g' s g, which the merit adds to the objective."""
    return product([m + 0.5 * s * x for m, s, x in zip(target, range_space_penalty, g, strict=True)], g)


def stationarity(at: ConstraintDerivatives, objective_gradient: Components, multipliers: Components) -> Array:
    """Compute max |W (q - s) + G' lambda|."""
    return largest([x + product(column(at.G, k), multipliers) for k, x in enumerate(objective_gradient)])


def _parameter_slopes(T: list[Components]) -> list[Components]:
    """Build the three rows of dg/dtheta from d(A1, A2)/du of the ellipsoid; empty rows without parameters."""
    if not T:
        return [[], [], []]
    zero = xp.zeros_like(T[0][0])
    return [[*row, zero] for row in T] + [[zero] * len(ELLIPSOID) + [zero - 1.0]]


class Steps(NamedTuple):
    """dq and lambda of postures as affine functions of the steps of the parameters: the result of an elimination."""

    lower: Rows
    """L of K."""
    weighed: list[Components]
    """D^-1 L^-1 of G', C and W (q - s)."""
    constant: Components
    linear: list[Components]
    """mu = constant + linear dtheta, one entry per parameter."""
    used: Components
    """s; 0 where the step is Gauss-Newton."""
    T: list[Components]
    """d(A1, A2)/du."""
    g: Components

    def moved(self, d: Components) -> tuple[Components, Components]:
        """Compute dq and the new lambda for the steps d of the parameters."""
        mu, open_chain = self.constant, self.g
        if d:
            mu = [c + product(column(self.linear, i), d) for i, c in enumerate(mu)]
            slopes = _parameter_slopes(self.T)
            open_chain = [g + product(row, d) for g, row in zip(self.g, slopes, strict=True)]
        multipliers = [m - s * g for m, s, g in zip(mu, self.used, open_chain, strict=True)]
        back = []
        for i in range(6):
            x = self.weighed[-1][i] + product(column(self.weighed[:3], i), mu)
            if d:
                x = x + product(column(self.weighed[3:-1], i), d[: len(ELLIPSOID)])
            back.append(-x)
        return backward(self.lower, back), multipliers


def _convex_factor(H: Rows, G: list[Components], scale: Array) -> tuple[Components, Rows, Components, Array]:
    """Factorise L D L' = H + G' s G with the first penalty, or a larger one where a pivot is too small. Return s, L
    below its diagonal, 1 / D, and whether no pivot is below the floor."""

    def unfinished(tried) -> Array:
        attempts, *_, convex = tried
        return xp.any(~convex & (attempts < 2.0))

    def more_penalised(tried):
        attempts, s, *_, convex = tried
        again = ~convex & (attempts > 0.0)
        s = [xp.where(again, PENALTY_GROWTH * x, x) for x in s]
        stiff = [[x * y for y in row] for x, row in zip(s, G, strict=True)]
        K = [[x + product(column(stiff, i), column(G, j)) for j, x in enumerate(row)] for i, row in enumerate(H)]
        return attempts + 1.0, s, *factorised(K, PIVOT_FLOOR * scale)

    zero = xp.zeros_like(scale)
    least = [RANGE_SPACE_PENALTY * scale / product(row, row) for row in G]
    nothing = zero, least, [[zero] * i for i in range(6)], [zero] * 6, zero > 0.0
    _, *found = repeat_while(unfinished, more_penalised, nothing)
    return tuple(found)  # pyright: ignore[reportReturnType]


class Elimination:
    """Terms of a posture in the system of the parameters, and its ``steps``; ``objective_gradient`` is W (q - s).

    Without ``parameters`` the elimination is the step of a posture fit.
    """

    def __init__(
        self, at: ConstraintDerivatives, weights: Components, objective_gradient: Components, parameters: bool
    ):
        scale = weights[0]
        for w in weights[1:]:
            scale = xp.maximum(scale, w)
        floored = damped(weights, scale)
        self._at, self._coupled = at, len(ELLIPSOID) if parameters else 0
        self._T = _parameter_slopes(at.T if parameters else [])
        H = [[x + floored[i] if i == j else x for j, x in enumerate(row)] for i, row in enumerate(at.qq)]
        self.range_space_penalty, lower, inverse, self.convex = _convex_factor(H, at.G, scale)
        lower = [[xp.where(self.convex, x, 0.0) for x in row] for row in lower]
        inverse = [xp.where(self.convex, x, 1.0 / w) for x, w in zip(inverse, floored, strict=True)]
        used = [xp.where(self.convex, s, 0.0) for s in self.range_space_penalty]
        C = [[xp.where(self.convex, x, 0.0) for x in column(at.qu, k)] for k in range(self._coupled)]
        self._sides = [forward(lower, side) for side in (*at.G, *C, objective_gradient)]
        self._weighed = [[x * d for x, d in zip(side, inverse, strict=True)] for side in self._sides]
        S = [[self._gram(i, j) for j in range(i + 1)] for i in range(3)]
        self._S, self._S_inverse, _ = factorised(S, xp.zeros_like(scale))
        rho = [g - self._gram(i, -1) for i, g in enumerate(at.g)]
        self._tau = [column(self._T, k) for k in range(len(self._T[0]))]
        for k in range(self._coupled):
            self._tau[k] = [x - self._gram(i, 3 + k) for i, x in enumerate(self._tau[k])]
        constant, linear = self._solved(rho), [self._solved(x) for x in self._tau]
        self.steps = Steps(lower, self._weighed, constant, linear, used, at.T if parameters else [], at.g)

    def _gram(self, a: int, b: int) -> Array:
        return product(self._sides[a], self._weighed[b])

    def _solved(self, b: Components) -> Components:
        return backward(self._S, [x * d for x, d in zip(forward(self._S, b), self._S_inverse, strict=True)])

    def step_slope(self, i: int) -> Components:
        """Compute dq / d(parameter i)."""
        mu = self.steps.linear[i]
        sides = [product(column(self._weighed[:3], k), mu) for k in range(6)]
        if i < self._coupled:
            sides = [x + y for x, y in zip(sides, self._weighed[3 + i], strict=True)]
        return backward(self.steps.lower, [-x for x in sides])

    def slope(self, i: int) -> Array:
        """Compute the contribution of the postures to the right-hand side of parameter i, after their own steps."""
        b = product(self._tau[i], self.steps.constant)
        b = b - sum(s * row[i] * g for s, row, g in zip(self.steps.used, self._T, self._at.g, strict=True))
        return b - self._gram(3 + i, -1) if i < self._coupled else b

    def curvature(self, i: int, j: int) -> Array:
        """Compute the contribution of the postures to entry i, j of the matrix,
        U - C' K^-1 C + tau' S^-1 tau - T' s T."""
        entry = product(self._tau[i], self.steps.linear[j])
        entry = entry - sum(s * row[i] * row[j] for s, row in zip(self.steps.used, self._T, strict=True))
        if i >= self._coupled:
            return entry
        return entry + xp.where(self.convex, self._at.uu[i][j], 0.0) - self._gram(3 + i, 3 + j)
