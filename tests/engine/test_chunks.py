"""``in_chunks`` and ``in_rounds``: each problem once and in place, few compilations, converged problems unchanged."""

from typing import NamedTuple

import numpy as np
import pytest

from adapt.engine.batching import compiled, in_chunks, in_rounds

SIZE = 64


class Count(NamedTuple):
    """Result of a toy solver that halves ``value`` until it is at most 1 or the iterations run out."""

    value: np.ndarray
    also: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray


@pytest.mark.parametrize("problems", [1, 7, 8, 9, 63, 64, 65, 200])
def test_every_problem_comes_back_once_in_its_place(problems):
    x = np.arange(2.0 * problems).reshape(2, problems)
    found = in_chunks(lambda tree, y: {"sum": tree["x"] + y, "row": y}, SIZE, {"x": x}, x[0])
    np.testing.assert_array_equal(found["sum"], x + x[0])
    np.testing.assert_array_equal(found["row"], x[0])


def test_one_program_serves_every_number_of_problems():
    shapes = []

    @compiled
    def doubled(x):
        shapes.append(x.shape)  # this line runs only while JAX traces, once per compilation
        return 2.0 * x

    for problems in (*range(1, 130, 7), 1000):
        np.testing.assert_array_equal(in_chunks(doubled, SIZE, np.arange(float(problems))), 2.0 * np.arange(problems))
    assert shapes == [(64,)]


def test_few_problems_are_done_at_once_and_compile_nothing():
    shapes = []

    @compiled
    def same(x):
        shapes.append((type(x), x.shape))
        return x

    for problems in (1, 8, 9, 10):
        np.testing.assert_array_equal(in_chunks(same, SIZE, np.arange(float(problems)), eager=9), np.arange(problems))
    assert shapes[:3] == [(np.ndarray, (1,)), (np.ndarray, (8,)), (np.ndarray, (9,))]
    assert [shape for _, shape in shapes[3:]] == [(SIZE,)]


def test_who_has_converged_is_left_alone():
    """Check that problems that converge in the first round keep their result during the further rounds of others."""
    handled = []

    def halved(fixed, start, iterations):
        handled.append((fixed.tolist(), iterations.tolist()))
        value, also, converged = start
        value = value / 2.0**iterations
        return Count(value, also + 1.0, iterations, converged | (value <= 1.0))

    values = np.array([1.5, 8.0, 0.5, 3.0])
    end = in_rounds(halved, (1, 1, 2), (np.arange(4),), ("value", "also"), values, np.zeros(4))
    np.testing.assert_array_equal(end.value, [0.75, 0.5, 0.25, 0.75])
    np.testing.assert_array_equal(end.also, [1.0, 3.0, 1.0, 2.0])
    np.testing.assert_array_equal(end.iterations, [1, 4, 1, 2])
    assert handled == [([0, 1, 2, 3], [1.0] * 4), ([1, 3], [1.0] * 2), ([1], [2.0])]


def test_rounds_end_where_nothing_converges():
    def stays(start, iterations):
        value, converged = start
        return Count(value, value, iterations, converged)

    end = in_rounds(stays, (3, 2), (), ("value",), np.ones(3))
    assert end.iterations.tolist() == [5, 5, 5]
    assert not end.converged.any()
