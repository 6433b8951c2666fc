"""Posture fits of the chain without effects: many problems, from several starts, in rounds of more and more iterations.

All computations are in the type of the measured angles, float64 or float32. A problem that has not converged at the end
is no failure: ``adapt.solvers.posture_fits`` continues with it.
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
"""Further starting points, as offsets to the measured angles. Fixed, so that a fit is reproducible."""

_FAR_DEG2 = 15.0
"""J (4 deg root mean square) from which a fit starts from more places, because chance decides in which local minimum a
path ends. In 3000 simulated adaptations with noise of 4 deg, 56 end with a lower E than at a threshold of 200; at 0 one
more does. Measured postures have a J of 64 with unadapted R2. Beyond 200 there are many local minima: 3 % of fits end
in a higher one than the lowest of 40 other places."""

_CLOSING_STEPS, _FAR_CLOSING_STEPS = 3.0, 6.0
"""Numbers of steps that close the chain before a fit, at the measured angles and at places around them. Median
constraint violation afterwards: 0.001 mm at simulated angles after three, 1e-12 mm 15 degrees off them after six."""

_LOWEST_ROUNDS = ByType((20.0, 60.0, 400.0), (20.0, 60.0))
"""Largest numbers of iterations from each of two starts, per round: 995 of 1000 simulated postures need one round, from
places around them 8 of 10. Problems that float32 has not solved by then are mostly beyond it."""

_ROUNDS = ByType((10, 10, 40, 400), (10, 10))
"""Largest numbers of iterations from a single start, per round."""

_TRACKING_ROUNDS = (10, 40)
"""Largest numbers of iterations of each step along a motion, per round."""


def fit_postures(
    girdle: Girdle,
    angles: Float[np.ndarray, "6 problems"],
    measured: Bool[np.ndarray, "6 problems"],
    start: Float[np.ndarray, "6 problems"] | None = None,
    far_deg2: float = _FAR_DEG2,
) -> PostureSolution:
    """Find the closed posture nearest to the measured angles (rad): from ``start`` alone, or else the lowest of the
    optima reached from several places. An unmeasured angle begins at its value in ``angles``."""
    problem = _contiguous((girdle, angles, angle_weights(measured)))
    if start is None:
        return _from_places(problem, measured, far_deg2)
    rounds = _ROUNDS.for_dtype_of(angles)
    return in_rounds(postures_kernel, rounds, problem, _BEGINNING, start, np.zeros_like(start[:3]))


def _from_places(problem: Problem, measured: Bool[np.ndarray, "6 problems"], far_deg2: float) -> PostureSolution:
    """Return the lowest of the optima reached from the measured angles, from the closed posture near them and, where
    needed, from the closed postures near two places around.

    The two places are needed where the first two starts do not lead to one optimum, or lead to one with a J of at least
    ``far_deg2``, or an angle was not measured. Where J is still as large, or an angle was not measured, six more places
    are tried. In float32 a problem has converged only if every start has led to an optimum: one that was not found may
    be the lowest.
    """
    target = problem[1]
    # one closing step at the measured angles: a fit from there begins by closing the chain anyway
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
        needed &= begins_at_rest | (found.j_deg2 >= far_deg2)  # the first two places are enough for all others
    if target.dtype == np.float32:
        found.code[~settled] = status.UNCONVERGED
    return found


def _from_two_starts(problem: Problem, starts: Starts, closing_steps: tuple[float, float]) -> Lowest:
    """Return the lower optimum; a problem where a start has not led to an optimum begins anew, with more iterations."""

    def found(problem: Problem, starts: Starts, iterations: float) -> Lowest:
        one, other, most = (np.full(starts[0].shape[1], x) for x in (*closing_steps, iterations))
        return lowest_kernel(*problem, starts, (one, other), most)

    first, *others = _LOWEST_ROUNDS.for_dtype_of(problem[1])
    result = found(problem, starts, first)
    for iterations in others:
        refit(result, ~result[1], partial(found, iterations=iterations), problem, starts)
    return result


def track_postures(steps: int, girdle: Girdle, angles, measured, angles_before, start) -> PostureSolution:
    """Follow the optimum from ``start`` while the measured angles move in a straight line to the next posture
    (continuation)."""
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
"""Fields of a result with which the next round begins."""


def _contiguous(problem: Problem) -> Problem:
    """Make arrays contiguous and of the type of the measured angles; once, instead of in each call of a kernel."""
    return jax.tree.map(lambda x: np.ascontiguousarray(x, problem[1].dtype), problem)


def _numbers_of_girdle() -> Girdle:
    scalars = {"ts_distance_mm", "ai_distance_mm", "conoid_length_mm"}
    return Girdle(**{one.name: "" if one.name in scalars else "3" for one in fields(Girdle)})  # type: ignore[arg-type]


GIRDLE: Any = _numbers_of_girdle()
"""Shapes of the fields of a girdle, for ``adapt.engine.kernel``."""

_SOLUTION: Any = PostureSolution(*("6", "3", "3", "", "", "int", "int", "bool"))  # type: ignore[arg-type]

_LANES = 4096
"""Number of postures per chunk of a JAX program."""

postures_kernel = Kernel("postures", iterate, (GIRDLE, "6", "6", ("6", "3", "bool"), ""), _SOLUTION, _LANES)

lowest_kernel = Kernel(
    "lowest",
    iterate_from_two_starts,
    (GIRDLE, "6", "6", ("6", "6"), ("", ""), ""),
    (_SOLUTION, "bool", "bool"),
    _LANES,
)
