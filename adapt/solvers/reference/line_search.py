"""The step length of a constrained Newton step: the longest one that lowers the merit function enough.

The merit is the exact l1 penalty, objective + sum of penalty |g|. All lengths are tried at once, since evaluating
constraints is cheap next to differentiating them. The first trial is the full step brought back to the surface: near
a curved constraint the merit refuses good full steps without it (Maratos effect; Nocedal & Wright, Numerical
Optimization, 2006, section 18.3).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.reference.linalg import largest
from motions.arrays import Array, is_jax, xp

LENGTHS = (1.0, 0.5, 0.25, 0.1, 0.03, 0.005)
"""Plain step lengths, tried after the corrected full step."""

_SUFFICIENT = 1e-4
"""Share of the predicted decrease a step must reach (Armijo)."""

_ROUNDING = 1e-13
"""Relative error of a merit value: a rise below it is no rise."""

TINY_RAD = 1e-7
"""A step this short is the tail of a quadratic convergence, below what the merit resolves: it is taken whole."""


def longest(
    attempt: Callable[[Float[np.ndarray, " trials"]], tuple[Any, Float[Array, " trials *batch"]]],
    merit_before: Float[Array, " *batch"],
    predicted: Float[Array, " *batch"],
    tiny: Bool[Array, " *batch"],
) -> tuple[Any, Int[Array, " *batch"]]:
    """Try the step lengths: what ``attempt`` makes of them, and which one each element of the batch takes (``choose``).

    ``attempt`` gives candidates and merits. At once, the shorter lengths are tried only if one needs them.
    """
    if not is_jax(merit_before):
        candidates, merits = attempt(np.array(LENGTHS[:1]))
        if np.all(tiny | _good(merit_before, predicted, merits)):
            return candidates, np.zeros(merit_before.shape, int)
    candidates, merits = attempt(np.array(LENGTHS))
    return candidates, choose(merit_before, predicted, merits, tiny)


def _good(merit_before, predicted, merits):
    lengths = np.array(LENGTHS[: len(merits)]).reshape(-1, *[1] * merit_before.ndim)
    allowed = merit_before + _SUFFICIENT * lengths * xp.minimum(predicted, 0.0)[None]
    return merits <= allowed + _ROUNDING * (1.0 + abs(merit_before))[None]


def choose(
    merit_before: Float[Array, " *batch"],
    predicted: Float[Array, " *batch"],
    merits: Float[Array, " trials *batch"],
    tiny: Bool[Array, " *batch"],
) -> Float[Array, " *batch"]:
    """Choose the index of the first trial with sufficient decrease, else of the lowest merit; 0 for a tiny step."""
    good = _good(merit_before, predicted, merits)
    lowest = xp.argmin(xp.where(xp.isnan(merits), xp.inf, merits), axis=0)
    return xp.where(tiny, 0, xp.where(xp.any(good, axis=0), xp.argmax(good, axis=0), lowest))


def pick(candidates: Float[Array, " trials n *batch"], index: Float[Array, " *batch"]) -> Float[Array, " n *batch"]:
    """Pick the trial of this index for each element of the batch."""
    return xp.take_along_axis(candidates, index[None, None], axis=0)[0]


def grown_penalty(penalty: Float[Array, " *batch"], multipliers: Float[Array, " 3 *batch"]) -> Float[Array, " *batch"]:
    """Raise the penalty above the multipliers, as exactness of the l1 merit needs; it forgets old ones by halves."""
    needed = 1.5 * largest(multipliers)
    return xp.maximum(needed, 0.5 * (penalty + needed))
