"""E as a function of theta, and its slopes, of several problems at once: one program for all tests that ask for it."""

import jax
import jax.numpy as jnp
from programs import few_runs

from adapt.differentiable import objective
from models.girdle import Girdle

PROBLEMS = 4
"""Problems compiled together: fewer are padded, more go in chunks. One would do for an optimiser, many for a table."""


def _nested(theta, girdle, points, angles):
    return objective(theta, girdle, points, angles)


_values_and_slopes = few_runs(jax.vmap(jax.value_and_grad(_nested)))


def values_and_slopes(
    theta: jax.Array, girdle: Girdle, points: jax.Array, angles: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """E and dE/dtheta of problems along the first axis of all arrays: jit of vmap of grad."""
    given = theta, girdle, points, angles
    found = []
    for first in range(0, len(theta), PROBLEMS):
        index = jnp.minimum(jnp.arange(first, first + PROBLEMS), len(theta) - 1)
        found.append(_values_and_slopes(*jax.tree.map(lambda x, index=index: jnp.asarray(x)[index], given)))
    values, slopes = (jnp.concatenate(parts)[: len(theta)] for parts in zip(*found, strict=True))
    return values, slopes
