"""Secant estimate of the part of the Hessian of E that Gauss-Newton leaves out, from changes of the gradient.

E'' = M + S with the Gauss-Newton matrix M. Dennis, Gay and Welsch (NL2SOL, ACM Trans Math Softw 7:348, 1981): S is
scaled down where it was too large along the last step s, then gets the smallest change that makes (M + S) s the change
of the gradient.
"""

import numpy as np
from jaxtyping import Float

_LEAST = 1e-300
"""Smallest denominator, where S and its target along the step are both 0."""


def secant(
    S: Float[np.ndarray, "n n problems"],
    M: Float[np.ndarray, "n n problems"],
    step: Float[np.ndarray, "n problems"],
    change: Float[np.ndarray, "n problems"],
) -> Float[np.ndarray, "n n problems"]:
    """Update S of every problem; M is the matrix at the end of the step. Where the gradient has fallen along the step,
    S is only scaled down."""
    wanted = change - _times(M, step)
    there, wanted_there = (np.abs((step * one).sum(axis=0)) for one in (_times(S, step), wanted))
    S = S * (wanted_there / np.maximum(np.maximum(there, wanted_there), _LEAST))
    missing = wanted - _times(S, step)
    risen = (change * step).sum(axis=0)
    v = change / np.where(risen > 0.0, risen, np.inf)
    both = missing[:, None] * v[None]
    return S + both + np.swapaxes(both, 0, 1) - (missing * step).sum(axis=0) * v[:, None] * v[None]


def _times(matrix: Float[np.ndarray, "m n problems"], vector: Float[np.ndarray, "n problems"]) -> np.ndarray:
    """Multiply the matrix of every problem by its vector."""
    return (matrix * vector[None]).sum(axis=1)
