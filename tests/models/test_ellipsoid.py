"""The distance to the ellipsoid: spheres, points built from their foot points, brute force, and derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import few_runs, one_run
from scipy.optimize import minimize

from models import ellipsoid, load_model, model_names
from models.ellipsoid import closest_point, closest_point_multiplier, signed_distance_mm

ROUNDING_MM = 1e-10
"""Tolerance for distances of 100s of mm: 1e3 times their rounding, for the sums and the root of the secular equation.
The point is also moved 1e-13 of an axis off a symmetry plane."""

ON_SURFACE = 1e-12
"""Tolerance of sum (x_i / a_i)^2 - 1 at a foot point: rounding of t, magnified by the smallest denominator."""

DIRECTION = 1e-9
"""Tolerance of the sine of the angle from p - x to the normal, times distance over 1 mm: rounding, 1e-13 mm."""

MULTIPLIER = 1e-9
"""Relative tolerance: t is a small difference of points 100s of mm long, exact to 1e-13 mm each."""

LOOP_MM = 1e-6
"""Largest error near the surface without the loop of Newton steps: see models.ellipsoid."""

GRADIENT_FD = 1e-7
"""Tolerance for central differences of step 1e-4 mm: truncation 1e-9, rounding 1e-13 mm / 1e-4 mm, with room."""

HESSIAN_FD = 1e-7
"""Tolerance in 1/mm for central differences of the gradient, which is exact to 1e-14."""

EXACT = 1e-13
"""Tolerance between forward and reverse mode, which do the same arithmetic in another order."""

THORAX = jnp.array([153.0, 404.0, 130.0])
ZERO = jnp.zeros(3)

SIDE_BY_SIDE = 128
"""Number of points per call of a program, compiled once for all tests."""


def side_by_side(function):
    """Compile a function of (3, points) arguments; it runs on any number of points, padded with copies of the last."""
    program = jax.jit(function)

    def run(*given):
        given = [np.asarray(x) for x in given]
        shape = np.broadcast_shapes(*(x.shape for x in given))
        flat = [np.broadcast_to(x, shape).reshape(3, -1) for x in given]
        count = flat[0].shape[1]
        lanes = np.minimum(np.arange(-(-count // SIDE_BY_SIDE) * SIDE_BY_SIDE), count - 1).reshape(-1, SIDE_BY_SIDE)
        found = np.concatenate([program(*(x[:, some] for x in flat)) for some in lanes], axis=-1)[..., :count]
        return found.reshape((*found.shape[:-1], *shape[1:]))

    return run


distance_from = side_by_side(signed_distance_mm)
closest = side_by_side(closest_point)
gradient = jax.jit(jax.grad(signed_distance_mm, argnums=(0, 1, 2)))


def distance(p, a) -> np.ndarray:
    """Compute the distance for points relative to the centre."""
    return distance_from(p, np.zeros_like(p), a)


OFF_PLANE_MM = 0.1
"""Distance of the points of the property tests from the symmetry planes: deep inside and nearer to the plane of the
shortest axis, the compiled distance loses digits (``test_deep_inside_next_to_the_plane_of_the_shortest_axis``)."""

COORDINATE = st.one_of(st.floats(-600.0, -OFF_PLANE_MM), st.floats(OFF_PLANE_MM, 600.0))
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)
AXES = st.tuples(*[st.floats(60.0, 450.0)] * 3)


def sample(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw points on random ellipsoids, and the semi-axes, (3, count) each."""
    generator = np.random.default_rng(seed)
    axes = generator.uniform(60.0, 450.0, (3, count))
    direction = generator.normal(size=(3, count))
    return axes * direction / np.linalg.norm(direction, axis=0), axes


