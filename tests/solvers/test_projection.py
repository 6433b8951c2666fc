"""Projections: Newton steps where projections do not converge, and the curvature learnt from the steps."""

import numpy as np
import pytest
from oracles import bones, constraints, kkt_residual

from adapt.solvers.projection.postures import _by_newton, fit_from
from adapt.solvers.projection.secant import secant
from models import load_model
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG

OFF_DEG = 20.0
"""Noise of postures far from any chain: projections do not converge for some 2 % of them."""

OPEN_MM, KKT_TOLERANCE = 1e-6, 1e-9
"""Tolerances of every fit (``test_posture_fit.py``)."""


def matrices(count: int, seed: int) -> np.ndarray:
    """Draw positive definite matrices, 3 by 3."""
    root = np.random.default_rng(seed).standard_normal((count, 5, 3))
    return np.moveaxis(np.swapaxes(root, 1, 2) @ root, 0, -1)


def times(matrix: np.ndarray, step: np.ndarray) -> np.ndarray:
    return np.einsum("ijp,jp->ip", matrix, step)


def test_the_learnt_curvature_explains_the_last_change_of_the_gradient():
    H, M, S = matrices(4, 0), 0.5 * matrices(4, 1), 0.3 * matrices(4, 2)
    step = np.random.default_rng(3).standard_normal((3, 4))
    found = secant(S, M, step, times(H, step))
    np.testing.assert_allclose(times(M + found, step), times(H, step), atol=1e-12)
    np.testing.assert_allclose(found, np.swapaxes(found, 0, 1), atol=1e-12)


def test_in_one_dimension_it_is_what_gauss_newton_leaves_out():
    one = np.ones((1, 1, 1))
    assert secant(0.0 * one, 2.0 * one, np.array([[0.1]]), np.array([[0.5]])) == pytest.approx(3.0)


def test_where_gauss_newton_leaves_nothing_out_it_is_forgotten():
    M, step = matrices(2, 5), np.random.default_rng(6).standard_normal((3, 2))
    np.testing.assert_allclose(secant(matrices(2, 7), M, step, times(M, step)), 0.0, atol=1e-12)


def test_a_step_that_tells_nothing_raises_no_warning():
    nothing, step = np.zeros((3, 3, 1)), np.array([[1.0], [0.0], [0.0]])
    np.testing.assert_array_equal(secant(nothing, nothing, step, 0.0 * step), nothing)
    assert np.isfinite(secant(nothing, nothing, step, 1e10 * step)).all()


def test_a_gradient_that_falls_along_the_step_adds_no_curvature():
    S, step = 0.1 * matrices(1, 8), np.array([[1.0], [0.0], [0.0]])
    np.testing.assert_allclose(secant(S, matrices(1, 9), step, -step), S)


def test_newton_steps_end_at_optima_where_projections_go_round_in_circles():
    measured_deg, R2 = read_motions(DATA_FILE).angles_deg.T, load_model("R2").girdle
    off = [np.random.default_rng(seed).standard_normal(measured_deg.shape) for seed in range(3)]
    every = np.radians(np.concatenate([measured_deg + OFF_DEG * one for one in off], axis=1))
    projected = fit_from(R2.repeated(every.shape[1]), every, np.ones(every.shape, bool), None)
    left = np.flatnonzero(~projected.converged)
    target, b = every[:, left], bones(R2)
    found = _by_newton(R2.repeated(len(left)), target, np.ones(target.shape, bool), projected.angles[:, left])
    assert found.converged.mean() > 1.0 / 3.0
    for s, q, multipliers in zip(
        *(x[:, found.converged].T for x in (target, found.angles, found.multipliers)), strict=True
    ):
        assert np.abs(constraints(b, q * DEG)[0]).max() <= OPEN_MM
        assert kkt_residual(b, s * DEG, q * DEG, multipliers) <= KKT_TOLERANCE
