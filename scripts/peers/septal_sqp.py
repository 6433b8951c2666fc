"""septal, an SQP in JAX for ``vmap``: all subjects of a process in one compiled batch, one process a core.

Fair in the problem: exact derivatives by JAX, the closest points eliminated. Unfair in the method: its QP are dense and
solved by a fixed number of ADMM iterations, its outer iterations are a fixed number too, and both branches of a condition
run under ``vmap``. It shifts an indefinite Hessian by a multiple of I; the term s/2 |g|^2, which is 0 at every closed
chain, makes that rare and brings it from 60 iterations without convergence to 15-30. Its corrections of second order,
four more QP an iteration that seldom change anything here, are off.
"""

import jax.numpy as jnp
import numpy as np

from scripts.peers.cases import Answer, Cases, cases
from scripts.peers.in_jax import InJax
from scripts.peers.shares import Share, on_all_cores, timed_share

_CURVATURE = 1.0
"""s, mm^-2."""

_SETTINGS = {
    "max_iter": 30,
    "soc_max_iter": 0,
    "admm_n_iter": 50,
    "hess_reg_delta": 1e-6,
    "tol_stationarity": 1e-7,
    "tol_feasibility": 1e-8,
}


def run(model: str, count: int, total: int) -> Share:
    """E of the first ``count`` subjects."""
    return on_all_cores(_share, model, count, total)


def _share(model: str, count: int, total: int, first: int, step: int) -> Share:
    given = cases(model, count, total, first, step)
    solver = _solver(InJax(model), given)
    p = np.array([target.T.ravel() for target in given.targets_deg])
    x0 = np.hstack([p, np.broadcast_to(given.theta_mm, (len(p), 6))])

    def solve() -> list[Answer]:
        return [(x[-6:], x[:-6].reshape(-1, 6).T) for x in np.asarray(solver(x0, p).x)]

    return timed_share(given, solve)


def _solver(problem: InJax, given: Cases):
    from septal.jax.sqp import ParametricNLPProblem, SQPConfig  # pyright: ignore[reportMissingImports]
    from septal.jax.sqp.solver import make_batch_solver  # pyright: ignore[reportMissingImports]

    angles, constraints = given.targets_deg[0].size, given.targets_deg[0].shape[1] * 3
    free = np.full(angles, np.inf)
    low, high = given.bounds_mm
    posed = ParametricNLPProblem(
        objective=lambda x, p: problem.E(x, p) + 0.5 * _CURVATURE * jnp.sum(problem.chains(x) ** 2),
        bounds=[np.concatenate([-free, low]), np.concatenate([free, high])],
        n_decision=angles + 6,
        n_params=angles,
        constraints=lambda x, _: problem.chains(x),
        constraint_lhs=np.zeros(constraints),
        constraint_rhs=np.zeros(constraints),
    )
    return make_batch_solver(posed, SQPConfig(**_SETTINGS))
