"""The quadratic model of many adaptations that share amplitudes, solved exactly with its bounds.

Part i has adapted parameters theta_i of its own; the parts of a group share the amplitudes a. Of

    sum_i v_i (1/2 d_i' H_i d_i + g_i' d_i) + 1/2 (a - a_now)' P (a - a_now) + p' (a - a_now),   d_i = (dtheta_i, da),

theta_i is eliminated in each part (6 x 6), then each group solves for da. Bounds by the primal-dual active set.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_MOST_CHANGES = 30
"""Of the active set; each costs another elimination. Measured motions take 1 to 8. A step that runs into this is cut at
the bounds."""

_AT_BOUND_MM = 1e-9


class Step(NamedTuple):
    """Where the quadratic model is lowest."""

    theta: Float[np.ndarray, "parts adapted"]
    amplitude: Float[np.ndarray, "groups amplitudes"]


class Quadratic(NamedTuple):
    """Of every part: gradient and matrix in theta and the amplitudes; v; the group, in ascending order."""

    gradient: Float[np.ndarray, "parts n"]
    matrix: Float[np.ndarray, "parts n n"]
    importance: Float[np.ndarray, " parts"]
    group: Int[np.ndarray, " parts"]


def lowest(
    model: Quadratic,
    groups: int,
    prior_gradient: Float[np.ndarray, "groups amplitudes"],
    prior_matrix: Float[np.ndarray, "#groups amplitudes amplitudes"],
    room: tuple[Float[np.ndarray, "parts adapted"], Float[np.ndarray, "parts adapted"]],
) -> Step:
    """Find the lowest point; ``room``: how far each parameter may go down (negative) and up."""
    low, high = room
    gradient, matrix, importance, group = model
    k = gradient.shape[1] - _N
    own, cross, shared = matrix[:, :_N, :_N], matrix[:, :_N, _N:], matrix[:, _N:, _N:]
    at_low = low >= -_AT_BOUND_MM
    fixed, value = at_low | (high <= _AT_BOUND_MM), np.where(at_low, low, high)
    eye, starts = np.eye(_N), np.searchsorted(group, np.arange(groups))
    dtheta, da = np.zeros(low.shape), np.zeros((groups, k))
    for _ in range(_MOST_CHANGES):
        free = ~fixed
        held = np.where(fixed, value, 0.0)
        inner = np.where(free[:, :, None] & free[:, None, :], own, 0.0) + fixed[:, :, None] * eye
        right = np.where(fixed, value, -(gradient[:, :_N] + np.einsum("pij,pj->pi", own, held)))
        solved = np.linalg.solve(inner, np.concatenate([right[..., None], np.where(free[:, :, None], cross, 0.0)], 2))
        start, slope = solved[..., 0], solved[..., 1:]
        g = importance[:, None] * (gradient[:, _N:] + np.einsum("pij,pi->pj", cross, start))
        H = importance[:, None, None] * (shared - np.einsum("pij,pik->pjk", cross, slope))
        G = prior_gradient + np.add.reduceat(g, starts, axis=0)
        M = prior_matrix + np.add.reduceat(H, starts, axis=0)
        da = -np.linalg.solve(M, G[..., None])[..., 0] if k else np.zeros((groups, 0))
        dtheta = start - np.einsum("pij,pj->pi", slope, da[group])
        slack = gradient[:, :_N] + np.einsum("pij,pj->pi", own, dtheta) + np.einsum("pij,pj->pi", cross, da[group])
        # where the multiplier and the way beyond the bound agree on it (Hintermueller, Ito and Kunisch 2003)
        towards = dtheta - slack / np.einsum("pii->pi", own)
        below, above = towards < low - _AT_BOUND_MM, towards > high + _AT_BOUND_MM
        if np.array_equal(below | above, fixed):
            break
        fixed, value = below | above, np.where(below, low, high)
    return Step(np.clip(dtheta, low, high), da)
