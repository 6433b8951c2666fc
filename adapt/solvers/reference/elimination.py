"""One Newton step of a posture's optimality conditions, with the girdle's parameters left free: the shared engine.

A posture's angles q (6) minimise 1/2 (q - s)' W (q - s) subject to g(q, theta) = 0 (3). Its optimality conditions,
linearised at (q, theta) with multipliers lambda, are nine equations,

    H dq + C dtheta + G' lambda = -W (q - s)        H = W + d2(lambda'g)/dq2,  C = d2(lambda'g)/dq dtheta
    G dq + T dtheta             = -g                G = dg/dq,                 T = dg/dtheta

which :func:`eliminate` solves for dq and lambda as affine functions of dtheta, leaving each posture's share of a
small system in theta (Schur complement). With no theta it is the Newton step of a single posture fit.
"""

from typing import NamedTuple

from jaxtyping import Float

from adapt.solvers.reference.linalg import (
    Factor,
    diagonal,
    largest,
    matmul,
    matvec,
    trace,
    transpose,
)
from motions.arrays import Array, xp

STEP_LIMIT_RAD = 0.6
"""Longest step of one angle: a rotation linearised further than this means nothing."""

_CURVATURE_SHARES = (1.0, 0.3, 0.0)
"""Shares of the constraint curvature tried until H is positive definite on the tangent space; 0 is Gauss-Newton."""

_RANGE_SPACE_PENALTY = 100.0
"""Weight of the range space of G' in H, relative to the largest entry of H: see :func:`_convexified`."""

_PIVOT_FLOOR = 1e-7
"""Smallest pivot, relative to W, that counts as positive definite. Where an angle was not measured and turns the conoid
hardly longer, it is 1e-5, and without the curvature the steps go nowhere."""

_RANK_SHIFT = 1e-15
"""Relative shift of G G': where G loses rank the step is long but finite, elsewhere it is below rounding."""

UNMEASURED_WEIGHT = 1e-8
"""Relative damping of an angle that was not measured: it settles where the constraints put it."""


class Linearised(NamedTuple):
    """Constraints and second-order terms of one posture at z = (q, theta)."""

    residual: Float[Array, " 3 *batch"]
    G: Float[Array, " 3 6 *batch"]
    T: Float[Array, " 3 m *batch"]
    curvature: Float[Array, " n n *batch"]
    """d2(lambda'g)/dz2."""


class Eliminated(NamedTuple):
    """dq = step + step_theta dtheta, lambda = multipliers + multipliers_theta dtheta, and the share of theta."""

    step: Float[Array, " 6 *batch"]
    step_theta: Float[Array, " 6 m *batch"]
    multipliers: Float[Array, " 3 *batch"]
    multipliers_theta: Float[Array, " 3 m *batch"]
    slope: Float[Array, " m *batch"]
    """What this posture adds to the right-hand side of the system in theta."""
    hessian: Float[Array, " m m *batch"]
    """What this posture adds to its matrix."""


def eliminate(at: Linearised, slope: Float[Array, " 6 *batch"], weights: Float[Array, " 6 *batch"]) -> Eliminated:
    """Solve the nine equations of a posture for dq and lambda, affine in dtheta.

    ``slope`` is W (q - s); the solution is linear in it and in ``at.residual``.
    """
    Gt = transpose(at.G)
    lift = _range_space(at.G)
    curvature = at.curvature[:6, :6]
    range_space_penalty = _RANGE_SPACE_PENALTY * (xp.max(weights, axis=0) + xp.max(abs(curvature), axis=(0, 1)))
    factor, fraction = _convexified(curvature, weights, range_space_penalty * matmul(Gt, lift.solve(at.G)))
    HG = factor.solve(Gt)
    S = matmul(at.G, HG)
    shift = _RANK_SHIFT * trace(S)
    schur = Factor(S + diagonal(xp.broadcast_to(shift, S.shape[1:])), floor=shift)

    # Right-hand sides: the constant one, then one for each theta. Apart from the matrices above, so that the solution
    # stays visibly linear in them and can be transposed.
    coupling = fraction * at.curvature[:6, 6:]
    violation = xp.concatenate([at.residual[:, None], at.T], axis=1)
    gradient = xp.concatenate([slope[:, None], coupling], axis=1)
    affine = factor.solve(gradient + range_space_penalty * matmul(Gt, lift.solve(violation)))
    multipliers = schur.solve(violation - matmul(at.G, affine))
    steps = -affine - matmul(HG, multipliers)

    slope_and_hessian = matmul(transpose(coupling), steps) + matmul(transpose(at.T), multipliers)
    return Eliminated(
        step=steps[:, 0],
        step_theta=steps[:, 1:],
        multipliers=multipliers[:, 0],
        multipliers_theta=multipliers[:, 1:],
        slope=slope_and_hessian[:, 0],
        hessian=slope_and_hessian[:, 1:] + fraction * at.curvature[6:, 6:],
    )


def _range_space(G: Float[Array, " 3 6 *batch"]) -> Factor:
    """The factor of G G', shifted off singularity."""
    GGt = matmul(G, transpose(G))
    shift = _RANK_SHIFT * trace(GGt)
    return Factor(GGt + diagonal(xp.broadcast_to(shift, GGt.shape[1:])), floor=shift)


def _convexified(
    curvature: Float[Array, " 6 6 *batch"],
    weights: Float[Array, " 6 *batch"],
    range_space: Float[Array, " 6 6 *batch"],
) -> tuple[Factor, Float[Array, " *batch"]]:
    """Factor of H + k G'(GG')^-1 G and the share of the curvature that H keeps.

    Adding k G'(GG')^-1 (G dq + T dtheta + g) = 0 to the first equation changes nothing, and makes the matrix positive
    definite exactly where H is so on the tangent space, the condition of a minimum. Away from one the curvature is
    reduced until it is; without curvature (Gauss-Newton) it always is.
    """
    scale = xp.max(weights, axis=0)
    convex = diagonal(xp.maximum(weights, UNMEASURED_WEIGHT * scale)) + range_space
    fraction = xp.full_like(scale, _CURVATURE_SHARES[0])
    factor = Factor(convex + curvature, _PIVOT_FLOOR * scale)
    for smaller in _CURVATURE_SHARES[1:]:
        fraction = xp.where(factor.positive, fraction, smaller)
        factor = factor.otherwise(Factor(convex + smaller * curvature, UNMEASURED_WEIGHT * scale))
    return factor, fraction


def back_to_surface(G: Float[Array, " 3 6 *batch"], residual: Float[Array, " 3 *batch"]) -> Float[Array, " 6 *batch"]:
    """Find the shortest step -G'(GG')^-1 g that closes the linearised chain."""
    return -matvec(transpose(G), _range_space(G).solve_vector(residual))


def limited(step: Float[Array, " 6 *batch"]) -> Float[Array, " 6 *batch"]:
    """Shorten the step so that no angle moves by more than ``STEP_LIMIT_RAD``."""
    longest = largest(step)
    return step * xp.minimum(1.0, STEP_LIMIT_RAD / xp.maximum(longest, STEP_LIMIT_RAD))
