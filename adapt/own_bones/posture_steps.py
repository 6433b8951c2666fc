"""One Newton step of a posture's optimality conditions with every number of the girdle left free, by JAX.

``adapt.solvers.newton.elimination`` does the same for the ellipsoid and the conoid, with derivatives written by hand,
and defines K, S, rho, tau and mu. This module takes all numbers x of a girdle, with effects, and derivatives by JAX.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.engine.jax_program import per_problem
from adapt.engine.kernel import Kernel
from adapt.solvers.newton.elimination import RANGE_SPACE_PENALTY
from adapt.solvers.projection.nearest_posture import NO_CHANNELS, channels, digest, with_effects
from adapt.solvers.projection.small_matrices import symmetric_solve
from models.effects import Effect
from models.girdle import COUNT_OF_NUMBERS, Girdle
from motions.arrays import Array

_N = COUNT_OF_NUMBERS

_PIVOT_FLOOR = 1e-6
"""Smallest pivot of K, relative to the largest weight, at a minimum; below this pivot, the step omits curvature."""

_CHUNK = 256


def persons_first(values: Float[np.ndarray, "*k problems"]) -> Float[np.ndarray, " problems *k"]:
    """Move the axis of persons to the front in contiguous memory, so that rounding in sums over a person's numbers does
    not depend on the other persons in the batch."""
    return np.ascontiguousarray(values.transpose(-1, *range(values.ndim - 1)))


class Postures(NamedTuple):
    """Inputs per posture: numbers x, strengths of effects, angles q, multipliers, measured angles s, weights W."""

    numbers_mm: Float[np.ndarray, "numbers rows"]
    strengths: Float[np.ndarray, "channels rows"]
    angles: Float[np.ndarray, "6 rows"]
    multipliers: Float[np.ndarray, "3 rows"]
    measured_angles: Float[np.ndarray, "6 rows"]
    weights: Float[np.ndarray, "6 rows"]


class Eliminated(NamedTuple):
    """Contribution of each row to the quadratic model in x, with the row's own step eliminated."""

    slope: Float[np.ndarray, "numbers rows"]
    matrix: Float[np.ndarray, "entries rows"]
    """Lower triangle of the Hessian, row by row."""
    x_slope: Float[np.ndarray, "numbers rows"]
    """T' lambda: gradient of E where the posture is at its optimum."""
    g_mm: Float[np.ndarray, "3 rows"]
    stiffness: Float[np.ndarray, "3 rows"]
    unstationary: Float[np.ndarray, " rows"]
    """max |W (q - s) + G' lambda|."""
    steps: Float[np.ndarray, "both rows"]
    """Steps of q (rad) and the new multipliers: with x fixed, then the change per mm of each number; row by row."""

    def at(self, dx_mm: Float[np.ndarray, "numbers rows"]) -> tuple[np.ndarray, np.ndarray]:
        """Compute dq (rad) and the new multipliers of every posture for a step ``dx_mm`` of the numbers."""
        still, *by_number = self.steps.reshape(9, 1 + _N, -1).swapaxes(0, 1)
        found = still.copy()
        for along, moved in zip(by_number, dx_mm, strict=True):  # a fixed order: rounding is the same in any batch
            found += along * moved
        return found[:6], found[6:]


def eliminate(effects: tuple[Effect, ...], at: Postures) -> Eliminated:
    """Eliminate the step of every posture from the quadratic model."""
    return Eliminated(*_elimination_kernel(effects)(*at))


def violations_mm(effects: tuple[Effect, ...], at: Postures) -> Float[np.ndarray, "3 rows"]:
    """Compute the violations of the constraints A1 to A3."""
    return _violation_kernel(effects)(at.numbers_mm, at.strengths, at.angles)[0]


def _inputs(effects: tuple[Effect, ...]) -> tuple[str, ...]:
    return str(_N), str(channels(effects)[-1] or NO_CHANNELS), "6", "3", "6", "6"


