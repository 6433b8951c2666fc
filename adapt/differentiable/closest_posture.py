"""The closest closed posture as a differentiable function: least J = mean (q - s)^2 where g(q) = 0 (thesis 6.2.3)."""

import logging
from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float

from adapt.differentiable.constrained_optimum import HARDER, NEAR, SOFTLY, following, reached
from models.ellipsoid import signed_distance_mm
from models.girdle import COUNT_OF_NUMBERS, Girdle
from motions.arrays import Array, batch_text
from motions.errors import InputError
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

_OFFSETS_DEG = np.concatenate([np.zeros((1, 6)), np.random.default_rng(1).uniform(-30.0, 30.0, (9, 6))])
_SLACKS = np.stack([SOFTLY] * 5 + [HARDER] * 5)
"""Starting points about the measured angles, and the slacks of the search from each: J has several local minima. These
starts lead to the J of the compiled fits in every one of 415 shipped and measured postures with six sets, and to the E
of the compiled adaptations in every one of 18 subjects; five starts miss the E of one subject by 1.4 %."""


class PostureFit(NamedTuple):
    """Closest closed posture; NaN where the fit did not converge."""

    angles: Float[Array, " 6 *batch"]
    """Angles q, rad."""
    multipliers: Float[Array, " 3 *batch"]
    """Lagrange multipliers lambda of A1-A3, deg^2 per mm."""
    j_deg2: Float[Array, " *batch"]
    """J_p, deg^2; 0 for padding."""

    def __repr__(self) -> str:
        return f"PostureFit({batch_text('posture', self.j_deg2)})"


class Postures(NamedTuple):
    """Closed postures of one girdle, which theta moves. Posture fits alone have an empty theta."""

    s: Float[Array, "6 postures"]
    """Measured angles; angles at rest where not measured."""
    R: Float[Array, "6 postures"]
    """Factors in J = sum (R (q - s))^2: 0 where not measured, NaN where too few angles were."""
    share: Float[Array, " postures"]
    """Square root of the weight of each J; 0 for padding, which stays where it is."""
    girdle: Girdle
    columns: Float[Array, "numbers thetas"]
    """Change of ``Girdle.numbers_mm`` per unit of theta."""
    bounds: Float[Array, "2 thetas"]
    points_mm: Float[Array, "3 points"]
    """Points whose mean squared distance counts."""
    pull: float | Float[Array, ""]
    """Square root of the weight of theta^2."""

    def girdle_at(self, theta: Array) -> Girdle:
        """Build the girdle at theta."""
        return Girdle.of_numbers(self.girdle.numbers_mm + self.columns @ theta)

    def residuals(self, theta: Array, q: Array) -> tuple[Array, Array]:
        """Compute the residuals whose sum of squares is E: those of theta alone, and those of each posture."""
        distances = distances_mm(self.girdle_at(theta), self.points_mm) / np.sqrt(max(1, self.points_mm.shape[1]))
        gaps = jnp.where(self.share > 0.0, self.share * self.R, 1.0) * (q - self.s)
        return jnp.concatenate([distances, self.pull * theta]), gaps

    def constraints(self, theta: Array, q: Array) -> Array:
        """Compute A1-A3 of every posture, times ``share``; for padding, residuals that keep it where it is."""
        g = _open_by_mm(self.girdle_at(theta), q)
        return jnp.where(self.share > 0.0, self.share * g, (q - self.s)[:3])

    def fits(self, own: Array) -> PostureFit:
        """Return the postures of (q, lambda), with unmeasured angles within half a turn of rest."""
        q, multipliers = own[:6], own[6:]
        q -= 2.0 * jnp.pi * jnp.where(self.R == 0.0, jnp.round((q - self.s) / (2.0 * jnp.pi)), 0.0)
        of_J = multipliers / jnp.where(self.share > 0.0, self.share, 1.0)
        return PostureFit(q, of_J, jnp.sum((self.R * (q - self.s)) ** 2, axis=0))


@jax.jit
def _open_by_mm(girdle: Girdle, q: Array) -> Array:
    """Compute A1-A3."""
    return girdle.residuals_mm(q)


@jax.jit
def distances_mm(girdle: Girdle, points_mm: Array) -> Array:
    """Compute the distances of points to the ellipsoid."""
    return signed_distance_mm(points_mm, girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None])


def fit_posture(
    girdle: Girdle,
    angles: Float[Array, " 6 *batch"],
    measured: Bool[Array, " 6 *batch"] | None = None,
    start: Float[Array, " 6 *batch"] | None = None,
) -> PostureFit:
    """Fit postures: q, lambda and J_p (Eq. 6.1-6.2), differentiable in the girdle and the measured angles.

    Derivatives work in forward and reverse mode, to any order, with ``jit`` and ``vmap`` in any order. ``angles`` are
    in rad; angles whose ``measured`` is False do not count, whatever their value. A posture without measured angles is
    padding: J and every derivative are 0. A posture with fewer than three is NaN. ``girdle`` has the same batch axes,
    or none. The result is the lowest J of several starts, or the J reached from ``start`` (rad) alone.

    The first call compiles for some 5 s, a derivative as long again. InputError for an input of another type or shape,
    or if an angle is above a full turn, which ``jit`` cannot see. Masked angles are not measured.
    """
    s, R = target(girdle, angles, measured)
    if start is not None:
        check_shape("start", start, s.shape)
    say_compiling()
    return fit_from(jax.tree.map(jnp.asarray, girdle), s, R, start)


