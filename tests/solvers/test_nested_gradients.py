"""Derivatives of the objective: finite differences, forward and reverse mode, the second order, and ``vmap`` and
``jit`` combined with them in any order."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import few_runs

from adapt.differentiable import objective
from adapt.solvers.posture_fits import fit_batch
from models import load_model
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

FD_TOLERANCE = 1e-6
"""Relative to the largest entry, for central differences of step 1e-3 mm. The solver stops at |g| and |dL/dq| of 1e-9,
mostly far below, which divided by the step leaves 1e-7; the rest is truncation."""

EXACT = 1e-9
"""Relative tolerance between forward and reverse mode: the same 9 x 9 system, with condition number 1e4, solved from
the left and from the right."""

MODEL = load_model("R2")
GIRDLE = MODEL.girdle
POINTS = jnp.asarray(MODEL.points_mm)
SUBJECT = jnp.asarray(simulate_subjects(1, seed=3, noise_deg=3.0).angles_deg[::3].T / DEG)
"""Five postures."""
THETA = GIRDLE.adapted_mm + jnp.array([3.0, -2.0, 1.0, -4.0, 2.0, 0.5])


def E(theta, angles, start):
    return objective(theta, GIRDLE, POINTS, angles, start=start)


def fitted():
    """Fit the postures at ``THETA`` by the fit without derivatives."""
    girdles = GIRDLE.with_adapted(THETA).repeated(SUBJECT.shape[1])
    return fit_batch(girdles, np.asarray(SUBJECT), np.ones(SUBJECT.shape, bool)).angles


STEPS = 1e-3 * jnp.concatenate([jnp.zeros((1, 6)), jnp.eye(6), -jnp.eye(6)])
"""No step, then one forward and one backward along each parameter, mm."""


def assert_close(found, expected, tolerance: float) -> None:
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * max(1.0, np.abs(expected).max()))


def differences(of_steps) -> np.ndarray:
    """Compute d/dtheta from values at ``STEPS``."""
    return (np.asarray(of_steps)[1:7] - np.asarray(of_steps)[7:]) / 2e-3


class Derivatives(NamedTuple):
    """E and its derivatives, at each of ``STEPS``."""

    values: np.ndarray
    slopes: np.ndarray
    """dE/dtheta in reverse mode."""
    forward_slopes: np.ndarray
    hessians: np.ndarray
    """d2E/dtheta2, forward over reverse."""


@pytest.fixture(scope="module")
def stepped() -> Derivatives:
    """Compute jit of vmap of both modes in one program, because compilation takes most of the time."""

    def derivatives(theta, *given):
        both = jax.value_and_grad(E)
        further, found = jax.jacfwd(lambda theta: (both(theta, *given),) * 2, has_aux=True)(theta)
        return Derivatives(*found, *further)

    found = few_runs(jax.vmap(derivatives, in_axes=(0, None, None)))(THETA + STEPS, SUBJECT, fitted())
    return jax.tree.map(np.asarray, found)


def test_nested_gradient_by_differences_and_in_forward_mode(stepped):
    assert_close(stepped.slopes[0], differences(stepped.values), FD_TOLERANCE)
    assert_close(stepped.forward_slopes[0], stepped.slopes[0], EXACT)


def test_nested_hessian_by_differences_and_symmetric(stepped):
    hessian = stepped.hessians[0]
    assert_close(hessian, differences(stepped.slopes), FD_TOLERANCE)
    assert_close(hessian, hessian.T, EXACT)


def test_grad_of_vmap_of_jit_is_vmap_of_grad(stepped):
    """Check two subjects, the second with its postures in reverse order, from one start: twice the gradient of one
    subject."""
    angles, start = (jnp.stack([x, x[:, ::-1]]) for x in (SUBJECT, fitted()))
    of_sum = few_runs(jax.grad(lambda t: jnp.sum(jax.vmap(jax.jit(E), in_axes=(None, 0, 0))(t, angles, start))))
    assert_close(of_sum(THETA), 2.0 * stepped.slopes[0], EXACT)
