"""Batches in chunks or at once: nothing lost, nothing doubled, few programs, and who has converged is left alone."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from adapt.chunks import compiled, in_chunks, resumed

SIZE = 64


class Count(NamedTuple):
    """Something iterated: halved until it is at most 1."""

    value: Array
    steps: Array
    converged: Array


@pytest.mark.parametrize("lanes", [1, 7, 8, 9, 63, 64, 65, 200])
def test_every_lane_comes_back_once_in_its_place(lanes):
    x = np.arange(2.0 * lanes).reshape(2, lanes)
    found = in_chunks(lambda tree, y: {"sum": tree["x"] + y, "row": y}, SIZE, {"x": x}, x[0])
    np.testing.assert_array_equal(found["sum"], x + x[0])
    np.testing.assert_array_equal(found["row"], x[0])


def test_one_program_serves_every_number_of_lanes():
    shapes = []

    @compiled
    def doubled(x):
        shapes.append(x.shape)  # runs while tracing: once a compilation
        return 2.0 * x

    for lanes in (*range(1, 130, 7), 1000):
        np.testing.assert_array_equal(in_chunks(doubled, SIZE, np.arange(float(lanes))), 2.0 * np.arange(lanes))
    assert shapes == [(64,)]


def test_few_lanes_are_done_at_once_and_compile_nothing():
    shapes = []

    @compiled
    def same(x):
        shapes.append((type(x), x.shape))
        return x

    for lanes in (1, 8, 9, 10):
        np.testing.assert_array_equal(in_chunks(same, SIZE, np.arange(float(lanes)), at_once=9), np.arange(lanes))
    assert shapes[:3] == [(np.ndarray, (1,)), (np.ndarray, (8,)), (np.ndarray, (9,))]
    assert [shape for _, shape in shapes[3:]] == [(SIZE,)]


def test_who_has_converged_is_left_alone():
    """Lanes that end in the first round come back untouched by the others' further rounds."""
    handled = []

    def halved(fixed, state):
        handled.append(np.asarray(fixed).tolist())
        value = jnp.where(state.converged, state.value, state.value / 2.0)
        return Count(value, state.steps + ~state.converged, value <= 1.0)

    values = np.array([1.5, 8.0, 0.5, 3.0])
    start = Count(jnp.asarray(values), jnp.zeros(4, int), jnp.asarray(values <= 1.0))
    end = resumed(lambda *x: halved(*x), 4, 10, (np.arange(4),), start)
    np.testing.assert_array_equal(end.value, [0.75, 1.0, 0.5, 0.75])
    np.testing.assert_array_equal(end.steps, [1, 3, 0, 2])
    assert [sorted(set(lanes)) for lanes in handled] == [[0, 1, 3], [1, 3], [1]]


def test_rounds_end_where_nothing_converges():
    start = Count(jnp.ones(3), jnp.zeros(3, int), jnp.zeros(3, bool))
    end = resumed(lambda state: state._replace(steps=state.steps + 1), 8, 5, (), start)
    assert end.steps.tolist() == [5, 5, 5]
    assert not end.converged.any()
