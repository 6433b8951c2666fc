"""The posture fit as a differentiable function, and the nested objective of the adaptation built on it.

At the optimum W (q - s) + G' lambda = 0 and g = 0 define q and lambda as functions of everything else (implicit
function theorem). Their derivative is one 9 x 9 solve with the matrix of the last Newton step; no derivative goes
through the iterations. Forward, reverse and higher derivatives, ``jit`` and ``vmap`` compose in any order.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from adapt.engine.batching import QUICK_TO_COMPILE as QUICK_TO_COMPILE  # for gradients that run a few times
from adapt.solvers.objective import thorax_distance_mm2
from adapt.solvers.reference.constraints import ByHand, Differentiated
from adapt.solvers.reference.elimination import eliminate
from adapt.solvers.reference.posture import (
    Postures,
    close_chain,
    lower_of_two_starts,
    mean_square_deg2,
    objective_weights,
    solve_postures,
)
from models.girdle import Girdle
from motions.errors import InputError


class PostureFit(NamedTuple):
    """The closest closed posture as a function of girdle and measured angles; NaN where the fit failed."""

    angles: Float[Array, " 6 *batch"]
    """rad."""
    multipliers: Float[Array, " 3 *batch"]
    """deg^2 a mm."""
    j_deg2: Float[Array, " *batch"]


def posture_fit(
    girdle: Girdle,
    angles: Float[Array, " 6 *batch"],
    measured: Bool[Array, " 6 *batch"] | None = None,
    start: Float[Array, " 6 *batch"] | None = None,
) -> PostureFit:
    """Fit postures: q, lambda and J_p (Eq. 6.1-6.2), differentiable in the girdle and the measured angles.

    ``angles`` in rad, finite; ``measured`` False leaves an angle out of J_p. ``girdle`` has the same batch axes, or
    none. A posture that does not converge is NaN.

    J_p has several local minima. Without ``start`` the lower one is taken of those reached from the measured angles and
    from where the chain closes next to them; :func:`adapt.fit_postures` tries more places where that one is far, and
    finds a lower one in some postures (5 of 420 of the shipped subjects with three sets). Give its angles (rad) as
    ``start`` to be where it is. InputError if the first axis of ``angles`` has not the six of them.
    """
    if jnp.shape(angles)[:1] != (6,):
        remedy = "Give (6, postures) in rad: np.deg2rad(motions.angles_deg).T"
        raise InputError("angles", None, f"their shape is {jnp.shape(angles)}", remedy)
    if measured is None:
        measured = jnp.ones(angles.shape, bool)
    girdle, angles, measured = jax.tree.map(jnp.asarray, (girdle, angles, measured))
    weights = objective_weights(measured)
    girdle = _with_batch(girdle, angles.shape[1:])
    q, multipliers = _optimum(girdle, angles, weights, None if start is None else jnp.asarray(start))
    return PostureFit(q, multipliers, mean_square_deg2(q, angles, weights))


def _with_batch(girdle: Girdle, batch: tuple[int, ...]) -> Girdle:
    """One girdle for each element of the batch; a batched one stays as it is."""
    if girdle.conoid_length_mm.ndim == len(batch):
        return girdle

    def spread(x):
        return jnp.broadcast_to(x.reshape(*x.shape, *[1] * len(batch)), (*x.shape, *batch))

    return jax.tree.map(spread, girdle)


@jax.custom_jvp
def _optimum(girdle: Girdle, measured: Array, weights: Array, start: Array | None) -> tuple[Array, Array]:
    if start is None:
        solved = _from_two_starts(girdle, measured, weights)
    else:
        solved = solve_postures(ByHand(girdle), measured, weights, start)
    good = solved.converged[None]
    return jnp.where(good, solved.angles, jnp.nan), jnp.where(good, solved.multipliers, jnp.nan)


def _from_two_starts(girdle: Girdle, measured: Array, weights: Array) -> Postures:
    chain = ByHand(girdle.over_axes(1))  # with an axis for the two starts

    def close(angles):
        return close_chain(chain, jnp.stack([angles, angles], axis=-1))[..., 1]

    return lower_of_two_starts(partial(solve_postures, chain), close, measured, weights)


@_optimum.defjvp
def _optimum_jvp(primals, tangents):
    q, multipliers = _optimum(*primals)

    def conditions(girdle, measured, weights):
        constraints = Differentiated(girdle.residuals_mm)
        return weights * (q - measured) + constraints.multiplier_gradient(q, multipliers), constraints.residual(q)

    _, (slope, moved_violation) = jax.jvp(conditions, primals[:3], tangents[:3])  # the start moves nothing
    girdle, _, weights, _ = primals
    at = Differentiated(girdle.residuals_mm).linearised(q, multipliers)
    moved = eliminate(at._replace(residual=moved_violation), slope, weights)
    return (q, multipliers), (moved.step, moved.multipliers)


def nested_objective(
    theta_mm: Float[Array, " 6"],
    girdle: Girdle,
    points_mm: Float[Array, " 3 points"],
    angles: Float[Array, " 6 postures"],
    measured: Bool[Array, " 6 postures"],
    weight: float,
    start: Float[Array, " 6 postures"] | None = None,
) -> Float[Array, ""]:
    """Compute E(theta) = D + w mean(J_p) [mm^2 + w deg^2] of one subject, as defined: with every posture fitted anew.

    The whole-subject solver is tested against it, and a general optimiser can minimise it. ``start``: as in
    :func:`posture_fit`.
    """
    adapted = girdle.with_adapted(theta_mm)
    point_weights = jnp.full(points_mm.shape[1], 1.0 / points_mm.shape[1])
    fits = posture_fit(adapted, angles, measured, start)
    return thorax_distance_mm2(adapted, points_mm, point_weights) + weight * jnp.mean(fits.j_deg2)
