"""What Gauss-Newton leaves out of the curvature of E, learnt from how the gradient changes along the steps.

E'' = M + S with M of Gauss-Newton. Dennis, Gay and Welsch (NL2SOL, ACM Trans Math Softw 7:348, 1981): S is made smaller
where it was too large along the last step s, then changed as little as makes (M + S) s the change of the gradient.
"""

import numpy as np
from jaxtyping import Float

from adapt.solvers.extended.arrow_step import times

_LEAST = 1e-300
"""In place of 0 where nothing is there and nothing wanted."""


def secant(
    S: Float[np.ndarray, "parts n n"],
    M: Float[np.ndarray, "parts n n"],
    step: Float[np.ndarray, "parts n"],
    change: Float[np.ndarray, "parts n"],
) -> Float[np.ndarray, "parts n n"]:
    """Update S of every part; M is that at the end of the step. Where the gradient has fallen along it, S is only made
    smaller."""
    wanted = change - times(M, step)
    there, wanted_there = (np.abs(_dot(step, one)) for one in (times(S, step), wanted))
    S = S * (wanted_there / np.maximum(np.maximum(there, wanted_there), _LEAST))[:, None, None]
    missing = wanted - times(S, step)
    risen = _dot(change, step)
    v = change / np.where(risen > 0.0, risen, np.inf)[:, None]
    both = missing[:, :, None] * v[:, None, :]
    return S + both + np.swapaxes(both, 1, 2) - _dot(missing, step)[:, None, None] * v[:, :, None] * v[:, None, :]


def _dot(a: Float[np.ndarray, "parts n"], b: Float[np.ndarray, "parts n"]) -> Float[np.ndarray, " parts"]:
    return (a * b).sum(axis=1)