@cache
def say_compiling() -> None:
    """Warn once per process that the first call compiles and seems to do nothing."""
    logging.getLogger(__package__).warning("the first call compiles for 5 to 15 s; later calls do not")


_IN_RAD = "np.deg2rad(motions.angles_deg).T"


def target(girdle: Girdle, angles, measured, axes: int | None = None) -> tuple[Array, Array]:
    """Return s and R; raise an InputError for a girdle, angles or ``measured`` of the wrong type, shape or unit.

    ``axes``: number of axes of the angles; any number if None.
    """
    if not isinstance(girdle, Girdle):
        raise InputError("girdle", None, f"this is a {type(girdle).__name__}", "Give load_model(name).girdle")
    angles, measured = _arrays(angles, measured)
    shape = np.shape(angles)
    if shape[:1] != (6,) or axes not in (None, len(shape)):
        raise InputError("angles", None, f"their shape is {shape}", f"Give (6, postures) in rad: {_IN_RAD}")
    check_shape("measured", measured, shape)
    if not any(isinstance(x, Tracer) for x in (angles, measured)):
        largest = np.max(np.abs(np.where(measured, angles, 0.0)), initial=0.0)
        if largest > 2.0 * np.pi:
            raise InputError("angles", None, f"one is {largest:g} rad", f"Give radians: {_IN_RAD}")
    rest, count = (REST_DEG / DEG).reshape(6, *[1] * (jnp.ndim(angles) - 1)), jnp.sum(jnp.asarray(measured), axis=0)
    enough = jnp.where((count == 0) | (count >= FEWEST_ANGLES), DEG / jnp.sqrt(jnp.maximum(count, 1)), jnp.nan)
    return jnp.where(measured, angles, rest), jnp.where(measured, enough, 0.0)


def _arrays(angles, measured) -> tuple[Array, Array]:
    """Return both as arrays, with masked angles as not measured; raise an InputError where ``measured`` is no truth."""
    if isinstance(angles, (list, tuple)):
        angles = np.asarray(angles, float)
    measured = np.ones(np.shape(angles), bool) if measured is None else measured
    if not isinstance(measured, (np.ndarray, jax.Array)):
        measured = np.asarray(measured)
    if measured.dtype.kind not in "biu":
        cause = f"its entries are of type {measured.dtype}, not True or False"
        raise InputError("measured", None, cause, "Give np.isfinite(angles), or measured > 0")
    measured = measured != 0
    if isinstance(angles, np.ma.MaskedArray):
        measured, angles = measured & ~np.ma.getmaskarray(angles), angles.filled(0.0)
    return angles, measured


def check_shape(name: str, value, wanted: tuple[int, ...]) -> None:
    """Raise an InputError where an input has another shape than wanted."""
    if np.shape(value) != wanted:
        raise InputError(name, None, f"its shape is {np.shape(value)}", f"Give {wanted}")


def fit_from(girdle: Girdle, s: Array, R: Array, start: Array | None = None) -> PostureFit:
    """Fit postures along the axes of s after the first.

    The search is compiled apart: with it, every derivative would compile it again.
    """
    return _described(girdle, s, R, _searched(*jax.lax.stop_gradient((girdle, s, R, start))))


@jax.jit
def _searched(girdle: Girdle, s: Array, R: Array, start: Array | None):
    """Find the optimum of every posture: x, and an empty array for its bounds; NaN where no start leads to one."""

    def search(girdle, s, R, start):
        one = _alone(girdle, s, R)
        starts = (s + _OFFSETS_DEG / DEG, _SLACKS) if start is None else (start[None], NEAR[None])
        x, beyond, J = jax.lax.map(lambda of: reached(one, (one.columns[0], of[0][:, None]), of[1]), starts)
        x = jax.tree.map(lambda of: jnp.where(jnp.isfinite(jnp.min(J)), of[jnp.argmin(J)], jnp.nan), x)
        return x, beyond[0]

    return _along(search, girdle, s)(girdle, s, R, start)


@jax.jit
def _described(girdle: Girdle, s: Array, R: Array, found) -> PostureFit:
    """Describe the optimum of every posture, which follows girdle, s and R."""

    def describe(girdle, s, R, found):
        (x, beyond), one = found, _alone(girdle, s, R)
        _, own = following(one, beyond, x)
        return jax.tree.map(lambda of: of[..., 0], one.fits(own))

    return _along(describe, girdle, s)(girdle, s, R, found)


def _along(fit, girdle: Girdle, s: Array):
    """Map a function of girdle, s, R and one more over the axes of s after the first."""
    for _ in range(s.ndim - 1):
        fit = jax.vmap(fit, (None if girdle.conoid_length_mm.ndim == 0 else -1, -1, -1, -1), -1)
    return fit


def _alone(girdle: Girdle, s: Array, R: Array) -> Postures:
    """Return the problem of one posture, whose theta is empty."""
    count, nothing = 1.0 * jnp.any(R != 0.0, keepdims=True), jnp.zeros((COUNT_OF_NUMBERS, 0))
    return Postures(s[:, None], R[:, None], count, girdle, nothing, nothing[:2], nothing[:3], 0.0)
