"""Derivatives of the objective: differences, both directions, the second order, and ``vmap`` and ``jit`` in any
order with them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nested import values_and_slopes
from programs import few_runs

from adapt.differentiable import objective
from adapt.solvers.posture_fits import fit_batch
from models import load_model
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

FD_TOLERANCE = 1e-6
"""Central differences of step 1e-3 mm: the solver stops at |g| and |dL/dq| of 1e-9, mostly far below, which over the
step leaves 1e-7; the rest is truncation. Relative to the largest entry."""

EXACT = 1e-9
"""Forward and reverse: the same 9 x 9 system solved from the left and from the right; condition 1e4. Relative."""

MODEL = load_model("R2")
GIRDLE = MODEL.girdle
POINTS = jnp.asarray(MODEL.points_mm)
SUBJECT = jnp.asarray(simulate_subjects(1, seed=3, noise_deg=3.0).angles_deg.T / DEG)
THETA = GIRDLE.adapted_mm + jnp.array([3.0, -2.0, 1.0, -4.0, 2.0, 0.5])


def E(theta, angles, start):
    """From one start, which is less to compile; ``values_and_slopes`` finds its own."""
    return objective(theta, GIRDLE, POINTS, angles, start=start)


def fitted():
    """Where the postures are fitted at THETA, by the fit without derivatives."""
    girdles = GIRDLE.with_adapted(THETA).repeated(SUBJECT.shape[1])
    return fit_batch(girdles, np.asarray(SUBJECT), np.ones(SUBJECT.shape, bool)).angles


STEPS = 1e-3 * jnp.concatenate([jnp.zeros((1, 6)), jnp.eye(6), -jnp.eye(6)])
"""No step, then one forward and one backward along each parameter, mm."""


def assert_close(found, expected, tolerance: float) -> None:
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * max(1.0, np.abs(expected).max()))


def differences(of_steps) -> np.ndarray:
    """d/dtheta of what was computed at STEPS."""
    return (np.asarray(of_steps)[1:7] - np.asarray(of_steps)[7:]) / 2e-3


@pytest.fixture(scope="module")
def stepped():
    """E and its slope at STEPS: jit of vmap of grad."""
    count = len(STEPS)
    same = jax.tree.map(lambda x: jnp.repeat(x[None], count, axis=0), (GIRDLE, POINTS, SUBJECT))
    values, slopes = values_and_slopes(THETA + STEPS, *same)
    return np.asarray(values), np.asarray(slopes)


@pytest.fixture(scope="module")
def in_forward_mode():
    """dE/dtheta in forward mode, and d2E/dtheta2 forward over reverse, in one program."""
    slope, hessian = few_runs(jax.jacfwd(jax.value_and_grad(E)))(THETA, SUBJECT, fitted())
    return np.asarray(slope), np.asarray(hessian)


def test_nested_gradient_by_differences_and_in_forward_mode(stepped, in_forward_mode):
    values, slopes = stepped
    assert_close(slopes[0], differences(values), FD_TOLERANCE)
    assert_close(in_forward_mode[0], slopes[0], EXACT)


def test_nested_hessian_by_differences_and_symmetric(stepped, in_forward_mode):
    hessian = in_forward_mode[1]
    assert_close(hessian, differences(stepped[1]), FD_TOLERANCE)
    assert_close(hessian, hessian.T, EXACT)


def test_grad_of_vmap_of_jit_is_vmap_of_grad(stepped):
    """Two subjects, the second with the postures in another order: twice the slope of one."""
    angles, start = (jnp.stack([x, x[:, ::-1]]) for x in (SUBJECT, fitted()))
    of_sum = few_runs(jax.grad(lambda t: jnp.sum(jax.vmap(jax.jit(E), in_axes=(None, 0, 0))(t, angles, start))))
    assert_close(of_sum(THETA), 2.0 * stepped[1][0], EXACT)
