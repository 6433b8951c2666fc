"""How far measured postures are from what the girdle with its effects can take, in units of the noise.

A posture of six angles leaves three informative numbers: A1, A2 and A3 at the measured angles. Noise of variance
sigma^2 on each angle gives them the covariance V = sigma^2 G G', so the whitened residual y = V^(-1/2) g(s) is
standard normal for the right parameters, to first order in the noise (Sampson; no inner fit). Its derivatives say
what each adapted parameter and each effect can explain.
"""

import itertools
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from adapt.batch import Batch
from adapt.linalg import Factor, jacobian, matmul, trace, transpose
from models.effects import Effect, ExtendedGirdle
from models.girdle import ADAPTED, Girdle
from motions.rotations import DEG
from motions.table import Motions

_RANK_FLOOR = 1e-12
"""Smallest pivot of V relative to its trace: only a chain on the point of locking comes near."""

_UNMEASURED_DEG = 1e3
"""Noise of an angle that was not measured: what it would say is worth nothing."""


@dataclass(frozen=True)
class Observed:
    """The postures of S subjects, padded to P, as the diagnosis sees them."""

    angles: Float[np.ndarray, "6 postures subjects"]
    measured: Bool[np.ndarray, "6 postures subjects"]
    elevation_deg: Float[np.ndarray, "postures subjects"]
    counted: Bool[np.ndarray, "postures subjects"]

    def of_subjects(self, index) -> "Observed":
        """Some of the subjects."""
        return Observed(*(value[..., index] for value in vars(self).values()))

    def without(self, left_out: Bool[np.ndarray, "postures subjects"]) -> "Observed":
        """The same with some postures not counted."""
        return Observed(self.angles, self.measured, self.elevation_deg, self.counted & ~left_out)


def observed(motions: Motions, batch: Batch) -> Observed:
    """The real subjects of a batch with their elevations; a missing elevation counts as the arm hanging."""
    real = slice(0, len(batch.subjects))
    elevation = np.nan_to_num(motions.humerus_elevation_deg)[batch.rows]
    fields = np.asarray(batch.angles), np.asarray(batch.measured), elevation, np.asarray(batch.counted)
    return Observed(*(value[..., real] for value in fields))


@dataclass(frozen=True)
class Whitened:
    """y and dy/dz of each subject at z = (theta, amplitudes of all effects); padding is zero."""

    y: Float[np.ndarray, "subjects residuals"]
    slopes: Float[np.ndarray, "subjects residuals parameters"]


def whitened(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    data: Observed,
    noise_deg: float,
    z: Float[np.ndarray, "parameters subjects"],
) -> Whitened:
    """Whitened residuals at z: adapted parameters in mm, then the amplitudes of every effect in its unit."""
    noise = np.where(data.measured, noise_deg, _UNMEASURED_DEG) / DEG
    arrays = (jnp.asarray(x) for x in (data.angles, noise, data.elevation_deg, z))
    y, slopes = (np.asarray(x) for x in _whitened(effects, girdle, *arrays))
    y = np.where(data.counted.T[..., None], np.transpose(y, (2, 1, 0)), 0.0)
    slopes = np.where(data.counted.T[..., None, None], np.transpose(slopes, (3, 2, 0, 1)), 0.0)
    subjects = y.shape[0]
    return Whitened(y.reshape(subjects, -1), slopes.reshape(subjects, y[0].size, -1))


@partial(jax.jit, static_argnums=0)
def _whitened(
    effects: tuple[Effect, ...], girdle: Girdle, angles: Array, noise: Array, elevation_deg: Array, z: Array
) -> tuple[Array, Array]:
    """y (3) and dy/dz (3, parameters) of every posture; V changes with z too, and dy/dz says so."""
    base = jax.tree.map(lambda x: x.reshape(*x.shape, 1, 1), girdle)
    ends = np.cumsum([len(ADAPTED), *(effect.amplitudes for effect in effects)])

    def whiten(z):
        amplitudes = tuple(z[a:b] for a, b in itertools.pairwise(ends))
        chain = ExtendedGirdle(base.with_adapted(z[: ends[0]]), amplitudes, elevation_deg, effects)
        spread = jacobian(chain.residuals_mm, angles) * noise[None]
        V = matmul(spread, transpose(spread))
        return Factor(V, _RANK_FLOOR * trace(V)).whiten(chain.residuals_mm(angles))

    over_postures = jnp.broadcast_to(z[:, None], (z.shape[0], *elevation_deg.shape))
    return whiten(over_postures), jacobian(whiten, over_postures)