# --- known distances ------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [1.0, 100.0])
def test_on_a_sphere_it_is_the_distance_to_the_centre(radius):
    generator = np.random.default_rng(0)
    points = generator.normal(size=(3, 1000)) * radius * generator.uniform(0.0, 5.0, 1000)
    special = np.concatenate([np.zeros((3, 1)), radius * np.eye(3), -0.5 * radius * np.eye(3)], axis=1)
    points = np.concatenate([points, special], axis=1)
    found = distance(jnp.asarray(points), jnp.full(points.shape, radius))
    np.testing.assert_allclose(found, np.linalg.norm(points, axis=0) - radius, rtol=0.0, atol=ROUNDING_MM)


def test_the_centre_moves_with_the_points():
    points = jnp.asarray(np.random.default_rng(1).normal(0.0, 300.0, (3, 100)))
    centre, axes = jnp.array([[5.0], [-296.0], [78.0]]), jnp.broadcast_to(THORAX[:, None], points.shape)
    found = distance_from(points + centre, centre, THORAX[:, None])
    np.testing.assert_allclose(found, distance(points, axes), rtol=0.0, atol=ROUNDING_MM)


def test_points_along_the_normal_come_back_to_their_foot():
    """Check p = x + t x / a^2, whose closest point is exactly x as long as t > -min a^2 (points inside included)."""
    x, a = sample(100_000, seed=2)
    generator = np.random.default_rng(3)
    shortest = np.min(a * a, axis=0)
    t = np.where(generator.random(x.shape[1]) < 0.5, generator.uniform(-0.99, 0.0, x.shape[1]) * shortest, 0.0)
    t = np.where(t == 0.0, 10.0 ** generator.uniform(-3.0, 6.0, x.shape[1]), t)
    p = x + t * x / a**2
    found = distance(jnp.asarray(p), jnp.asarray(a))
    np.testing.assert_allclose(found, t * np.linalg.norm(x / a**2, axis=0), atol=ROUNDING_MM, rtol=1e-12)
    # Near the evolute (t = -min a^2) the foot point moves 1 / (1 + t / min a^2) = 100 times as far as p.
    np.testing.assert_allclose(closest(jnp.asarray(p), jnp.asarray(a)), x, rtol=0.0, atol=100.0 * ROUNDING_MM)


def test_the_multiplier_of_a_foot_by_hand():
    """Check p = x + t x / a^2 with a chosen foot point x: NumPy and JAX return t, inside and outside."""
    x, a = sample(20, seed=8)
    multiplier = side_by_side(closest_point_multiplier)
    for t in (-2000.0, 500.0, 30_000.0):
        p = x + t * x / a**2
        for found in (closest_point_multiplier(p, a), multiplier(p, a)):
            np.testing.assert_allclose(found, t, rtol=MULTIPLIER)
    r, d = 100.0, 7.0
    assert float(multiplier(np.array([r + d, 0.0, 0.0]), np.full(3, r))) == pytest.approx(d * r, rel=MULTIPLIER)


def test_numpy_finds_what_jax_finds():
    """Check NumPy's distance, whose root search is a separate implementation."""
    x, a = sample(50, seed=9)
    p = np.concatenate([0.4 * x, 1.2 * x], axis=1)
    found = signed_distance_mm(p, np.zeros_like(p), np.tile(a, 2))
    assert isinstance(found, np.ndarray)
    np.testing.assert_allclose(found, distance(jnp.asarray(p), jnp.asarray(np.tile(a, 2))), rtol=0.0, atol=ROUNDING_MM)


def test_a_point_on_the_plane_has_its_foot_on_the_positive_side():
    """Check points on the plane of the shortest axis: the centre is equally near to both its ends; below the plane,
    however little, the foot point is below too."""
    for side, z in ((1.0, 0.0), (1.0, 1e-9), (-1.0, -1e-9), (1.0, 1e-12), (-1.0, -1e-12)):
        found = closest(np.array([0.0, 0.0, z]), THORAX)
        np.testing.assert_allclose(found, [0.0, 0.0, side * 130.0], rtol=0.0, atol=1e-6)


