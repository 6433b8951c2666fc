"""The objective by hand: E and its weight in every variant, D of a sphere, and the ellipsoid nearest to points."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import one_run

from adapt.solvers.newton.subject import point_multiplier, thorax_terms
from adapt.solvers.objective import (
    DEFAULT_OBJECTIVE,
    OBJECTIVES,
    WEIGHT,
    AtOptimum,
    ObjectiveVariant,
)
from adapt.solvers.projection import thorax_term
from models import load_model
from models.ellipsoid import signed_distance_mm
from models.person.thorax_ellipsoid import fitted_girdle, jitted_geometric_fit, thorax_distance_mm2

W = 10.0
AT = AtOptimum(
    distance_mm=np.array([[4.0], [-4.0], [50.0]]),
    point_weights=np.array([[0.5], [0.5], [0.0]]),
    mean_j_deg2=np.array([9.0]),
    postures=np.array([3]),
    L_mm2=np.array([7.0]),
)
"""Two points, 4 mm outside and inside, and one of padding; three postures; measured landmarks."""

BY_HAND = {
    "mm2_deg2": 16.0 + 10.0 * 9.0,
    "cm2_deg2": 0.16 + 10.0 * 9.0,
    "cm2_rad2": 0.16 + 10.0 * 9.0 * np.radians(1.0) ** 2,
    "rms_cm_rad": 0.4 + 10.0 * 3.0 * np.radians(1.0),
    "rms_mm_deg": 4.0 + 10.0 * 3.0,
    "mm_deg2": 4.0 + 10.0 * 9.0,
    "cm_deg2": 0.4 + 10.0 * 9.0,
    "sum_mm2_deg2": 32.0 + 10.0 * 9.0,
    "sum_cm2_deg2": 0.32 + 10.0 * 9.0,
    "sum_mm_deg2": 8.0 + 10.0 * 9.0,
    "sum_mm2_sum_deg2": 32.0 + 10.0 * 27.0,
    "mm2_sum_deg2": 16.0 + 10.0 * 27.0,
    "mm2_deg2_landmarks": 16.0 + 7.0 + 10.0 * 9.0,
}

ROUNDED_OFF = 1e-6
"""Relative: rounding-off changes a length of 4 mm by KINK_MM^2 / (2 * 4 mm), 1.25e-5 mm, in an E of 94."""

EXACT = 1e-11
"""Relative to the largest number: derivatives by hand and by JAX sum the same hundred terms in another order."""

FITTED_MM = 1e-4
"""Levenberg-Marquardt stops at relative steps of 1e-10; the points hardly determine M_y and A_y together."""


def test_the_thesis_weight_and_reading():
    assert (WEIGHT, DEFAULT_OBJECTIVE, list(OBJECTIVES)) == (10.0, "mm2_deg2", list(BY_HAND))


@pytest.mark.parametrize("name", OBJECTIVES)
def test_e_by_hand(name):
    exact = 1e-14 if OBJECTIVES[name].form != "lengths" else ROUNDED_OFF
    assert OBJECTIVES[name].value(W, AT) == pytest.approx(BY_HAND[name], rel=exact)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_the_weights_give_e_the_slopes_of_the_weighted_squares(name):
    """Check that E by differences has the gradient of sum u d^2 + W J in each distance and in J, up to one factor."""
    variant, step = OBJECTIVES[name], 1e-5
    at = replace(AT, distance_mm=np.array([[4.0], [-1.0], [50.0]]))
    u, weight = variant.equivalent(W, at)

    def slope(**one_step):
        high, low = (replace(at, **{k: getattr(at, k) + sign * v for k, v in one_step.items()}) for sign in (1.0, -1.0))
        return ((variant.value(W, high) - variant.value(W, low)) / (2.0 * step)).item()

    along_d = [slope(distance_mm=step * np.eye(3)[:, [k]]) for k in range(3)]
    along_j = slope(mean_j_deg2=np.array([step]))
    factor = along_j / weight
    np.testing.assert_allclose(along_d, (factor * 2.0 * u * at.distance_mm)[:, 0], rtol=1e-6, atol=1e-9)
    assert u.sum() == pytest.approx(1.0, rel=1e-14)


def test_a_root_of_nothing_has_a_weight():
    """Check the weight where a root is not differentiable, at D = 0 or J = 0: that of 1e-12 mm^2 or deg^2, finite."""
    at = replace(AT, distance_mm=np.zeros((3, 1)), mean_j_deg2=np.array([1.0]))
    assert ObjectiveVariant(form="roots").equivalent(1.0, at)[1] == pytest.approx(1e-6, rel=1e-12)
    at = replace(AT, distance_mm=np.ones((3, 1)), mean_j_deg2=np.array([0.0]))
    assert ObjectiveVariant(form="roots").equivalent(1.0, at)[1] == pytest.approx(1e6, rel=1e-12)


def test_d_of_a_sphere_by_hand():
    """Points 3 mm outside and 4 mm inside, and one of padding."""
    model = load_model("R2").girdle
    sphere = replace(model, centre_mm=jnp.array([0.0, 10.0, 0.0]), semi_axes_mm=jnp.full(3, 100.0))
    points = jnp.array([[103.0, 10.0, 0.0], [0.0, 106.0, 0.0], [0.0, 10.0, 500.0]]).T
    found = thorax_distance_mm2(sphere, points, jnp.array([0.5, 0.5, 0.0]))
    assert float(found) == pytest.approx((9.0 + 16.0) / 2.0, rel=1e-12)


@pytest.mark.parametrize("shift_mm", [0.0, 6.0])
def test_the_geometric_fit_finds_the_ellipsoid_its_points_lie_on(shift_mm):
    """Check a fit to points on all sides, which determine all five numbers; the conoid and all other numbers stay."""
    model = load_model("R2").girdle
    generator = np.random.default_rng(2)
    direction = generator.standard_normal((3, 40))
    direction /= np.linalg.norm(direction, axis=0)
    true = np.asarray(model.adapted_mm)[:5] + shift_mm * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    points = np.array([0.0, *true[:2]])[:, None] + true[2:, None] * direction
    fitted = jitted_geometric_fit(model, jnp.asarray(points))
    np.testing.assert_allclose(np.asarray(fitted.adapted_mm)[:5], true, rtol=0.0, atol=FITTED_MM)
    assert float(fitted.conoid_length_mm) == float(model.conoid_length_mm)


def test_a_geometric_fit_that_fails_keeps_the_ellipsoid():
    model = load_model("R2").girdle
    fitted = jitted_geometric_fit(model, jnp.full((3, 40), jnp.nan))
    np.testing.assert_array_equal(fitted.adapted_mm, model.adapted_mm)


def test_derivatives_of_d_by_hand_are_those_of_jax():
    """Check both kernels off the set's own parameters, with ten points, one of weight 0, each with its own level."""
    girdle, points_mm = load_model("R2").girdle, np.asarray(load_model("R2").points_mm)[:, :10]
    weights, levels_mm = np.append(np.full(9, 1.0 / 9.0), 0.0), np.linspace(-8.0, 15.0, 10)
    theta = np.asarray(girdle.adapted_mm) + np.array([12.0, -5.0, 3.0, -20.0, 4.0, 1.0])

    def D(theta):
        return thorax_distance_mm2(girdle.with_adapted(theta), points_mm, weights, levels_mm)

    def distances(theta):
        moved = girdle.with_adapted(theta)
        return signed_distance_mm(points_mm, moved.centre_mm[:, None], moved.semi_axes_mm[:, None])

    derivatives = one_run(lambda t: (D(t), jax.grad(D)(t), jax.hessian(D)(t), jax.jacobian(distances)(t)))
    value, gradient, hessian, slopes = derivatives(theta)
    near = point_multiplier(girdle, list(theta), points_mm)
    terms, _ = thorax_terms(girdle, list(theta), points_mm, weights, levels_mm, near)
    E, slope, matrix = jax.tree.map(np.sum, (terms.E, terms.slope, terms.matrix))
    part = girdle.repeated(1), *(one[..., None] for one in (points_mm, weights, levels_mm))
    by_projection = thorax_term.Thorax(*part)(theta[:, None])
    gauss_newton = 2.0 * slopes.T @ (weights[:, None] * slopes)
    lower = np.tril_indices(len(theta))
    for found, expected in (
        ((E, slope, np.concatenate(matrix)), (value, gradient, hessian[lower])),
        ([one[..., 0] for one in by_projection], (value, gradient, gauss_newton)),
    ):
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=EXACT * max(1.0, np.abs(other).max()))
    for run in (thorax_term.thorax_kernel.native, thorax_term.thorax_kernel.by_jax):
        D_again, *_ = run(*part, theta[:, None])
        np.testing.assert_allclose(D_again, by_projection[0], rtol=EXACT)


def test_an_ellipsoid_on_its_points_is_not_fitted_again_and_one_off_them_is():
    """The points of a shipped set lie on its ellipsoid; when all points move, the centre moves with them."""
    model = load_model("R2")
    points = np.asarray(model.points_mm)
    assert fitted_girdle(model.girdle, points) is model.girdle
    lower = points + np.array([0.0, -1.0, 2.0])[:, None]
    fitted = fitted_girdle(model.girdle, lower)
    moved = np.asarray(fitted.adapted_mm) - np.asarray(model.girdle.adapted_mm)
    np.testing.assert_allclose(moved, [-1.0, 2.0, 0.0, 0.0, 0.0, 0.0], rtol=0.0, atol=FITTED_MM)
    assert isinstance(fitted.centre_mm, np.ndarray)
