"""The closest closed posture as a differentiable function.

J = 1/2 sum W_i (q_i - s_i)^2 with g(q) = 0 (thesis Eq. 6.1-6.2). Its optimum x = (q, lambda) is the root of

    F(x) = (W (q - s) + G' lambda, g),      K = dF/dx, 9 x 9,      dx = -K^-1 dF        (implicit function theorem).
"""

import logging
from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float

from adapt.differentiable.small_systems import solve, with_derivative
from models.girdle import Girdle
from motions.arrays import Array
from motions.errors import InputError
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

_LOG = logging.getLogger(__package__)

_OFFSETS_DEG = np.concatenate([np.zeros((1, 6)), np.random.default_rng(1).uniform(-30.0, 30.0, (9, 6))])
"""Starts of a posture fit about the measured angles: J has several local minima. These lead to the J of the compiled
fits in every one of 415 shipped and measured postures with six sets."""

_LENGTHS = np.array([1.0, 0.3, 0.05])
"""Of a step, tried side by side."""

_LONGEST_RAD, _LAST_RAD = 0.5, 1e-7
"""No step is longer; one as short as the second is taken whole: the merit function does not resolve it."""

_HELD = 0.01
"""Weight in the step without curvature, relative to the largest, of an angle that was not measured. Where three were
not, J is 0 or has its optimum at a fold, where the constraints do not hold them: a step without weight has no end."""

_MOST_STEPS = 30
"""Five to twelve are needed; a start that takes more leads nowhere."""

_TOLERANCE = np.repeat([1e-8, 1e-9], [6, 3])
"""|F| of a solved posture, deg^2 a rad and mm. One more step follows, quadratically, and leaves rounding."""


class PostureFit(NamedTuple):
    """The closest closed posture; NaN where the fit did not converge."""

    angles: Float[Array, " 6 *batch"]
    """q, rad."""
    multipliers: Float[Array, " 3 *batch"]
    """lambda of A1-A3, deg^2 a mm."""
    j_deg2: Float[Array, " *batch"]
    """J_p, deg^2; 0 for padding."""


def fit_posture(
    girdle: Girdle,
    angles: Float[Array, " 6 *batch"],
    measured: Bool[Array, " 6 *batch"] | None = None,
    start: Float[Array, " 6 *batch"] | None = None,
) -> PostureFit:
    """Fit postures: q, lambda and J_p (Eq. 6.1-6.2), differentiable in the girdle and the measured angles.

    Forward and reverse, any number of times, with ``jit`` and ``vmap`` in any order. ``angles`` in rad; those whose
    ``measured`` is False do not count, whatever they are. A posture with none is padding: J and every derivative are 0.
    One with fewer than three is NaN. ``girdle`` has the same batch axes, or none. The lowest J of several starts is
    taken, or that reached from ``start`` (rad) alone.

    The first call compiles for 5 to 20 s, a derivative as long again. InputError if the first axis is not six long, or
    if an angle is above a full turn, which ``jit`` cannot see.
    """
    s, W = target(angles, measured)
    return fits_from(jax.tree.map(jnp.asarray, girdle), s, W, starts_of(s, start))


@cache
def _say_compiling() -> None:
    """Say once a process why nothing seems to happen."""
    _LOG.warning("the first call compiles: a posture fit for 5 to 20 s, an adaptation for a minute; later calls do not")


def target(angles, measured) -> tuple[Array, Array]:
    """Compute s and W, refusing what no angles are."""
    _say_compiling()
    if jnp.shape(angles)[:1] != (6,):
        remedy = "Give (6, postures) in rad: np.deg2rad(motions.angles_deg).T"
        raise InputError("angles", None, f"their shape is {jnp.shape(angles)}", remedy)
    measured = np.ones(jnp.shape(angles), bool) if measured is None else measured
    if not any(isinstance(x, Tracer) for x in (angles, measured)):
        largest = np.max(np.abs(np.where(measured, angles, 0.0)), initial=0.0)
        if largest > 2.0 * np.pi:
            raise InputError(
                "angles", None, f"one is {largest:g} rad", "Give radians: np.deg2rad(motions.angles_deg).T"
            )
    rest = (REST_DEG / DEG).reshape(6, *[1] * (jnp.ndim(angles) - 1))
    count = jnp.maximum(jnp.sum(jnp.asarray(measured), axis=0), 1)
    return jnp.where(measured, angles, rest), jnp.where(measured, 2.0 * DEG**2 / count, 0.0)


def starts_of(s: Array, start=None) -> Array:
    """Lay out the starts of every posture: ``start`` alone, or places about s."""
    return jnp.asarray(start)[None] if start is not None else s + _OFFSETS_DEG.reshape(-1, 6, *[1] * (s.ndim - 1)) / DEG


@jax.jit
def _conditions(girdle: Girdle, s: Array, W: Array, x: Array) -> Array:
    """F(x) of one posture."""
    g, pull = jax.vjp(girdle.residuals_mm, x[:6])
    return jnp.concatenate([W * (x[:6] - s) + pull(x[6:])[0], g])


