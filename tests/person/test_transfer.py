"""Attachments carried by landmarks, and their distances, worked by hand; carried conoids against the library."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.person.attachments import scapular_map
from models.person.transfer.contour_distances import (
    LINE,
    PLANE,
    POINT,
    between_contours,
    between_means_mm,
    to_contour_mm,
    to_line,
    to_plane,
)
from models.person.transfer.landmark_map import landmark_map

EXACT = 1e-9

TRIAD = np.array([[0.0, 0.0, 0.0], [-119.0, 0.0, 0.0], [-139.0, -110.0, 0.0]]).T


def turned(points: np.ndarray, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return Rotation.random(rng=rng).as_matrix() @ points + rng.normal(0.0, 100.0, (3, 1))


def test_three_landmarks_carry_as_the_conoid_is_carried():
    """Check against the library's scapular map, with both scapulae turned and shifted at random."""
    ts, ai = np.array([-130.0, 0.0, 0.0]), np.array([-128.0, -121.0, 0.0])
    point = np.array([[-53.6], [-0.9], [-26.6]])
    by_hand = scapular_map(TRIAD[:, 1], TRIAD[:, 2], ts, ai) @ point
    source = turned(np.hstack([TRIAD, point]), 1)
    target = turned(np.hstack([np.zeros((3, 1)), ts[:, None], ai[:, None], by_hand]), 2)
    found = landmark_map(source[:, :3], target[:, :3])
    assert found.in_a_plane
    np.testing.assert_allclose(found.of(source[:, 3:]), target[:, 3:], atol=EXACT)
    assert found.residual_mm < EXACT


def test_landmarks_with_depth_give_the_affine_map():
    rng = np.random.default_rng(3)
    source = rng.normal(0.0, 50.0, (3, 6))
    M, t = np.diag([1.1, 0.9, 1.2]) + 0.05 * rng.normal(size=(3, 3)), rng.normal(size=(3, 1))
    found = landmark_map(source, M @ source + t)
    assert not found.in_a_plane
    np.testing.assert_allclose(found.M, M, atol=EXACT)
    np.testing.assert_allclose(found.of(np.eye(3)), M @ np.eye(3) + t, atol=EXACT)


@pytest.mark.parametrize("landmarks", [TRIAD[:, :2], np.outer([1.0, 2.0, 3.0], [0.0, 1.0, 2.0])])
def test_two_landmarks_or_a_line_carry_nothing(landmarks):
    with pytest.raises(ValueError, match="landmarks"):
        landmark_map(landmarks, landmarks)


SQUARE = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0], [0.0, 10.0, 0.0]]).T


def test_distances_of_contours_by_hand():
    """A point 4 in front of the middle of a side: distances to corners, to an open line, and to a closed plane."""
    point = np.array([[-4.0], [5.0], [0.0]])
    assert to_contour_mm(point, SQUARE, POINT) == pytest.approx([np.hypot(4.0, 5.0)])
    assert to_contour_mm(point, SQUARE, LINE) == pytest.approx([np.hypot(4.0, 5.0)])  # the last side is open
    assert to_contour_mm(point, SQUARE, PLANE) == pytest.approx([4.0])
    lifted = SQUARE + np.array([[0.0], [0.0], [6.0]])
    assert between_contours(SQUARE, lifted, PLANE)[:] == pytest.approx((6.0, 6.0, 0.0, 6.0))


def test_a_line_slid_along_itself_is_near_with_a_large_end():
    """From 0-30 to 20-50: the nearest ends are 0 apart, the farthest 20; the mean over the four points is 10."""
    line = np.array([[0.0, 30.0], [0.0, 0.0], [0.0, 0.0]])
    slid = line + np.array([[20.0], [0.0], [0.0]])
    found = between_contours(line, slid, LINE)
    assert (found.least_mm, found.mean_mm, found.most_mm) == pytest.approx((0.0, 10.0, 20.0))
    off = to_line(slid + np.array([[0.0], [5.0], [0.0]]), line)  # at 20 and 50, 5 above the line
    assert (off.least_mm, off.most_mm) == pytest.approx((5.0, np.hypot(20.0, 5.0)))


def test_planes_and_means_by_hand():
    """MDP: 1, 2, 3 and 4 mm off the plane of the square, mean 2.5, SD sqrt(5/3). DMP: 2.5 between the means."""
    off = SQUARE + np.array([[0.0] * 4, [0.0] * 4, [1.0, 2.0, 3.0, 4.0]])
    assert to_plane(off, turned_flat()) == pytest.approx((2.5, np.sqrt(5.0 / 3.0)))
    assert between_means_mm(off, SQUARE) == pytest.approx(2.5)
    with pytest.raises(ValueError, match="on a line"):
        to_plane(off, SQUARE[:, :2])


def turned_flat() -> np.ndarray:
    """Return other points of the same plane z = 0."""
    return np.array([[3.0, 8.0, -5.0, 2.0], [1.0, 9.0, 4.0, -7.0], [0.0, 0.0, 0.0, 0.0]])
