"""The nearest root in a window: polynomials with given roots, in and outside the window."""

import jax.numpy as jnp
import numpy as np
from programs import few_runs

from models.nearest_root import nearest_root

EXACT = 1e-13
"""Roots are of order 1 and exact to rounding."""

DOUBLE = 1e-7
"""Tolerance where two roots are 2e-4 apart and the slope is 2e-4: rounding of the value, 1e-16, over the slope, with
its square root at worst."""

WINDOW, SAMPLES = 1.0, 21


def product(place, roots):
    """Compute value and slope of (x - r1)(x - r2)..., roots (count, *batch)."""
    value, slope = jnp.ones_like(place), jnp.zeros_like(place)
    for root in roots:
        value, slope = value * (place - root), slope * (place - root) + value
    return value, slope


@few_runs
def found(roots):
    return nearest_root(lambda place: product(place, roots), roots.shape[1:], WINDOW, SAMPLES)


def test_the_root_nearest_to_zero_of_random_cubics_is_found():
    generator = np.random.default_rng(1)
    roots = generator.uniform(-2.5, 2.5, (3, 500))
    apart, sizes = np.diff(np.sort(roots, axis=0), axis=0).min(axis=0), np.sort(np.abs(roots), axis=0)
    roots = roots[:, np.minimum(apart, sizes[1] - sizes[0]) > 2.0 * WINDOW / (SAMPLES - 1)]
    nearest = roots[np.abs(roots).argmin(axis=0), np.arange(roots.shape[1])]
    place, there = found(roots)
    inside = np.abs(nearest) < WINDOW
    assert inside.sum() > 200
    assert (~inside).sum() > 5
    np.testing.assert_array_equal(there, inside)
    np.testing.assert_allclose(np.asarray(place)[inside], nearest[inside], rtol=0.0, atol=EXACT)


def test_two_roots_between_neighbouring_samples_are_seen():
    place, there = found(np.array([[0.3301], [0.3303]]))
    assert there.all()
    assert min(abs(place[0] - 0.3301), abs(place[0] - 0.3303)) < DOUBLE


def test_no_root_is_none():
    least = jnp.array([1e-9, 1.0, -1e-9])

    def parabola(place):
        return (place - 0.33) ** 2 + least, 2.0 * (place - 0.33)

    _, there = few_runs(lambda: nearest_root(parabola, (3,), WINDOW, SAMPLES))()
    np.testing.assert_array_equal(there, [False, False, True])