@jax.jit
def _newton(girdle: Girdle, s: Array, W: Array, x: Array) -> tuple[Array, Array]:
    """Step to the lowest J + penalty |g| of Newton's step and that without the curvature of g, each brought back to the
    surface; and |F| before it, in tolerances."""

    def limited(step):
        return step * jnp.minimum(1.0, _LONGEST_RAD / jnp.max(abs(step)))

    def to_surface(q):
        return q - limited(G.T @ solve(G @ G.T, girdle.residuals_mm(q)))

    def merit(q, multipliers):
        penalty = 2.0 * jnp.max(abs(multipliers))
        return 0.5 * jnp.sum(W * (q - s) ** 2) + penalty * jnp.sum(abs(girdle.residuals_mm(q)))

    F, K = with_derivative(partial(_conditions, girdle, s, W), x)
    G = K[6:, :6]
    steps = jax.vmap(solve, (0, None))(
        jnp.stack([K, K.at[:6, :6].set(jnp.diag(jnp.maximum(W, _HELD * jnp.max(W))))]), -F
    )
    q = x[:6] + _LENGTHS[:, None, None] * jax.vmap(limited)(steps[:, :6])
    q, multipliers = jax.vmap(to_surface)(q.reshape(-1, 6)), jnp.tile(x[6:] + steps[:, 6:], (len(_LENGTHS), 1))
    merits = jax.vmap(merit)(q, multipliers)
    lowest = jnp.argmin(jnp.where(jnp.isnan(merits), jnp.inf, merits))
    best = jnp.where(jnp.max(abs(steps[0, :6])) < _LAST_RAD, 0, lowest)
    return jnp.concatenate([q[best], multipliers[best]]), jnp.max(abs(F) / _TOLERANCE)


@jax.jit
def _fit_from(girdle: Girdle, s: Array, W: Array, start: Array) -> tuple[Array, Array]:
    """x and J reached from one start; J is infinite where it does not converge."""

    def unfinished(state):
        return (state[1] > 1.0) & (state[2] < _MOST_STEPS)

    def advance(state):
        return *_newton(girdle, s, W, state[0]), state[2] + 1

    first = jnp.concatenate([start, jnp.zeros(3)]), jnp.inf, 0
    x, error, _ = jax.lax.while_loop(unfinished, advance, first)
    return x, jnp.where(error <= 1.0, 0.5 * jnp.sum(W * (x[:6] - s) ** 2), jnp.inf)


def _lowest(girdle: Girdle, s: Array, W: Array, starts: Array) -> Array:
    """x of one posture."""
    x, J = jax.vmap(partial(_fit_from, girdle, s, W))(starts)
    count = jnp.sum(W > 0.0)
    found = jnp.where(jnp.isfinite(jnp.min(J)) & (count >= FEWEST_ANGLES), x[jnp.argmin(J)], jnp.nan)
    return jnp.where(count > 0, found, jnp.concatenate([s, jnp.zeros(3)]))


@jax.custom_jvp
def _following(girdle: Girdle, s: Array, W: Array, x: Array) -> Array:
    """Return the optimum x as it is; it follows where girdle and s move."""
    return x


@_following.defjvp
def _following_jvp(primals, tangents):
    girdle, s, W, _ = primals
    x = _following(*primals)
    _, moved = jax.jvp(lambda girdle, s, W: _conditions(girdle, s, W, x), (girdle, s, W), tangents[:3])
    K, counts = jax.jacfwd(partial(_conditions, girdle, s, W))(x), jnp.any(W > 0.0)
    return x, -solve(jnp.where(counts, K, jnp.eye(9)), jnp.where(counts, moved, 0.0))


def _each(of_posture: Callable[..., Array], girdle: Girdle, s: Array, W: Array, x: Array) -> Array:
    """Of every posture along the axes after the first of s."""
    for _ in range(s.ndim - 1):
        of_posture = jax.vmap(of_posture, (None if girdle.conoid_length_mm.ndim == 0 else -1, -1, -1, -1), -1)
    return of_posture(girdle, s, W, x)


def search(girdle: Girdle, s: Array, W: Array, starts: Array) -> Array:
    """Find x of every posture, without a derivative."""
    return _each(_lowest, *jax.lax.stop_gradient((girdle, s, W, starts)))


def fits_at(girdle: Girdle, s: Array, W: Array, x: Array) -> PostureFit:
    """Give the postures x with their derivatives."""
    x = _each(_following, girdle, s, W, jax.lax.stop_gradient(x))
    return PostureFit(x[:6], x[6:], 0.5 * jnp.sum(W * (x[:6] - s) ** 2, axis=0))


@jax.jit
def fits_from(girdle: Girdle, s: Array, W: Array, starts: Array) -> PostureFit:
    """Fit postures from their starts."""
    return fits_at(girdle, s, W, search(girdle, s, W, starts))
