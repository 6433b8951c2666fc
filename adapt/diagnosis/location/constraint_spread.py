"""Violation of each constraint at the measured postures: adapted, with the causes, and from noise alone."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis.location.observations import Observed
from adapt.engine.batching import QUICK_TO_COMPILE, compiled, in_chunks
from models.effects import AnyGirdle
from models.girdle import CONSTRAINTS
from motions.arrays import Array
from motions.rotations import DEG

_CHUNK = 64
"""Number of postures per call of the compiled program, so that one compilation serves any number of postures."""


class ConstraintSpread(NamedTuple):
    """Root mean square violation of one constraint over all postures, mm."""

    constraint: str
    adapted_mm: float
    with_causes_mm: float
    noise_mm: float
    """Violation that noise of the angles alone causes in a chain that closes."""


def constraint_spread(
    data: Observed, adapted: AnyGirdle, with_causes: AnyGirdle, noise_deg: float
) -> list[ConstraintSpread]:
    """Compute the spread of A1-A3 over the postures with all six angles measured; empty where there is none.

    ``adapted`` and ``with_causes``: chains of all subjects, (component, postures, subjects).
    """
    used = np.asarray(data.measured.all(axis=0))
    if not used.any():
        return []
    angles = data.angles[:, used]
    each = [in_chunks(_linearised, _CHUNK, _at(chain, used), angles) for chain in (adapted, with_causes)]
    (before, _), (after, slopes) = each
    noise = _rms(np.sqrt(np.sum(np.square(slopes), axis=1))) * noise_deg / float(DEG)
    sizes = np.stack([_rms(before), _rms(after), noise], axis=1).tolist()
    return [ConstraintSpread(name, *one) for name, one in zip(CONSTRAINTS, sizes, strict=True)]


def _rms(values: Float[np.ndarray, "3 postures"]) -> Float[np.ndarray, "3"]:
    return np.sqrt(np.mean(values**2, axis=1))


def _at(chain: AnyGirdle, used: Bool[np.ndarray, "postures subjects"]) -> AnyGirdle:
    """Return the chain of each posture in use."""
    return jax.tree.map(lambda x: np.broadcast_to(x, (*np.shape(x)[:-2], *used.shape))[..., used], chain)


@partial(compiled, on_cpu=QUICK_TO_COMPILE)
def _linearised(
    chain: AnyGirdle, angles: Float[Array, " 6 postures"]
) -> tuple[Float[Array, " 3 postures"], Float[Array, " 3 6 postures"]]:
    """Compute A1-A3, mm, and their derivatives with respect to each angle, mm per rad."""
    g, along = jax.linearize(chain.residuals_mm, angles)
    units = jnp.broadcast_to(jnp.eye(6)[:, :, None], (6, *angles.shape))
    return g, jax.vmap(along, out_axes=1)(units)
