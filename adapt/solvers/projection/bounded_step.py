"""Exact minimum, within bounds, of the quadratic model of many adaptations that share amplitudes.

Problem i has its own adapted parameters theta_i; the problems of a group share the amplitudes a. In the model

    sum_i (1/2 d_i' H_i d_i + g_i' d_i) + 1/2 (a - a_now)' P (a - a_now) + p' (a - a_now),   d_i = (dtheta_i, da),

theta_i is eliminated from each problem (6 x 6), then each group is solved for da. A primal-dual active set handles the
bounds.
"""

import numpy as np
from jaxtyping import Float, Int

from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_MOST_CHANGES = 40
"""Largest number of changes of the active set; each costs another elimination. A step that reaches this limit is cut at
the bounds."""

_ALL_AT_ONCE = 8
"""Number of changes of the active set in which each problem exchanges all parameters that are wrong. Later changes
exchange one parameter per problem; otherwise half of the steps from ten simulated subjects would cycle."""

_AT_BOUND_MM = 1e-9

_Model = tuple[Float[np.ndarray, "problems n"], Float[np.ndarray, "problems n n"], Int[np.ndarray, " problems"]]
"""Gradient and matrix in theta and the amplitudes, problems first as LAPACK has them; the group of each problem."""


def lowest(
    gradient: Float[np.ndarray, "n problems"],
    matrix: Float[np.ndarray, "n n problems"],
    group: Int[np.ndarray, " problems"],
    prior_gradient: Float[np.ndarray, "amplitudes groups"],
    prior_matrix: Float[np.ndarray, "amplitudes amplitudes #groups"],
    room: tuple[Float[np.ndarray, "adapted problems"], Float[np.ndarray, "adapted problems"]],
) -> tuple[Float[np.ndarray, "adapted problems"], Float[np.ndarray, "amplitudes groups"]]:
    """Find the minimum, dtheta and da.

    ``group``: group of each problem, in ascending order. ``room``: distances of each parameter to its lower bound
    (negative) and to its upper bound.
    """
    model, p, (low, high) = (gradient.T, np.moveaxis(matrix, -1, 0), group), prior_gradient.T, (one.T for one in room)
    at_low = low >= -_AT_BOUND_MM
    fixed, value = at_low | (high <= _AT_BOUND_MM), np.where(at_low, low, high)
    P = np.broadcast_to(np.moveaxis(prior_matrix, -1, 0), (len(p), *prior_matrix.shape[:2]))
    dtheta, da = np.zeros(low.shape), np.zeros(p.shape)
    problems, some = np.arange(len(low)), np.arange(len(p))  # problems and groups that have not ended
    for number in range(_MOST_CHANGES):
        of_problems: _Model = model[0][problems], model[1][problems], group[problems]
        dtheta[problems], da[some], towards = _lowest_given(
            of_problems, p[some], P[some], fixed[problems], value[problems]
        )
        # active where value less multiplier over curvature is beyond the bound (Hintermueller, Ito and Kunisch 2003)
        below, above = towards < low[problems] - _AT_BOUND_MM, towards > high[problems] + _AT_BOUND_MM
        different = (below | above) != fixed[problems]
        changed = different.any(axis=1)
        if number >= _ALL_AT_ONCE:
            different &= np.cumsum(different, axis=1) == 1
        fixed[problems] ^= different
        value[problems] = np.where(below, low[problems], np.where(above, high[problems], value[problems]))
        left = np.zeros(len(p), bool)
        left[group[problems[changed]]] = True
        if not left.any():
            break
        problems, some = problems[left[group[problems]]], np.flatnonzero(left)
    return np.clip(dtheta, low, high).T, da.T


def _lowest_given(model: _Model, prior_gradient, prior_matrix, fixed, value) -> tuple[np.ndarray, ...]:
    """Find the minimum, dtheta and da, with some parameters fixed at a value. The third result, dtheta less multiplier
    over curvature, is beyond a bound where the bound is active."""
    gradient, matrix, group = model
    own, cross, shared = matrix[:, :_N, :_N], matrix[:, :_N, _N:], matrix[:, _N:, _N:]
    free, held = ~fixed, np.where(fixed, value, 0.0)
    inner = np.where(free[:, :, None] & free[:, None, :], own, 0.0) + fixed[:, :, None] * np.eye(_N)
    right = np.where(fixed, value, -(gradient[:, :_N] + _times(own, held)))
    solved = np.linalg.solve(inner, np.concatenate([right[..., None], np.where(free[:, :, None], cross, 0.0)], 2))
    start, slope = solved[..., 0], solved[..., 1:]
    across = np.swapaxes(cross, 1, 2)
    g = gradient[:, _N:] + _times(across, start)
    H = shared - across @ slope
    begins = np.diff(group, prepend=-1) > 0
    first = np.flatnonzero(begins)
    G, M = prior_gradient + np.add.reduceat(g, first, axis=0), prior_matrix + np.add.reduceat(H, first, axis=0)
    da = -np.linalg.solve(M, G[..., None])[..., 0] if G.shape[1] else G
    of_part = da[np.cumsum(begins) - 1]
    dtheta = start - _times(slope, of_part)
    slack = gradient[:, :_N] + _times(own, dtheta) + _times(cross, of_part)
    return dtheta, da, dtheta - slack / np.einsum("pii->pi", own)


def _times(matrix: Float[np.ndarray, "problems m n"], vector: Float[np.ndarray, "problems n"]) -> np.ndarray:
    """Multiply the matrix of every problem by its vector: (problems, m)."""
    return (matrix @ vector[..., None])[..., 0]