def test_the_distance_beside_its_derivatives_is_the_distance():
    """Check the value from the derivative rule, which computes it separately."""
    x, a = sample(20, seed=10)
    p = jnp.asarray(1.3 * x)
    from_centre = few_runs(lambda p: jax.jvp(lambda p: signed_distance_mm(p, jnp.zeros_like(p), a), (p,), (p,)))
    value, _ = from_centre(p)
    np.testing.assert_allclose(value, distance(p, jnp.asarray(a)), rtol=0.0, atol=ROUNDING_MM)


def test_foot_points_are_on_the_surface_and_the_normal_meets_the_point():
    generator = np.random.default_rng(4)
    a = generator.uniform(60.0, 450.0, (3, 100_000))
    p = generator.uniform(-2.0, 2.0, a.shape) * a
    x = np.asarray(closest(jnp.asarray(p), jnp.asarray(a)))
    assert np.abs(np.sum((x / a) ** 2, axis=0) - 1.0).max() <= ON_SURFACE
    n = x / a**2
    n = n / np.linalg.norm(n, axis=0)
    across = np.linalg.norm(np.cross(p - x, n, axis=0), axis=0)
    assert across.max() <= DIRECTION
    along = np.sum((p - x) * n, axis=0)
    np.testing.assert_allclose(distance(jnp.asarray(p), jnp.asarray(a)), along, rtol=0.0, atol=ROUNDING_MM)
    outside = np.sum((p / a) ** 2, axis=0) > 1.0
    assert np.array_equal(along > 0.0, outside)


def brute_force_mm(p: np.ndarray, a: np.ndarray) -> float:
    """Compute the smallest distance over a grid of the surface, refined from the best points of the grid by BFGS."""

    def surface(angles):
        u, v = angles
        return np.stack([a[0] * np.cos(u) * np.cos(v), a[1] * np.sin(v), a[2] * np.sin(u) * np.cos(v)])

    u, v = np.meshgrid(np.linspace(-np.pi, np.pi, 121), np.linspace(-np.pi / 2, np.pi / 2, 61))
    squared = np.sum((surface((u, v)) - p[:, None, None]) ** 2, axis=0).ravel()
    starts = np.argsort(squared)[:3]
    polished = [
        minimize(lambda q: np.sum((surface(q) - p) ** 2), (u.ravel()[k], v.ravel()[k]), tol=1e-9).fun for k in starts
    ]
    return float(np.sqrt(min(polished)))


BRUTE_FORCE_MM = 1e-6
"""BFGS with difference derivatives stops about 1e-6 rad from the minimum, where the distance is flat."""

DEEP = [
    (0.0, 0.0, 0.0),  # the centre: both ends of the shortest axis are equally near
    (0.0, 0.0, 30.0),  # on an axis, inside the evolute
    (0.0, 200.0, 0.0),  # on the longest axis
    (40.0, 0.0, 0.0),
    (20.0, 100.0, 0.0),  # on the plane of the shortest axis: two points equally near
    (50.0, -250.0, 0.0),
    (0.0, -390.0, 2.0),
    (60.0, 120.0, 1e-6),  # next to that plane
    (1e-9, 1e-9, 1e-9),
    (10.0, 10.0, 10.0),
    (0.0, 500.0, 0.0),  # outside, on the axes
    (-300.0, 0.0, 0.0),
    (0.0, 0.0, -131.0),
]


@pytest.mark.parametrize("point", DEEP)
@pytest.mark.parametrize("axes", [(153.0, 404.0, 130.0), (130.0, 153.0, 404.0), (140.0, 140.0, 300.0)])
def test_nearest_of_all_surface_points(point, axes):
    p, a = np.array(point), np.array(axes)
    found = float(distance(jnp.asarray(p), jnp.asarray(a)))
    assert abs(found) == pytest.approx(brute_force_mm(p, a), abs=BRUTE_FORCE_MM)
    assert (found > 0.0) == (np.sum((p / a) ** 2) > 1.0)


