"""The backtracking loop of the fast paths by hand: accepted and shortened steps, and the end of a problem."""

from typing import Any, NamedTuple

import numpy as np

from adapt.solvers.newton.backtracking import accepted_or_shorter, good_enough, until_converged


class State(NamedTuple):
    x: np.ndarray
    length: np.ndarray
    merit: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray


def state(x: Any, length: Any = 1.0, merit: Any = 2.0, iterations: Any = 0, converged: Any = False) -> State:
    parts = np.broadcast_arrays(np.asarray(x, float), length, merit, iterations, converged)
    return State(*(np.array(part) for part in parts))


def test_a_point_that_is_not_higher_is_good_and_no_number_never():
    merit = np.array([1.0, 2.0, 2.0 + 1e-12, 2.0 + 1e-9, 3.0, np.nan, np.inf])
    assert good_enough(state(merit), merit).tolist() == [True, True, True, False, False, False, False]


def test_when_hardly_anything_is_left_of_a_step_it_is_taken():
    """Check that a step below a twentieth of its length is accepted even uphill, but only to a finite merit."""
    merit = np.array([3.0, 3.0, np.nan, np.inf])
    length = np.array([0.051, 0.049, 0.01, 0.01])
    assert good_enough(state(merit, length), merit).tolist() == [False, True, False, False]


def test_rounding_is_that_of_the_merit():
    """Check the tolerance of the merit: 1e-11 relative to it, absolute for a merit near 0, for both signs."""
    before = np.array([1e6, 1e6, -1e6, -1e6, 0.0, 0.0])
    rise = np.array([0.9e-5, 1.1e-5, 0.9e-5, 1.1e-5, 0.9e-11, 1.1e-11])
    assert good_enough(state(before, merit=before), before + rise).tolist() == [True, False] * 3


def test_a_refused_step_comes_back_part_of_the_way():
    """Check that a refused step is cut to 0.3 of its length and keeps the previous state; the iteration counts."""
    old = state([1.0, 1.0], length=0.5)
    accepted = state([7.0, 7.0], merit=1.0, iterations=1, converged=True)
    found = accepted_or_shorter(np.array([True, False]), accepted, old)
    assert found.x.tolist() == [7.0, 1.0]
    assert found.length.tolist() == [1.0, 0.15]
    assert found.merit.tolist() == [1.0, 2.0]
    assert found.iterations.tolist() == [1, 1]
    assert found.converged.tolist() == [True, False]


def test_each_lane_goes_on_until_it_has_converged_or_has_no_iterations_left():
    """Check a toy iteration that halves x until it is below 1.

    3 becomes 3/4 in two iterations; 1000 would need ten, of four allowed; 0.5 has converged before the first and stays.
    """
    seen = []

    def advance(now):
        old, beside = now
        seen.append(old.x.tolist())
        x = old.x / 2.0
        return old._replace(x=x, iterations=old.iterations + 1, converged=x < 1.0), beside + 1

    first = state([3.0, 1000.0, 0.5], converged=np.array([False, False, True]))
    found, beside = until_converged(advance, (first, np.array(0)), np.array([10, 4, 10]))
    assert found.x.tolist() == [0.75, 62.5, 0.5]
    assert found.iterations.tolist() == [2, 4, 0]
    assert found.converged.tolist() == [True, False, True]
    assert beside == len(seen) == 4
