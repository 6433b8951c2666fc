"""septal, an SQP in JAX: compiled with its loop that ends on convergence, subject after subject, one process per core.

Fair in the problem: exact derivatives by JAX, the closest points eliminated. Unfair in the method: its QPs are dense
and solved by a fixed number of ADMM iterations. Its form for ``vmap`` also has a fixed number of outer iterations and
runs both branches of every condition: it is meant for accelerators. septal shifts an indefinite Hessian by a multiple
of I; the term s/2 |g|^2, 0 at every closed chain, makes that rare and reduces 60 iterations without convergence to
15-30. Its second-order corrections, four more QPs per iteration, change nothing here and are off.
"""

import jax
import jax.numpy as jnp
import numpy as np

from adapt.engine.compilation_cache import keep_compiled
from scripts.research.speed.peers.cases import Answer, cases
from scripts.research.speed.peers.in_jax import InJax
from scripts.research.speed.peers.shares import Share, on_all_cores, timed_share

_CURVATURE = 1.0
"""s, mm^-2."""

_SETTINGS = {
    "max_iter": 60,
    "soc_max_iter": 0,
    "admm_n_iter": 50,
    "hess_reg_delta": 1e-6,
    "tol_stationarity": 1e-7,
    "tol_feasibility": 1e-8,
}


def run(model: str, count: int, total: int) -> Share:
    """Compute E of the first ``count`` subjects."""
    return on_all_cores(_share, model, count, total)


def _share(model: str, count: int, total: int, first: int, step: int) -> Share:
    keep_compiled()
    given = cases(model, count, total, first, step)
    solver = _solver(InJax(model), given.targets_deg[0].size, given.bounds_mm)

    def solved(target) -> Answer:
        x = np.asarray(solver(np.concatenate([target.T.ravel(), given.theta_mm]), target.T.ravel()).x)
        return x[-6:], x[:-6].reshape(-1, 6).T

    return timed_share(given, lambda: [solved(target) for target in given.targets_deg])


def _solver(problem: InJax, angles: int, bounds_mm: np.ndarray):
    from septal.jax.sqp import ParametricNLPProblem, SQPConfig  # pyright: ignore[reportMissingImports]
    from septal.jax.sqp.solver import sqp_solve_single  # pyright: ignore[reportMissingImports]

    free, closed = np.full(angles, np.inf), np.zeros(angles // 2)
    posed = ParametricNLPProblem(
        objective=lambda x, p: problem.E(x, p) + 0.5 * _CURVATURE * jnp.sum(problem.chains(x) ** 2),
        bounds=[np.concatenate([-free, bounds_mm[0]]), np.concatenate([free, bounds_mm[1]])],
        n_decision=angles + 6,
        n_params=angles,
        constraints=lambda x, _: problem.chains(x),
        constraint_lhs=closed,
        constraint_rhs=closed,
    )
    return jax.jit(lambda x, p: sqp_solve_single(posed, x, p, SQPConfig(**_SETTINGS)))
