"""ProxQP (proxsuite, dense) on the quadratic subproblems of an SQP, warm-started per subject, one process per core.

Fair in the part of ProxQP: a dense QP of 90 variables, 42 equalities and 6 bounds in each iteration, from exact
derivatives by JAX, all subjects at once and block by block. ProxQP cannot use the fact that theta alone couples the
postures: it has no such interface, and eliminating the postures first would be our method with another solver for six
variables. The SQP around it is ours, in NumPy: ``Share.library`` is the share of the time in ProxQP. Its threaded batch
(``BatchQP``) speeds up this part alone, so each core has a process instead.
"""

import time
from typing import NamedTuple

import jax
import numpy as np

from adapt.engine.compilation_cache import keep_compiled
from adapt.solvers.objective import WEIGHT
from scripts.research.speed.peers.cases import Answer, Cases, cases
from scripts.research.speed.peers.in_jax import InJax
from scripts.research.speed.peers.shares import Share, on_all_cores, timed_share

_CURVATURE = 10.0
"""s of s/2 |g + G dx|^2, 0 at every solution of the QP: makes its Hessian definite without changing the solution."""

_MOST_ITERATIONS, _SMALL_STEP = 50, 1e-7
_SUFFICIENT, _HALVINGS = 1e-4, 12


def run(model: str, count: int, total: int) -> Share:
    """Compute E of the first ``count`` subjects."""
    return on_all_cores(_share, model, count, total)


def _share(model: str, count: int, total: int, first: int, step: int) -> Share:
    keep_compiled()
    given = cases(model, count, total, first, step)
    sqp = _Sqp(InJax(model), given)
    return timed_share(given, sqp.solve, lambda: sqp.proxqp_s)


class _Quadratic(NamedTuple):
    """The QP of every subject: min 1/2 dx'H dx + gradient dx with  G dx = -g."""

    E: np.ndarray
    gradient: np.ndarray
    H: np.ndarray
    g: np.ndarray
    G: np.ndarray


