"""Posture fits of the plain chain: many problems, from several starts, in rounds of more and more iterations.

All of it is done in the type of the measured angles, float64 or float32. A problem that has not converged at the end is
no failure: ``adapt.solvers.posture_fits`` goes on with it.
"""

from dataclasses import fields
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from adapt.engine.batching import in_rounds, refit, take_problems
from adapt.engine.kernel import Kernel
from adapt.solvers import status
from adapt.solvers.newton.posture import Lowest, iterate, iterate_from_two_starts
from adapt.solvers.solution import PostureSolution, put_lower
from adapt.solvers.unmeasured import angle_weights, around
from models.girdle import Girdle
from motions.arrays import ByType

Problem = tuple[Girdle, Float[np.ndarray, "6 problems"], Float[np.ndarray, "6 problems"]]
"""Girdle, measured angles (rad) and weights of each problem."""

Starts = tuple[Float[np.ndarray, "6 problems"], Float[np.ndarray, "6 problems"]]

OFFSETS_SEED = 0

OFFSETS_DEG = np.random.Generator(np.random.PCG64(OFFSETS_SEED)).uniform(-30.0, 30.0, (8, 6))
"""Where else to start from: offsets to the measured angles. Fixed, so that a fit is reproducible."""

_FAR_DEG2 = 15.0
"""From such a J on (4 deg rms) which local minimum a path ends in is chance: a fit starts from more places. Of 3000
simulated adaptations with noise of 4 deg 56 end with a lower E than with 200, with 0 one more. Measured postures leave
64 with R2 as it is. Beyond 200 local minima are many: 3 % of fits end in a higher one than the lowest of 40 other
places."""

_CLOSING_STEPS, _FAR_CLOSING_STEPS = 3.0, 6.0
"""Steps by which the chain is closed before a fit, at the measured angles and at places around. Medians of
what is left: 0.001 mm at simulated angles after three, 1e-12 mm 15 degrees off them after six."""

_LOWEST_ROUNDS = ByType((20.0, 60.0, 400.0), (20.0, 60.0))
"""Most iterations from each of two starts: of simulated postures 995 of 1000 need
one round, from places around 8 of 10. What float32 has not done by then it mostly cannot do."""

_ROUNDS = ByType((10, 10, 40, 400), (10, 10))
"""Most iterations from one start alone, in each round."""

_TRACKING_ROUNDS = (10, 40)
"""The same in each step along a motion."""


def fit_postures(
    girdle: Girdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None = None,
    far_deg2: float = _FAR_DEG2,
) -> PostureSolution:
    """Find the closed posture nearest to the measured angles (rad): from ``start`` alone, else the lowest of the optima
    reached from several places. An angle that was not measured begins at its number in ``angles``."""
    problem = _contiguous((girdle, angles, angle_weights(measured)))
    if start is None:
        return _from_places(problem, measured, far_deg2)
    rounds = _ROUNDS.for_dtype_of(angles)
    return in_rounds(postures_kernel, rounds, problem, _BEGINNING, start, np.zeros_like(start[:3]))


def _from_places(problem: Problem, measured: Bool[np.ndarray, "6 problems"], far_deg2: float) -> PostureSolution:
    """The lowest of the optima reached from the measured angles, from where the chain closes next to them and, where
    needed, from where it closes next to two places around.

    They are needed where the first two starts do not lead to one optimum, or to one with a J from ``far_deg2`` on;
    where what they find is as far, six more places are tried. In
    float32 a problem has converged only if every start has led to an optimum: one not found there may be the lowest.
    """
    target = problem[1]
    # one step from the measured angles: closing is what a fit begins with there
    found, settled, apart = _from_two_starts(problem, (target, target), (_CLOSING_STEPS, 1.0))
    begins_at_rest = ~measured.all(axis=0)
    needed = ~settled | apart | ~found.converged | (found.j_deg2 >= far_deg2) | begins_at_rest
    for offsets in OFFSETS_DEG.reshape(-1, 2, 6):
        again = np.flatnonzero(needed)
        if not len(again):
            break
        part = take_problems(problem, again)
        one, other = (around(part[1], offset, measured[:, again]) for offset in offsets)
        further, both, _ = _from_two_starts(part, (one, other), (_FAR_CLOSING_STEPS, _FAR_CLOSING_STEPS))
        put_lower(found, again, further)
        settled[again] &= both
        needed &= begins_at_rest | (found.j_deg2 >= far_deg2)  # the first two places do for all others
    if target.dtype == np.float32:
        found.code[~settled] = status.UNCONVERGED
    return found


def _from_two_starts(problem: Problem, starts: Starts, closing_steps: tuple[float, float]) -> Lowest:
    """The lower optimum; a problem where a start has not led to one begins anew, with more iterations."""

    def found(problem: Problem, starts: Starts, iterations: float) -> Lowest:
        one, other, most = (np.full(starts[0].shape[1], x) for x in (*closing_steps, iterations))
        return lowest_kernel(*problem, starts, (one, other), most)

    first, *others = _LOWEST_ROUNDS.for_dtype_of(problem[1])
    result = found(problem, starts, first)
    for iterations in others:
        refit(result, ~result[1], partial(found, iterations=iterations), problem, starts)
    return result


def track_postures(steps: int, girdle: Girdle, angles, measured, angles_before, start) -> PostureSolution:
    """Follow the optimum from ``start`` while the measured angles go straight to the next posture (continuation)."""
    girdle, target, weights = _contiguous((girdle, angles, angle_weights(measured)))
    here: Any = start, np.zeros_like(start[:3])
    arrived = np.ones(start.shape[1], bool)
    for number in range(1, steps + 1):
        on_the_way = angles_before + number / steps * (target - angles_before)
        here = in_rounds(postures_kernel, _TRACKING_ROUNDS, (girdle, on_the_way, weights), _BEGINNING, *here[:2])
        arrived &= here.converged
    here.code[~arrived] = status.UNCONVERGED
    return here


_BEGINNING = ("angles", "multipliers")
"""What a round begins with."""


def _contiguous(problem: Problem) -> Problem:
    """And of the type of the measured angles; once, instead of in each call of a kernel."""
    return jax.tree.map(lambda x: np.ascontiguousarray(x, problem[1].dtype), problem)


def _numbers_of_girdle() -> Girdle:
    scalars = {"ts_distance_mm", "ai_distance_mm", "conoid_length_mm"}
    return Girdle(**{one.name: "" if one.name in scalars else "3" for one in fields(Girdle)})  # type: ignore[arg-type]


GIRDLE: Any = _numbers_of_girdle()
"""Shapes of a girdle's numbers, for ``adapt.engine.kernel``."""

_SOLUTION: Any = PostureSolution(*("6", "3", "3", "", "", "int", "int", "bool"))  # type: ignore[arg-type]

_LANES = 4096
"""Postures in a chunk of a program of JAX."""

postures_kernel = Kernel("postures", iterate, (GIRDLE, "6", "6", ("6", "3", "bool"), ""), _SOLUTION, _LANES)

lowest_kernel = Kernel(
    "lowest",
    iterate_from_two_starts,
    (GIRDLE, "6", "6", ("6", "6"), ("", ""), ""),
    (_SOLUTION, "bool", "bool"),
    _LANES,
)
