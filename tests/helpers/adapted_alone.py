"""One subject adapted by ``adapt.differentiable``: one program, of one shape, for all tests that ask for it."""

import jax
import jax.numpy as jnp
import numpy as np
from programs import few_runs

from adapt.differentiable import AdaptedSubject, adapt_subject

POSTURES = 22
"""Of every subject; those that it has not are padding."""


def padded(angles: np.ndarray) -> np.ndarray:
    return np.pad(angles, ((0, 0), (0, POSTURES - angles.shape[1])), constant_values=np.nan)


def theta_and_result(girdle, points_mm, bounds_mm, angles, weight, measured):
    found = adapt_subject(girdle, points_mm, bounds_mm, angles, measured, weight)
    return found.theta_mm, found


def alone(*given) -> tuple[AdaptedSubject, AdaptedSubject]:
    """The result of what ``theta_and_result`` takes, and its slope where all numbers but ``measured`` grow by one."""
    *numbers, measured = given  # all float64: a Python number has a weak type, and would ask for another program
    return _alone(jax.tree.map(lambda x: jnp.asarray(x, float), tuple(numbers)), jnp.asarray(measured))


@few_runs
def _alone(numbers: tuple, measured) -> tuple[AdaptedSubject, AdaptedSubject]:
    def result(girdle, points_mm, bounds_mm, angles, weight):
        return theta_and_result(girdle, points_mm, bounds_mm, angles, weight, measured)[1]

    return jax.jvp(result, numbers, jax.tree.map(jnp.ones_like, numbers))