class _Sqp:
    """SQP that minimises E with closed chains, for all subjects of a process."""

    def __init__(self, problem: InJax, given: Cases):
        self.given = given
        self.proxqp_s = 0.0
        self.target = np.array([target.T for target in given.targets_deg])
        self.weight = 2.0 * WEIGHT / self.target[0].size

        def posture(angles, theta, multipliers):
            def g(z):
                return problem.chain(z[:6], z[6:])

            z = jax.numpy.concatenate([angles, theta])
            return g(z), jax.jacfwd(g)(z), jax.hessian(lambda z: multipliers @ g(z))(z)

        def thorax(theta):
            return problem.D(theta), jax.grad(problem.D)(theta), jax.hessian(problem.D)(theta)

        def tried(angles, theta):
            return problem.D(theta), jax.vmap(problem.chain, (0, None))(angles, theta)

        self.postures = jax.jit(jax.vmap(jax.vmap(posture, (0, None, 0))))
        self.thorax = jax.jit(jax.vmap(thorax))
        self.tried = jax.jit(
            jax.vmap(lambda angles, theta: (problem.D(theta), jax.vmap(problem.chain, (0, None))(angles, theta)))
        )

    def solve(self) -> list[Answer]:
        """Solve from the geometric fit and the measured angles."""
        count, P, _ = self.target.shape
        angles, theta = self.target.copy(), np.tile(self.given.theta_mm, (count, 1))
        multipliers, penalty = np.zeros((count, P, 3)), np.zeros(count)
        solvers = [_Qp(6 * P + 6, 3 * P) for _ in range(count)]
        left = np.ones(count, bool)
        for _ in range(_MOST_ITERATIONS):
            at = self.quadratic(angles, theta, multipliers)
            step, proposed = np.zeros((count, 6 * P + 6)), multipliers.copy()
            low, high = (bound - theta for bound in self.given.bounds_mm)
            for k in np.flatnonzero(left):
                start = time.perf_counter()
                step[k], y = solvers[k].solved(at.H[k], at.gradient[k], at.G[k], at.g[k], low[k], high[k])
                self.proxqp_s += time.perf_counter() - start
                proposed[k] = y.reshape(P, 3)
            penalty = np.maximum(penalty, 1.5 * np.abs(proposed).max(axis=(1, 2)))
            length = self.line_search(angles, theta, step, at, penalty)
            angles = angles + length[:, None, None] * step[:, :-6].reshape(angles.shape)
            theta = np.clip(theta + length[:, None] * step[:, -6:], *self.given.bounds_mm)
            multipliers = multipliers + length[:, None, None] * (proposed - multipliers)
            left &= np.abs(step).max(axis=1) > _SMALL_STEP
            if not left.any():
                break
        return [(t, q.T) for t, q in zip(theta, angles, strict=True)]

    def quadratic(self, angles, theta, multipliers) -> _Quadratic:
        """Assemble the blocks of the postures into dense matrices."""
        count, P, _ = angles.shape
        n = 6 * P + 6
        g, slope, curvature = map(np.asarray, self.postures(angles, theta, multipliers))
        D, gradient_D, H_D = map(np.asarray, self.thorax(theta))
        H, G = np.zeros((count, n, n)), np.zeros((count, 3 * P, n))
        H[:, -6:, -6:] = H_D + curvature[:, :, 6:, 6:].sum(axis=1)
        for k in range(P):
            own, rows = slice(6 * k, 6 * k + 6), slice(3 * k, 3 * k + 3)
            H[:, own, own] = curvature[:, k, :6, :6] + self.weight * np.eye(6)
            H[:, own, -6:] = curvature[:, k, :6, 6:]
            H[:, -6:, own] = curvature[:, k, 6:, :6]
            G[:, rows, own], G[:, rows, -6:] = slope[:, k, :, :6], slope[:, k, :, 6:]
        H += _CURVATURE * G.transpose(0, 2, 1) @ G
        gap = angles - self.target
        gradient = np.hstack([self.weight * gap.reshape(count, -1), gradient_D])
        E = D + 0.5 * self.weight * (gap**2).sum(axis=(1, 2))
        return _Quadratic(E, gradient, np.array([_definite(own) for own in H]), g.reshape(count, -1), G)

    def line_search(self, angles, theta, step, at: _Quadratic, penalty) -> np.ndarray:
        """Halve each step until E + penalty |g|_1 decreases enough."""
        open_mm = penalty * np.abs(at.g).sum(axis=1)
        merit, slope = at.E + open_mm, (at.gradient * step).sum(axis=1) - open_mm
        length = np.ones(len(angles))
        for _ in range(_HALVINGS):
            q = angles + length[:, None, None] * step[:, :-6].reshape(angles.shape)
            D, g = map(np.asarray, self.tried(q, theta + length[:, None] * step[:, -6:]))
            tried = (
                D + 0.5 * self.weight * ((q - self.target) ** 2).sum(axis=(1, 2)) + penalty * np.abs(g).sum(axis=(1, 2))
            )
            bad = ~(tried <= merit + _SUFFICIENT * length * slope + 1e-10 * np.abs(merit))
            if not bad.any():
                break
            length = np.where(bad, 0.5 * length, length)
        return length


def _definite(H: np.ndarray) -> np.ndarray:
    """Add as much of I to H as its Cholesky factorisation needs."""
    shift = 0.0
    while True:
        try:
            np.linalg.cholesky(H + shift * np.eye(len(H)))
        except np.linalg.LinAlgError:
            shift = max(4.0 * shift, 1e-3)
        else:
            return H + shift * np.eye(len(H))


class _Qp:
    """ProxQP of one subject, warm-started from its last solution."""

    def __init__(self, variables: int, equalities: int):
        import proxsuite  # pyright: ignore[reportMissingImports]

        self.qp = proxsuite.proxqp.dense.QP(variables, equalities, 6)
        self.qp.settings.eps_abs, self.qp.settings.eps_rel, self.qp.settings.max_iter = 1e-9, 0.0, 1000
        self.qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self.theta = np.hstack([np.zeros((6, variables - 6)), np.eye(6)])
        self.fresh = True

    def solved(self, H, gradient, G, g, low, high) -> tuple[np.ndarray, np.ndarray]:
        """Return dx, and the multipliers of the constraints."""
        give = self.qp.init if self.fresh else self.qp.update
        give(H, gradient + _CURVATURE * G.T @ g, G, -g, self.theta, low, high)
        self.fresh = False
        self.qp.solve()
        return self.qp.results.x, self.qp.results.y
