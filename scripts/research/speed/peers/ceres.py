"""Ceres (pyceres) on nonlinear least squares, DENSE_SCHUR with the postures eliminated first, one process per core.

The constraints are eliminated: a posture has three free coordinates along the null space of its constraints at the
start, which is the nearest closed posture; three others close the chain within the cost function. With heavily weighted
constraints and four updates of the multipliers instead, residuals of 2e-3 mm remain after 200 iterations. Ceres clips
steps at bounds and stops above the optimum, so parameters that it leaves at a bound are held there until their
derivatives change sign.

Not fair in two ways. Gauss-Newton leaves out the curvature of the chains, so it takes 60-90 iterations where Newton
takes 10; that is the method. The cost functions are called in Python: ``Share.library`` is the share of the time in
Ceres itself, the rest is the calls, of which a third is the compiled function.
"""

import functools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from oracles import WEIGHT  # pyright: ignore[reportMissingImports]

from scripts.research.speed.peers.casadi_compiled import COMPILER
from scripts.research.speed.peers.cases import Answer, Cases, cases
from scripts.research.speed.peers.shares import Share, on_all_cores, timed_share

_OPEN_MM = 1e-8
_CLOSINGS = 6
"""Calls of ``closed`` before an evaluation fails, which makes Ceres try a shorter step."""

_CLOSING_STEPS, _LONGEST_STEP_DEG, _FARTHEST_DEG = 60, 15.0, 60.0
_FIRST, _LAST = 1e-4, 1e-13
"""Relative decrease of E at which Ceres stops: in the first round, which finds the parameters at a bound, and later."""

_ROUNDS = 8


def run(model: str, count: int, total: int) -> Share:
    """Compute E of the first ``count`` subjects."""
    return on_all_cores(_share, model, count, total)


def _share(model: str, count: int, total: int, first: int, step: int) -> Share:
    from scripts.research.speed.peers.ceres_functions import compiled_functions

    given = cases(model, count, total, first, step)
    with tempfile.TemporaryDirectory() as folder:
        functions = compiled_functions(given.bones, given.points_mm, COMPILER or "cc", Path(folder))
        spent = [0.0]
        return timed_share(
            given, lambda: [_solved(given, target, functions, spent) for target in given.targets_deg], lambda: spent[0]
        )


@functools.cache
def _blocks() -> tuple[type, type]:
    """Define the two cost functions; their base class exists only where pyceres is installed."""
    import pyceres  # pyright: ignore[reportMissingImports]

    class Posture(pyceres.CostFunction):
        """sqrt(w / 6P) (q - s) of the closed posture as a function of three coordinates and theta."""

        def __init__(self, target, postures: int, theta, closed, chain):
            super().__init__()
            self.set_num_residuals(6)
            self.set_parameter_block_sizes([3, 6])
            self.target, self.scale = target, np.sqrt(WEIGHT / (6 * postures))
            self.good, G = _nearest_closed(chain, target, theta)
            _, _, basis = np.linalg.svd(G)
            self.R, self.N, self.u = basis[:3].copy(), basis[3:].copy(), np.zeros(3)
            self.q, self.theta = np.zeros(6), np.zeros(6)
            self.x, self.g, self.along, self.slopes = np.zeros(6), np.zeros(3), np.zeros(18), np.zeros(36)
            self.buffer, self.call = closed.buffer()
            # The buffer keeps no reference to the arrays.
            for k, array in enumerate((self.q, self.theta, self.R.reshape(-1), self.N.reshape(-1))):
                self.buffer.set_arg(k, array.data)
            for k, array in enumerate((self.x, self.g, self.along, self.slopes)):
                self.buffer.set_res(k, array.data)

        def Evaluate(self, parameters, residuals, jacobians) -> bool:
            """Evaluate residuals and derivatives, starting from where the chain was last closed."""
            u, self.theta[:] = parameters
            self.q[:] = self.good + (u - self.u) @ self.N
            for _ in range(_CLOSINGS):
                self.call()
                if np.abs(self.g).max() < _OPEN_MM:
                    break
                if not np.abs(self.x - self.good).max() < _FARTHEST_DEG:
                    return False
                self.q[:] = self.x
            else:
                return False
            self.good[:], self.u[:] = self.x, u
            residuals[:] = self.scale * (self.x - self.target)
            _fill(jacobians, (self.along, self.slopes), self.scale)
            return True

    class Thorax(pyceres.CostFunction):
        """d / sqrt(N) of the thorax points as a function of theta."""

        def __init__(self, points: int, thorax):
            super().__init__()
            self.set_num_residuals(points)
            self.set_parameter_block_sizes([6])
            self.scale = 1.0 / np.sqrt(points)
            self.theta, self.d, self.slopes = np.zeros(6), np.zeros(points), np.zeros(6 * points)
            self.buffer, self.call = thorax.buffer()
            self.buffer.set_arg(0, self.theta.data)
            self.buffer.set_res(0, self.d.data)
            self.buffer.set_res(1, self.slopes.data)

        def Evaluate(self, parameters, residuals, jacobians) -> bool:
            """Evaluate residuals and derivatives of all points."""
            self.theta[:] = parameters[0]
            self.call()
            np.multiply(self.d, self.scale, out=residuals)
            _fill(jacobians, (self.slopes,), self.scale)
            return True

    return Posture, Thorax