def test_deep_inside_next_to_the_plane_of_the_shortest_axis():
    """At the centre the distance is minus the shortest semi-axis, and foot points near it are on the surface."""
    generator = np.random.default_rng(7)
    axes = generator.uniform(60.0, 450.0, (3, 1000))
    found = [float(distance(ZERO, jnp.asarray(a))) for a in axes.T[:200]]
    np.testing.assert_allclose(found, -axes.min(axis=0)[:200], rtol=0.0, atol=ROUNDING_MM)
    for scale in (1e-12, 1e-9, 1e-6, 1e-3):
        x = np.asarray(closest(jnp.asarray(scale * generator.normal(size=axes.shape)), jnp.asarray(axes)))
        assert np.abs(np.sum((x / axes) ** 2, axis=0) - 1.0).max() <= ON_SURFACE


@pytest.mark.parametrize("name", model_names())
def test_the_steps_that_every_point_takes_are_enough_near_the_surface(name, monkeypatch):
    """Check the root without the loop, near the surface: the function is nearly linear, and the error irrelevant."""
    direction = np.random.default_rng(12).normal(size=(3, 1000))
    a = np.asarray(load_model(name).girdle.semi_axes_mm)[:, None] * np.ones_like(direction)
    x = a * direction / np.linalg.norm(direction, axis=0)
    normal = x / a**2 / np.linalg.norm(x / a**2, axis=0)
    off_mm = np.linspace(-20.0, 60.0, 1000)
    monkeypatch.setattr(ellipsoid, "repeat_while", lambda unfinished, again, carry: carry)
    found = signed_distance_mm(x + off_mm * normal, np.zeros_like(x), a)
    np.testing.assert_allclose(found, off_mm, rtol=0.0, atol=LOOP_MM)


def test_a_point_without_numbers_leaves_the_others():
    x, a = sample(64, seed=5)
    with_nan = x.copy()
    with_nan[1, 7] = np.nan
    found = np.asarray(distance(jnp.asarray(1.5 * with_nan), jnp.asarray(a)))
    expected = np.array(distance(jnp.asarray(1.5 * x), jnp.asarray(a)))
    assert np.isnan(found[7])
    assert np.array_equal(np.delete(found, 7), np.delete(expected, 7))


# --- properties -----------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(p=POINT, q=POINT, a=AXES)
def test_no_two_distances_differ_by_more_than_the_way_between(p, q, a):
    axes, p, q = jnp.array(a), jnp.array(p), jnp.array(q)
    way = float(jnp.linalg.norm(p - q))
    assert abs(float(distance(p, axes) - distance(q, axes))) <= way + ROUNDING_MM


@settings(max_examples=100, deadline=None)
@given(p=POINT, a=AXES, order=st.permutations([0, 1, 2]), signs=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3))
def test_the_names_and_signs_of_the_axes_do_not_matter(p, a, order, signs):
    turned = jnp.array(p)[jnp.array(order)] * jnp.array(signs), jnp.array(a)[jnp.array(order)]
    assert float(distance(*turned)) == pytest.approx(float(distance(jnp.array(p), jnp.array(a))), abs=ROUNDING_MM)


@settings(max_examples=100, deadline=None)
@given(p=POINT, a=AXES, scale=st.floats(0.01, 100.0))
def test_it_is_a_length(p, a, scale):
    expected = scale * float(distance(jnp.array(p), jnp.array(a)))
    found = float(distance(scale * jnp.array(p), scale * jnp.array(a)))
    assert found == pytest.approx(expected, abs=ROUNDING_MM * max(scale, 1.0))


# --- derivatives ----------------------------------------------------------------------------------

SMOOTH = [
    (160.0, 20.0, 40.0),
    (100.0, 100.0, 80.0),
    (-120.0, 380.0, 30.0),
    (30.0, -20.0, 100.0),
    (0.0, 450.0, 0.0),
]
"""Points outside, inside and on an axis, all away from the evolute."""


def central(f, x: np.ndarray, step: float = 1e-4) -> np.ndarray:
    """Compute df/dx along the last axis by central differences."""
    ends = [(np.asarray(f(x + step * e)) - np.asarray(f(x - step * e))) / (2 * step) for e in np.eye(len(x))]
    return np.stack(ends, axis=-1)


