"""Search for the root of a smooth function that is nearest to 0 within a window.

The function is sampled across the window. A root lies between two neighbouring samples of different sign, or beside an
extremum that crosses zero between two samples; to find such roots, the extremum at the sample of the smallest absolute
value is refined. Newton steps within the bracket, replaced by bisection where they would leave the bracket, then find
the root to rounding error.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

_MOST_STEPS = 60
"""Limit of steps. Bisection alone reduces an interval of 2.5 degrees to rounding in 50; Newton needs about five."""

_SETTLED = 1e-15
"""Last step, relative to the window, of a root that is exact to rounding."""


def nearest_root(
    at: Callable[[Array], tuple[Array, Array]], shape: tuple[int, ...], window: float, samples: int
) -> tuple[Float[Array, " *batch"], Bool[Array, " *batch"]]:
    """Find the root in [-window, window] that is nearest to 0, and a mask that is True where there is one.

    ``at`` returns value and slope at arguments of ``shape``; each element is a function of its own. If the distances of
    two roots to 0 differ by less than the spacing of the samples, either may be found. For derivatives use the implicit
    function theorem at the root.
    """
    low, high, rising, found = _bracket(at, shape, window, samples)
    return _within(at, low, high, rising, window), found


def _bracket(at, shape, window, samples) -> tuple[Array, Array, Bool[Array, " *batch"], Bool[Array, " *batch"]]:
    """Find the two neighbouring samples around the root nearest to 0, as estimated by secants, and two masks: True
    where the function rises between them, and True where there is a root."""
    line = jnp.linspace(-window, window, samples)
    places = jnp.broadcast_to(line.reshape(samples, *[1] * len(shape)), (samples, *shape))
    values, _ = jax.lax.map(at, places)
    extremum, there = _extremum(at, places, values)
    places, values = jnp.concatenate([places, extremum[None]]), jnp.concatenate([values, there[None]])
    order = jnp.argsort(places, axis=0)
    places, values = (jnp.take_along_axis(one, order, axis=0) for one in (places, values))
    changes = values[:-1] * values[1:] <= 0.0
    fall = values[:-1] - values[1:]
    secant = places[:-1] + (places[1:] - places[:-1]) * values[:-1] / jnp.where(fall == 0.0, 1.0, fall)
    nearest = jnp.argmin(jnp.where(changes, abs(secant), jnp.inf), axis=0)[None]
    low, high, fall = (jnp.take_along_axis(one, nearest, axis=0)[0] for one in (places[:-1], places[1:], fall))
    return low, high, fall < 0.0, changes.any(axis=0)


def _extremum(at, places, values) -> tuple[Array, Array]:
    """Find the extremum next to the sample of the smallest absolute value, and the value there.

    If the samples of every function change sign, no search takes place, and the result is that sample itself.
    """
    k = jnp.clip(jnp.argmin(abs(values), axis=0), 1, len(values) - 2)[None]
    low, here, high = (jnp.take_along_axis(places, k + side, axis=0)[0] for side in (-1, 0, 1))
    value = jnp.take_along_axis(values, k, axis=0)[0]
    side = jnp.sign(value)
    rootless = ~(values[:-1] * values[1:] <= 0.0).any(axis=0)

    def halve(state):
        step, low, high, *_ = state
        middle = 0.5 * (low + high)
        value, slope = at(middle)
        falls = slope * side < 0.0
        return step + 1, jnp.where(falls, middle, low), jnp.where(falls, high, middle), middle, value

    def wanting(state):
        return (state[0] < _MOST_STEPS) & rootless.any()

    return jax.lax.while_loop(wanting, halve, (0, low, high, here, value))[-2:]


def _within(at, low, high, rising, window) -> Array:
    """Find the root between two arguments with values of different sign."""

    def step(state):
        number, root, low, high, _ = state
        value, slope = at(root)
        below = (value < 0.0) == rising
        low, high = jnp.where(below, root, low), jnp.where(below, high, root)
        newton = root - value / jnp.where(slope == 0.0, 1.0, slope)
        inside = (newton > low) & (newton < high) & (slope != 0.0)
        new = jnp.where(value == 0.0, root, jnp.where(inside, newton, 0.5 * (low + high)))
        return number + 1, new, low, high, abs(new - root)

    def moving(state):
        return (state[0] < _MOST_STEPS) & (state[4] > _SETTLED * window).any()

    middle = 0.5 * (low + high)
    return jax.lax.while_loop(moving, step, (0, middle, low, high, jnp.full_like(middle, jnp.inf)))[1]