def _fill(jacobians, values, scale: float) -> None:
    for out, value in zip(jacobians or (), values, strict=False):
        if out is not None:
            np.multiply(value, scale, out=out)


def _nearest_closed(chain, target, theta) -> tuple[np.ndarray, np.ndarray]:
    """Find the closed posture by minimum-norm Gauss-Newton steps from the measured angles; return it and G there."""
    q, Gt = target.copy(), np.zeros((6, 3))
    for _ in range(_CLOSING_STEPS):
        g, Gt, _ = (np.array(x) for x in chain(q, theta))
        if np.abs(g).max() < _OPEN_MM:
            break
        step = np.linalg.lstsq(Gt.T, g.ravel(), rcond=None)[0]
        q -= step * min(1.0, _LONGEST_STEP_DEG / np.abs(step).max())
    return q, Gt.T


def _solved(given: Cases, target: np.ndarray, functions: tuple[Any, Any, Any], spent: list[float]) -> Answer:
    import pyceres  # pyright: ignore[reportMissingImports]

    posture_block, thorax_block = _blocks()
    closed, chain, thorax = functions
    theta, low, high = given.theta_mm.copy(), *given.bounds_mm
    free = [np.zeros(3) for _ in target.T]
    postures = [posture_block(angles.copy(), len(free), theta, closed, chain) for angles in target.T]
    points = thorax_block(given.points_mm.shape[1], thorax)
    problem = pyceres.Problem()
    problem.add_residual_block(points, None, [theta])
    for posture, u in zip(postures, free, strict=True):
        problem.add_residual_block(posture, None, [u, theta])
    for k in range(6):
        problem.set_parameter_lower_bound(theta, k, low[k])
        problem.set_parameter_upper_bound(theta, k, high[k])
    options, held = _options(pyceres), None
    for _ in range(_ROUNDS):
        summary = pyceres.SolverSummary()
        pyceres.solve(options, problem, summary)
        evaluations = summary.residual_evaluation_time_in_seconds + summary.jacobian_evaluation_time_in_seconds
        spent[0] += summary.total_time_in_seconds - evaluations
        slope = _slope(postures, free, points, theta)
        pressed = np.flatnonzero(((theta <= low + 1e-9) & (slope > 0.0)) | ((theta >= high - 1e-9) & (slope < 0.0)))
        if held is not None and list(pressed) == held:
            break
        held = list(pressed)
        problem.set_manifold(theta, pyceres.SubsetManifold(6, held) if held else pyceres.EuclideanManifold(6))
        options.function_tolerance = _LAST
    return theta, np.array([posture.good for posture in postures]).T


def _options(pyceres) -> Any:
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_SCHUR
    options.max_num_iterations, options.num_threads = 500, 1
    options.function_tolerance, options.gradient_tolerance, options.parameter_tolerance = _FIRST, 1e-9, 1e-12
    options.logging_type = pyceres.LoggingType.SILENT
    options.minimizer_progress_to_stdout = False
    return options


def _slope(postures, free, points, theta) -> np.ndarray:
    """Return dE/dtheta / 2, and move every posture to its last point."""
    slope, residuals, slopes = np.zeros(6), np.zeros(6), np.zeros(36)
    for posture, u in zip(postures, free, strict=True):
        posture.Evaluate([u, theta], residuals, [None, slopes])
        slope += residuals @ slopes.reshape(6, 6)
    residuals, slopes = np.zeros(len(points.d)), np.zeros(len(points.slopes))
    points.Evaluate([theta], residuals, [slopes])
    return slope + residuals @ slopes.reshape(-1, 6)