def _kernel(word: str, effects: tuple[Effect, ...], function, inputs: tuple[str, ...], outputs: tuple[str, ...]):
    shapes = [int(one) for one in inputs]
    name = f"own_{word}_{digest(effects, function, shapes, of_girdle=False)}"
    return Kernel(name, per_problem(function), inputs, outputs, _CHUNK)


@functools.cache
def _elimination_kernel(effects: tuple[Effect, ...]) -> Kernel:
    def function(numbers, strengths, q, multipliers, s, weights):
        at = _conditions(effects, numbers, strengths, q, multipliers, s, weights)
        rho, tau = at.g - at.G @ at.K_right, at.T - at.G @ at.K_C
        of_S = symmetric_solve(at.G @ at.K_G, jnp.concatenate([rho[:, None], tau], axis=1))[0]
        slope = tau.T @ of_S[:, 0] - at.T.T @ (at.stiffness * at.g) - at.C.T @ at.K_right
        M = at.U - at.C.T @ at.K_C + tau.T @ of_S[:, 1:] - (at.T.T * at.stiffness) @ at.T
        entries = jnp.concatenate([M[i, : i + 1] for i in range(_N)])
        rest = jnp.max(jnp.abs(at.right + at.G.T @ multipliers))
        dq = -jnp.concatenate([at.K_right[:, None], at.K_C], axis=1) - at.K_G @ of_S
        new = of_S - at.stiffness[:, None] * jnp.concatenate([at.g[:, None], at.T], axis=1)
        steps = jnp.concatenate([dq.ravel(), new.ravel()])
        return slope, entries, at.T.T @ multipliers, at.g, at.stiffness, rest, steps

    outputs = str(_N), str(_N * (_N + 1) // 2), str(_N), "3", "3", "", str(9 * (1 + _N))
    return _kernel("elimination", effects, function, _inputs(effects), outputs)


@functools.cache
def _violation_kernel(effects: tuple[Effect, ...]) -> Kernel:
    def function(numbers, strengths, q):
        return (with_effects(effects, Girdle.of_numbers(numbers), strengths).residuals_mm(q),)

    return _kernel("violation", effects, function, _inputs(effects)[:3], ("3",))


class _Conditions(NamedTuple):
    g: Array
    G: Array
    T: Array
    C: Array
    U: Array
    stiffness: Array
    right: Array
    """W (q - s)."""
    K_G: Array
    K_C: Array
    K_right: Array


def _conditions(effects, numbers, strengths, q, multipliers, s, weights) -> _Conditions:
    def g(at):
        return with_effects(effects, Girdle.of_numbers(at[6:]), strengths).residuals_mm(at[:6])

    at = jnp.concatenate([q, numbers])
    value, pull = jax.vjp(g, at)
    slopes = jax.vmap(lambda one: pull(one)[0])(jnp.eye(3))
    H = jax.hessian(lambda at: multipliers @ g(at))(at)
    G, T, C, U = slopes[:, :6], slopes[:, 6:], H[:6, 6:], H[6:, 6:]
    largest = jnp.max(weights)
    stiffness = RANGE_SPACE_PENALTY * largest / jnp.sum(G * G, axis=1)
    W, stiff, right = jnp.eye(6) * weights, (G.T * stiffness) @ G, weights * (q - s)
    sides = jnp.concatenate([G.T, C, right[:, None]], axis=1)
    solved, pivot = symmetric_solve(H[:6, :6] + W + stiff, sides)
    convex = pivot > _PIVOT_FLOOR * largest
    plain = sides / weights[:, None]
    solved, C, U, stiffness = (
        jnp.where(convex, one, other)
        for one, other in ((solved, plain), (C, 0.0 * C), (U, 0.0 * U), (stiffness, 0.0 * stiffness))
    )
    K_C = jnp.where(convex, solved[:, 3:-1], 0.0)
    return _Conditions(value, G, T, C, U, stiffness, right, solved[:, :3], K_C, solved[:, -1])
