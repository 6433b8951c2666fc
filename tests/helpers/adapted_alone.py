"""Adaptation of one subject by ``adapt.differentiable``, as one compiled program of one shape for all tests."""

import jax
import jax.numpy as jnp
import numpy as np
from programs import few_runs

from adapt.differentiable import AdaptedSubject, adapt_subject

POSTURES = 22
"""Number of postures of every subject; missing postures are padded."""


def padded(angles: np.ndarray) -> np.ndarray:
    return np.pad(angles, ((0, 0), (0, POSTURES - angles.shape[1])), constant_values=np.nan)


def theta_and_result(girdle, points_mm, bounds_mm, angles, weight, measured):
    found = adapt_subject(girdle, points_mm, bounds_mm, angles, measured, weight)
    return found.theta_mm, found


def alone(*given) -> tuple[AdaptedSubject, AdaptedSubject]:
    """Adapt one subject; return the result, and its directional derivative where all numbers but ``measured`` grow at
    rate 1.

    The arguments are those of ``theta_and_result``.
    """
    # All arrays are float64: a Python number has a weak type, and would need another program.
    *numbers, measured = given
    return _alone(jax.tree.map(lambda x: jnp.asarray(x, float), tuple(numbers)), jnp.asarray(measured))


@few_runs
def _alone(numbers: tuple, measured) -> tuple[AdaptedSubject, AdaptedSubject]:
    def result(girdle, points_mm, bounds_mm, angles, weight):
        return theta_and_result(girdle, points_mm, bounds_mm, angles, weight, measured)[1]

    return jax.jvp(result, numbers, jax.tree.map(jnp.ones_like, numbers))
