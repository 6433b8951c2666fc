"""Derivatives written by hand, against automatic differentiation of the definitions."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import few_runs

from models import load_model, model_names
from models.derivatives import (
    ConstraintDerivatives,
    chain,
    closest_point_multiplier_near,
    closest_point_multipliers,
    distance,
    ellipsoid_curvature,
    ellipsoid_slope,
)
from models.ellipsoid import signed_distance_mm
from models.girdle import constraint_residuals_mm
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

EXACT = 1e-10
"""Tolerance relative to the largest entry: both are exact up to the rounding of some hundred operations."""

SETTLED = 4
"""Number of evaluations until a foot point has converged: three Newton steps each, quadratic."""

MULTIPLIERS = jnp.array([0.5, -0.7, 1.3])

POINTS = jnp.array([[80.0, 150.0, -60.0], [40.0, -120.0, 300.0], [-110.0, 90.0, 100.0]]).T
"""One point outside and two inside the ellipsoid below; all coordinates differ."""

CENTRE, AXES = jnp.array([2.0, -3.0, 5.0]), jnp.array([140.0, 320.0, 120.0])


def assert_same(found, expected) -> None:
    expected = np.asarray(expected)
    np.testing.assert_allclose(np.asarray(found), expected, rtol=0.0, atol=EXACT * max(1.0, np.abs(expected).max()))


def lower(rows, size: int) -> np.ndarray:
    """Return the symmetric matrix of a lower triangle."""
    full = np.zeros((size, size))
    for i, row in enumerate(rows):
        full[i, : i + 1] = full[: i + 1, i] = np.asarray(row)
    return full


def _distance(ellipsoid, point):
    centre = jnp.concatenate([CENTRE[:1], ellipsoid[:2]])
    return signed_distance_mm(point, centre, ellipsoid[2:])


@few_runs
def distance_differentiated(*at):
    """Compute the distance of a point, its gradient and its Hessian."""
    return _distance(*at), jax.grad(_distance)(*at), jax.hessian(_distance)(*at)


@pytest.mark.parametrize("k", range(3))
def test_distance_with_slopes_and_curvatures(k):
    point = POINTS[:, k]
    ellipsoid = jnp.concatenate([CENTRE[1:], AXES])
    (x, y, z), (of_x, of_y, of_z) = point - CENTRE, AXES
    p, a = (x, y, z), (of_x, of_y, of_z)
    t = jnp.zeros(())
    for _ in range(SETTLED):
        t = closest_point_multiplier_near(p, a, t)
    at = distance(p, a, t)
    value, slope, curvature = distance_differentiated(ellipsoid, point)
    assert_same(at.d, value)
    assert_same(ellipsoid_slope(at), slope)
    assert_same(lower(ellipsoid_curvature(at), 5), curvature)


def settled(girdle, q, theta) -> ConstraintDerivatives:
    """Compute the constraints at converged foot points."""
    start = [jnp.zeros(())] * 2
    for _ in range(SETTLED):
        start = chain(girdle, list(q), list(theta), list(MULTIPLIERS), start).closest_point_multipliers
    return chain(girdle, list(q), list(theta), list(MULTIPLIERS), start)


def _residuals(z, girdle):
    return constraint_residuals_mm(girdle.with_adapted(z[6:]), z[:6])


@few_runs
def chain_differentiated(*at):
    """Compute the constraints, their Jacobian, and the Hessian of their sum with ``MULTIPLIERS``."""
    return _residuals(*at), jax.jacfwd(_residuals)(*at), jax.hessian(lambda *at: MULTIPLIERS @ _residuals(*at))(*at)


@pytest.mark.parametrize("name", model_names())
def test_chain_with_slopes_and_curvatures(name):
    girdle = load_model(name).girdle
    theta = girdle.adapted_mm + jnp.array([3.0, -2.0, 1.0, -4.0, 2.0, 0.5])
    q = jnp.asarray(simulate_subjects(1, seed=5).angles_deg[4] / DEG)
    z = jnp.concatenate([q, theta])
    g, slopes, curvature = chain_differentiated(z, girdle)
    at = settled(girdle, q, theta)
    assert_same(at.g, g)
    assert_same(at.G, slopes[:, :6])
    assert_same(at.T, slopes[:2, 6:11])
    assert_same(slopes[:, 11], [0.0, 0.0, -1.0])
    assert_same(slopes[2, 6:11], np.zeros(5))
    assert_same(lower(at.qq, 6), curvature[:6, :6])
    assert_same(at.qu, curvature[:6, 6:11])
    assert_same(lower(at.uu, 5), curvature[6:11, 6:11])
    assert_same(curvature[11], np.zeros(12))


def test_feet_are_where_those_of_the_chain_come_to_rest():
    """Check foot points for a thorax off the plane x = 0, which no set has, so that all of its centre matters."""
    girdle = replace(load_model("R2").girdle, centre_mm=jnp.array([6.0, -296.0, 78.0]))
    q = jnp.asarray(simulate_subjects(1, seed=5).angles_deg[4] / DEG)
    theta = girdle.adapted_mm
    at = settled(girdle, q, theta)
    assert_same(closest_point_multipliers(girdle, list(q), list(theta)), at.closest_point_multipliers)
    assert_same(at.g, constraint_residuals_mm(girdle, q))