@pytest.mark.parametrize("point", SMOOTH)
def test_the_gradient_is_that_of_differences(point):
    p, c, a = np.array(point), np.array([1.0, -2.0, 3.0]), np.array(THORAX)
    by_point, by_centre, by_axes = (np.asarray(g) for g in gradient(p, c, a))
    f = distance_from
    np.testing.assert_allclose(by_point, central(lambda x: f(x, c, a), p), rtol=0.0, atol=GRADIENT_FD)
    np.testing.assert_allclose(by_centre, central(lambda x: f(p, x, a), c), rtol=0.0, atol=GRADIENT_FD)
    np.testing.assert_allclose(by_axes, central(lambda x: f(p, c, x), a), rtol=0.0, atol=GRADIENT_FD)
    assert np.linalg.norm(by_point) == pytest.approx(1.0, abs=EXACT)
    np.testing.assert_allclose(by_centre, -by_point, rtol=0.0, atol=EXACT)


def of_nine(z):
    return signed_distance_mm(z[:3], z[3:6], z[6:])


nine_gradient, nine_hessian = few_runs(jax.grad(of_nine)), few_runs(jax.hessian(of_nine))
nine_reverse = few_runs(jax.jacrev(jax.grad(of_nine)))
nine_forward = few_runs(jax.jacfwd(jax.jacfwd(of_nine)))
slope_in_forward_mode = few_runs(jax.jacfwd(of_nine))


@pytest.mark.parametrize("point", SMOOTH)
def test_the_hessian_is_that_of_differences_and_symmetric(point):
    z = np.concatenate([np.array(point), [1.0, -2.0, 3.0], np.array(THORAX)])
    H = np.asarray(nine_hessian(z))
    np.testing.assert_allclose(H, central(nine_gradient, z), rtol=0.0, atol=HESSIAN_FD)
    np.testing.assert_allclose(H, H.T, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(nine_reverse(z), H, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(nine_forward(z), H, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(slope_in_forward_mode(z), nine_gradient(z), rtol=0.0, atol=EXACT)
    assert np.abs(H[:3, :3] @ np.asarray(nine_gradient(z))[:3]).max() <= EXACT  # the normal is constant along itself


def test_on_a_sphere_the_hessian_is_that_of_the_norm():
    p = np.array([30.0, -40.0, 120.0])
    H = np.asarray(nine_hessian(np.concatenate([p, np.zeros(3), np.full(3, 100.0)])))[:3, :3]
    n = p / np.linalg.norm(p)
    np.testing.assert_allclose(H, (np.eye(3) - np.outer(n, n)) / np.linalg.norm(p), rtol=0.0, atol=EXACT)


def test_jit_vmap_and_grad_compose_in_any_order():
    x, a = sample(16, seed=6)
    p, a = jnp.asarray(1.2 * x), jnp.asarray(a)
    grad = jax.grad(signed_distance_mm)
    centre = jnp.zeros_like(p)
    expected = one_run(jax.vmap(grad, in_axes=-1, out_axes=-1))(p, centre, a)
    summed = jax.grad(lambda p: jnp.sum(jax.jit(signed_distance_mm)(p, centre, a)))(p)
    each = jax.vmap(signed_distance_mm, in_axes=-1)
    of_vmap = jax.jit(jax.grad(lambda p: jnp.sum(each(p, centre, a))))(p)
    jitted_inside = jax.vmap(jax.jit(grad), in_axes=-1, out_axes=-1)(p, centre, a)
    for other in (summed, of_vmap, jitted_inside):
        np.testing.assert_allclose(other, expected, rtol=0.0, atol=EXACT)
    together = one_run(signed_distance_mm)(p, centre, a)
    np.testing.assert_allclose(one_run(each)(p, centre, a), together, rtol=0.0, atol=EXACT * 1e3)
