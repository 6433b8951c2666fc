"""Attachments carried between surfaces of synthetic bones: a similarity, the same bone, and a known attachment."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.person.transfer.bone_surfaces import carried_points, similarity_by_inertia

PLANTED_MM = 1.0

ATTACHMENT = (0.4, 1.1)
"""Place of the attachment in the surface's own coordinates."""


def bone(count: int, seed: int, size=(45.0, 75.0, 20.0), bump: float = 12.0) -> np.ndarray:
    """Make a synthetic bone: an ellipsoid with a process and a notch, so that no rotation maps the bone to itself."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-1.0, 1.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    return surface(u, v, size, bump)


def surface(u, v, size=(45.0, 75.0, 20.0), bump: float = 12.0) -> np.ndarray:
    ring = np.sqrt(1.0 - np.asarray(u) ** 2)
    direction = np.stack([ring * np.cos(v), np.asarray(u), ring * np.sin(v)])
    process = np.exp(-(((direction - np.array([[0.6], [0.8], [0.0]])) ** 2).sum(axis=0)) / 0.1)
    notch = np.exp(-(((direction - np.array([[-0.9], [-0.2], [0.4]])) ** 2).sum(axis=0)) / 0.2)
    radius = 1.0 + bump / 45.0 * process - bump / 60.0 * notch
    return np.array(size)[:, None] * radius * direction


def test_a_similarity_is_recovered_exactly():
    source = bone(1500, 0)
    R = Rotation.from_euler("xyz", [20.0, -35.0, 130.0], degrees=True).as_matrix()
    target = 1.13 * R @ source[:, np.random.default_rng(1).permutation(1500)] + np.array([[100.0], [-20.0], [7.0]])
    found = similarity_by_inertia(source, target)
    assert found.scale == pytest.approx(1.13, abs=1e-10)
    np.testing.assert_allclose(found.R, R, atol=1e-9)
    np.testing.assert_allclose(found.t, [100.0, -20.0, 7.0], atol=1e-7)


def test_a_bone_carried_to_itself_is_unchanged():
    source = bone(800, 2)
    point = surface([ATTACHMENT[0]], [ATTACHMENT[1]])
    np.testing.assert_allclose(carried_points(source, source, point), point, atol=1e-6)


def test_a_planted_attachment_is_carried_within_1_mm():
    """Check a bone of another shape and size, with its surface sampled anew and three landmarks known on both."""
    other = (50.0, 79.0, 23.0), 15.0
    source, target = bone(6000, 3), bone(6000, 4, *other)
    R = Rotation.from_euler("xyz", [10.0, 25.0, -40.0], degrees=True).as_matrix()
    u, v = [0.8, -0.97, 0.1], [0.0, 3.0, 2.9]
    landmarks = surface(u, v), R @ surface(u, v, *other)
    planted, expected = surface([0.55], [1.2]), R @ surface([0.55], [1.2], *other)
    found = carried_points(source, R @ target, planted, *landmarks)
    off = np.linalg.norm(found - expected)
    by_similarity = np.linalg.norm(similarity_by_inertia(source, R @ target).of(planted) - expected)
    assert off < PLANTED_MM
    assert off < by_similarity


@pytest.mark.parametrize("seed", range(10))
def test_places_without_a_feature_are_carried_better_than_by_the_similarity(seed):
    rng = np.random.default_rng(seed)
    other = tuple(np.array([45.0, 75.0, 20.0]) * (1.0 + rng.uniform(-0.12, 0.12, 3))), 12.0 + rng.uniform(-4.0, 4.0)
    source, target = bone(6000, 10 + seed), bone(6000, 20 + seed, *other)
    R = Rotation.random(rng=rng).as_matrix()
    u, v = rng.uniform(-0.8, 0.8, 20), rng.uniform(0.0, 2.0 * np.pi, 20)
    points, expected = surface(u, v), R @ surface(u, v, *other)
    off = np.median(np.linalg.norm(carried_points(source, R @ target, points) - expected, axis=0))
    by_similarity = similarity_by_inertia(source, R @ target).of(points)
    assert off < PLANTED_MM
    assert off < np.median(np.linalg.norm(by_similarity - expected, axis=0))


def test_a_sphere_has_no_axes():
    with pytest.raises(ValueError, match="same inertia"):
        similarity_by_inertia(bone(3000, 5, (30.0, 30.0, 30.0), 0.0), bone(500, 6))
