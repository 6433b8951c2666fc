"""Rotations against cases solved by hand and against SciPy."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from motions.rotations import (
    DEG,
    cardan_from_rotation,
    compose,
    mean_angle,
    rotate,
    rotation_from_cardan,
    rotation_from_vector,
    vector_from_rotation,
)

TOLERANCE = 1e-14
"""Tolerance: a few rounding errors of products of sines and cosines."""

ANGLE_TOLERANCE = 1e-8
"""Tolerance in radians: near gimbal lock, tested up to 0.6 degrees from it, arc tangents magnify rounding 100 times."""

TURN = st.floats(-np.pi + 1e-6, np.pi - 1e-6)
CARDAN = st.tuples(TURN, st.floats(-1.56, 1.56), TURN)
X, Y, Z = np.eye(3)


def matrix(*angles_deg: float) -> np.ndarray:
    return np.asarray(rotation_from_cardan(jnp.array(angles_deg) / DEG))


@pytest.mark.parametrize(
    ("angles_deg", "images"),
    [
        ((0.0, 0.0, 0.0), (X, Y, Z)),
        ((90.0, 0.0, 0.0), (-Z, Y, X)),  # protraction moves the lateral end forward; z points backward
        ((0.0, 90.0, 0.0), (Y, -X, Z)),  # elevation moves the lateral end up
        ((0.0, 0.0, 90.0), (X, Z, -Y)),  # backward tipping moves the upper side backward
    ],
)
def test_quarter_turns_by_hand(angles_deg, images):
    np.testing.assert_allclose(matrix(*angles_deg), np.column_stack(images), rtol=0.0, atol=TOLERANCE)


@settings(max_examples=50, deadline=None)
@given(angles=CARDAN)
def test_cardan_is_scipys_intrinsic_yzx(angles):
    R = rotation_from_cardan(jnp.array(angles))
    np.testing.assert_allclose(R, Rotation.from_euler("YZX", angles).as_matrix(), rtol=0.0, atol=TOLERANCE)
    np.testing.assert_allclose(cardan_from_rotation(R), angles, rtol=0.0, atol=ANGLE_TOLERANCE)


@settings(max_examples=50, deadline=None)
@given(angles=CARDAN)
def test_the_mirror_image_negates_the_y_and_z_angles(angles):
    M = np.diag([-1.0, 1.0, 1.0])
    a, b, c = angles
    R = np.asarray(rotation_from_cardan(jnp.array(angles)))
    np.testing.assert_allclose(rotation_from_cardan(jnp.array([-a, -b, c])), M @ R @ M, rtol=0.0, atol=TOLERANCE)


@settings(max_examples=50, deadline=None)
@given(vector=st.tuples(*[st.floats(-2.0, 2.0)] * 3), scale=st.sampled_from([1.0, 1e-2, 1e-9]))
def test_rotation_vector_and_angle_are_scipys(vector, scale):
    expected = Rotation.from_rotvec(scale * np.array(vector))
    R = rotation_from_vector(jnp.array(scale * np.array(vector)))
    np.testing.assert_allclose(R, expected.as_matrix(), rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(mean_angle(R), expected.magnitude(), rtol=0.0, atol=ANGLE_TOLERANCE)


@pytest.mark.parametrize("squared", [1e-4, 0.999e-3, 1.001e-3], ids=["small", "before the seam", "after it"])
def test_the_series_of_small_vectors_is_exact_up_to_its_end(squared):
    vector = np.sqrt(squared) * np.array([2.0, -1.0, 2.0]) / 3.0
    expected = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(rotation_from_vector(jnp.array(vector)), expected, rtol=0.0, atol=1e-12)


def test_a_batch_is_its_members():
    """Holds for numpy arrays, whose indices are checked, as for JAX arrays."""
    generator = np.random.default_rng(1)
    angles = generator.uniform(-1.5, 1.5, (3, 4, 5))
    vectors = generator.normal(size=(3, 4, 5))
    R = np.asarray(rotation_from_cardan(jnp.asarray(angles)))
    np.testing.assert_allclose(cardan_from_rotation(R), angles, rtol=0.0, atol=TOLERANCE)
    magnitude = np.array([[Rotation.from_matrix(R[..., j, k]).magnitude() for k in range(5)] for j in range(4)])
    np.testing.assert_allclose(mean_angle(R), magnitude, rtol=0.0, atol=ANGLE_TOLERANCE)
    rotated, squared = rotate(jnp.asarray(R), jnp.asarray(vectors)), compose(jnp.asarray(R), jnp.asarray(R))
    for k in np.ndindex(4, 5):
        at = (..., *k)
        np.testing.assert_allclose(R[at], Rotation.from_euler("YZX", angles[at]).as_matrix(), rtol=0.0, atol=TOLERANCE)
        np.testing.assert_allclose(rotated[at], R[at] @ vectors[at], rtol=0.0, atol=TOLERANCE)
        np.testing.assert_allclose(squared[at], R[at] @ R[at], rtol=0.0, atol=TOLERANCE)


AXIS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(max_examples=50, deadline=None)
@given(axis=AXIS, angle=st.one_of(st.floats(0.0, 3.1), st.floats(0.0, 1e-6)))
def test_the_vector_of_a_rotation_is_that_which_made_it(axis, angle):
    v = angle * np.array(axis) / np.linalg.norm(axis)
    found = np.asarray(vector_from_rotation(rotation_from_vector(jnp.array(v))))
    np.testing.assert_allclose(found, v, rtol=0.0, atol=LOG_TOLERANCE)
    np.testing.assert_allclose(found, Rotation.from_rotvec(v).as_rotvec(), rtol=0.0, atol=LOG_TOLERANCE)


LOG_TOLERANCE = 1e-12
"""Tolerance up to 2.4 degrees from half a turn, where the axis is divided by a sine of 0.04."""


def test_no_rotation_has_no_vector_and_a_batch_is_elementwise():
    vectors = np.array([[0.0, 0.0, 0.0], [0.3, -0.2, 1.0], [1e-9, 0.0, 0.0]]).T
    found = np.asarray(vector_from_rotation(rotation_from_vector(jnp.array(vectors))))
    np.testing.assert_allclose(found, vectors, rtol=0.0, atol=TOLERANCE)
    np.testing.assert_array_equal(found[:, 0], 0.0)


@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-8])
def test_near_half_a_turn_the_axis_is_as_sure_as_its_sine_and_the_angle_is_exact(short):
    axis = np.array([0.6, 0.0, -0.8])
    found = np.asarray(vector_from_rotation(jnp.array(Rotation.from_rotvec((np.pi - short) * axis).as_matrix())))
    np.testing.assert_allclose(np.linalg.norm(found), np.pi - short, rtol=1e-12)
    np.testing.assert_allclose(found, (np.pi - short) * axis, rtol=0.0, atol=1e-14 / short)


def test_the_axis_of_half_a_turn_is_not_found():
    """The length of the zero vector is still finite: the caller gets zero, not NaN."""
    assert np.isfinite(vector_from_rotation(jnp.diag(jnp.array([1.0, -1.0, -1.0])))).all()
