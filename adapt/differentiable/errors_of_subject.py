"""What an adaptation of a subject minimises, and where it starts.

    E(theta) = |r(theta)|^2 + sum_p c_p J_p(theta)

Of the thesis (Eq. 6.3-6.5) theta are the adapted parameters, |r|^2 is D, and c_p = w / postures. With bones of the
person's own (``docs/method.md``) theta are sizes z in SDs, |r|^2 = w sigma^2 |z|^2 / m, and c_p = w m_p / m with m_p
the measured angles of a posture and m those of all.
"""

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.differentiable.closest_posture import target
from adapt.differentiable.small_systems import least_squares
from models.adapted_parameters import STARTS_MM
from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.person.own_bones import NO_SDS, SIZES, OwnSDs, spread_about
from motions.arrays import Array
from motions.rotations import DEG

WEIGHT = 10.0
"""w of Eq. 6.5 (thesis 6.2.6)."""

_SLACKS_MM = np.array([(1.0, 0.3, 0.1, 0.03, 0.01), (np.inf, np.inf, 0.1, 0.03, 0.01), [np.inf] * 5])
"""SDs of the constraints in the stages of each start of own bones: those of the compiled fits. Without an end: no chain
at all, and the set's girdle."""

_STEPS_A_STAGE = 20
"""At most: a stage is a start of the next one."""

SAME_SCALES: Mapping[str, float] = MappingProxyType({})


class OwnPrior(NamedTuple):
    """How persons differ from a girdle, and the noise of the angles."""

    columns_mm: Float[Array, "numbers sizes"]
    """What one SD of each size adds to ``Girdle.numbers_mm``."""
    noise_deg: Float[Array, ""]
    """sigma, of every measured angle."""

    @classmethod
    def about(
        cls,
        model: ParameterSet,
        noise_deg: float,
        scales: Mapping[str, float] = SAME_SCALES,
        sds: OwnSDs = NO_SDS,
    ) -> "OwnPrior":
        """Lay out that of a parameter set: ``models.person.own_bones.SIZES``, with other ``sds`` than theirs by name.

        ``scales`` are factors of the SDs by group, adapted, bones and frames: ``adapted_scale`` and so on of
        ``parameters.csv``, which has ``noise_deg`` too.
        """
        factors = np.array([scales.get(one.group, 1.0) for one in SIZES])
        return cls(jnp.asarray(spread_about(model, sds).columns_mm * factors), jnp.asarray(noise_deg))


class Problem(NamedTuple):
    """E of a subject."""

    girdle: Girdle
    points_mm: Array
    s: Array
    """Measured angles, at rest where not measured."""
    W: Array
    """Of J; 0 where not measured."""
    weight: Array
    own: OwnPrior | None

    def girdle_at(self, theta: Array) -> Girdle:
        """Give the girdle at theta."""
        if self.own is None:
            return self.girdle.with_adapted(theta)
        return Girdle.of_numbers(self.girdle.numbers_mm + self.own.columns_mm @ theta)

    def at(self, theta: Array) -> tuple[Girdle, Array, Array]:
        """Give the girdle, s and W."""
        return self.girdle_at(theta), self.s, self.W

    @property
    def angles(self) -> Array:
        """m_p; 0 of padding."""
        return jnp.sum(self.W > 0.0, axis=0)

    @property
    def shares(self) -> Array:
        """c_p; 0 of padding."""
        counts = self.angles if self.own is not None else self.angles > 0
        return self.weight * counts / jnp.sum(counts)

    def mean(self, of_postures: Array) -> Array:
        """Take the mean over the postures that count; padding is 0."""
        return jnp.sum(of_postures) / jnp.sum(self.angles > 0)

    def distances(self, theta: Array) -> Array:
        """Compute how far the thorax points are from the ellipsoid."""
        girdle = self.girdle_at(theta)
        return signed_distance_mm(self.points_mm, girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None])

    def others(self, theta: Array) -> Array:
        """Compute r."""
        if self.own is None:
            return self.distances(theta) / np.sqrt(self.points_mm.shape[1])
        return jnp.sqrt(self.weight / jnp.sum(self.angles)) * self.own.noise_deg * theta

    def starts(self, bounds: Array | None) -> Array:
        """Lay out thetas to start from, one each row."""
        if self.own is None:
            around = least_squares(self.distances, self.girdle.adapted_mm) + STARTS_MM
            return around if bounds is None else jnp.clip(around, *bounds)
        return jax.lax.map(partial(_softly, self, self.own), jnp.asarray(1.0 / _SLACKS_MM))


def problem_of(girdle: Girdle, points_mm, angles, measured, weight, own: OwnPrior | None = None) -> Problem:
    """Lay out what was given."""
    return jax.tree.map(jnp.asarray, Problem(girdle, points_mm, *target(angles, measured), weight, own))


def _softly(problem: Problem, own: OwnPrior, stiffnesses: Array) -> Array:
    """Go where chains lead whose constraints have less and less slack: sizes and postures in one least squares."""
    s, count = problem.s, own.columns_mm.shape[1]
    counts = problem.angles > 0

    def residuals(both: Array, stiffness: Array) -> Array:
        sizes, q = both[:count], both[count:].reshape(s.shape)
        g = jax.vmap(problem.girdle_at(sizes).residuals_mm, -1, -1)(q)
        gaps = jnp.where(problem.W > 0.0, DEG * (q - s), 0.0)
        return jnp.concatenate([own.noise_deg * sizes, gaps.ravel(), (stiffness * counts * g).ravel()])

    def stage(both: Array, stiffness: Array) -> tuple[Array, None]:
        return least_squares(partial(residuals, stiffness=stiffness), both, most_steps=_STEPS_A_STAGE), None

    return jax.lax.scan(stage, jnp.concatenate([jnp.zeros(count), s.ravel()]), stiffnesses)[0][:count]
