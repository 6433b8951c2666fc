"""Moment arms as derivatives of the lengths: by angle, about the joints, and in the free directions of the chain."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import few_runs

from adapt.tables.driven_table import drive_each
from models import load_model
from models.drive import free_coordinates_mm
from models.girdle import bone_rotations
from models.muscles.contact import angle_deg, contact_forces
from models.muscles.muscle_lines import CLAVICLE, HUMERUS, SCAPULA, SERRATUS, THORAX, muscle_lines
from models.muscles.pulls import (
    arms_by_angle_mm,
    arms_in_free_directions,
    free_directions,
    lengths_mm,
    line_points_mm,
    muscle_arms_mm,
    pulls,
)
from motions.landmarks.frames import humerus_angles, humerus_rotation
from motions.rhythm import REST_DEG
from motions.rotations import DEG, cardan_from_rotation, compose, rotation_from_vector

SLOPE = 1e-5
"""Tolerance: arms are tens of mm, and the differences exact to 1e-6."""

SETS = ("R2", "R4", "R6")
"""Sets that are closed at rest."""


@cache
def postures(name: str):
    """Return closed postures about rest, and their free coordinates."""
    model = load_model(name)
    rest = np.asarray(free_coordinates_mm(model.girdle, REST_DEG / DEG))
    offsets = np.array([[0.0, 6.0, -5.0, 3.0, 8.0], [0.0, -4.0, 3.0, 6.0, -7.0], [0.0, 3.0, -2.0, 4.0, 2.0]])
    q = driven(model, rest[:, None] + offsets, (REST_DEG / DEG)[:, None])
    good = np.flatnonzero(np.isfinite(q).all(axis=0))[:3]
    assert len(good) == 3
    return model, q[:, good], rest[:, None] + offsets[:, good]


def driven(model, coordinates, start) -> np.ndarray:
    """Return the angles at free coordinates, in an array of any shape, near a start."""
    asked, near = coordinates.reshape(3, -1), np.broadcast_to(start, (6, *coordinates.shape[1:])).reshape(6, -1)
    return drive_each(model.girdle.repeated(asked.shape[1]), asked, near).angles.reshape(6, *coordinates.shape[1:])


def lengths_at(model, lines, q, humerus=None) -> np.ndarray:
    """Compute the lengths in an array of postures at once: each call costs as much as 64 postures."""
    held = None if humerus is None else humerus.reshape(3, -1)
    return pulls(lines, model.girdle, q.reshape(6, -1), held).length_mm.reshape(-1, *q.shape[1:])


def beside(x: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Add each step to each component of x: (component, step, moved component, posture)."""
    return x[:, None, None] + steps[:, None, None] * np.eye(len(x))[:, None, :, None]


@pytest.mark.parametrize("name", SETS)
def test_arms_by_angle_are_slopes_of_the_length(name):
    model, q, _ = postures(name)
    lines = muscle_lines(model)
    arms = arms_by_angle_mm(lines, pulls(lines, model.girdle, q), model.girdle, q)
    h = 1e-6
    more, less = np.moveaxis(lengths_at(model, lines, beside(q, np.array([h, -h]))), 1, 0)
    np.testing.assert_allclose(arms, -np.moveaxis(more - less, 1, 0) / (2 * h), atol=SLOPE)


@pytest.mark.parametrize("name", SETS)
def test_arms_in_the_free_directions_are_slopes_along_the_driven_chain(name):
    model, q, c = postures(name)
    lines = muscle_lines(model)
    by_angle = arms_by_angle_mm(lines, pulls(lines, model.girdle, q), model.girdle, q)
    arms = arms_in_free_directions(by_angle, free_directions(model.girdle, q))
    h = 1e-3
    moved = driven(model, beside(c, h * np.array([1.0, -1.0, 2.0, -2.0])), q[:, None, None])
    one, back, two, two_back = np.moveaxis(lengths_at(model, lines, moved), 1, 0)
    difference = np.moveaxis(8.0 * (one - back) - (two - two_back), 1, 0) / (12.0 * h)
    for found, expected in zip(arms, difference, strict=True):
        np.testing.assert_allclose(found, -expected, atol=SLOPE * np.abs(found).max())


def test_arms_about_the_joints_are_slopes_for_small_turns_about_them():
    model, q, _ = postures("R2")
    lines = muscle_lines(model)
    held = np.repeat(np.array([[0.5], [0.9], [-0.4]]), q.shape[1], axis=1)
    found = pulls(lines, model.girdle, q, held)
    R_clavicle, R_scapula = bone_rotations(q)
    h = 1e-6
    postures_beside, arms_beside = [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            turn = np.zeros((3, q.shape[1]))
            turn[axis] = sign * h
            R = rotation_from_vector(turn)
            scapula = cardan_from_rotation(compose(R, R_scapula))
            for clavicle in (cardan_from_rotation(compose(R, R_clavicle)), q[:3]):
                postures_beside.append(np.concatenate([clavicle, scapula]))
                arms_beside.append(humerus_angles(compose(R, humerus_rotation(held))))
    lengths = lengths_at(model, lines, *(np.stack(one, axis=1) for one in (postures_beside, arms_beside)))
    more, less = np.moveaxis(lengths.reshape(len(lengths), 3, 2, 2, -1), 2, 0)
    difference = np.moveaxis(more - less, 0, 2) / (2 * h)
    for joint, arms in enumerate((found.about_sc_mm, found.about_ac_mm)):
        np.testing.assert_allclose(arms, -difference[:, joint], atol=SLOPE)


def test_slopes_of_the_arms_are_second_derivatives_of_the_length():
    """Check R2: wrapped lines with attachments on the surface and inside, and straight lines."""
    model = load_model("R2")
    lines, q = muscle_lines(model), jnp.asarray(REST_DEG / DEG)

    def lengths(q):
        return lengths_mm(lines, model.girdle, q[:, None])[:, 0]

    by_angle = jax.jacfwd(lambda q: (lengths(q),) * 2, has_aux=True)
    by_angle_mm, length, bends = few_runs(lambda q: (*by_angle(q), jax.hessian(lengths)(q)))(q)
    arms, slopes = -by_angle_mm, -bends
    found = pulls(lines, model.girdle, np.asarray(q)[:, None])
    np.testing.assert_allclose(length, found.length_mm[:, 0], rtol=1e-12)
    assert (found.depth_mm > 0.0).any()
    np.testing.assert_allclose(
        arms, arms_by_angle_mm(lines, found, model.girdle, np.asarray(q)[:, None])[..., 0].T, atol=1e-9
    )
    h = 1e-5
    moved = beside(np.asarray(q)[:, None], np.array([h, -h])).reshape(6, -1)
    there = arms_by_angle_mm(lines, pulls(lines, model.girdle, moved), model.girdle, moved)
    more, less = np.moveaxis(there.reshape(6, -1, 2, 6), 2, 0)
    np.testing.assert_allclose(slopes, np.swapaxes(more - less, 0, 1) / (2 * h), atol=SLOPE)


def test_the_points_of_the_lines_go_from_end_to_end_as_far_as_the_lines_are_long(monkeypatch):
    """Check points round the ellipsoid, chords of a 200th of the contact; an end inside goes to its closest surface
    point."""
    model, q, _ = postures("R2")
    lines = muscle_lines(model)
    found = pulls(lines, model.girdle, q)
    monkeypatch.setattr("models.muscles.pulls._BLOCK", q.shape[1])  # with 64, most would be copies
    points = line_points_mm(lines, model.girdle, q, 201)
    along = np.linalg.norm(np.diff(points, axis=0), axis=1).sum(axis=0)
    np.testing.assert_allclose(along, found.length_mm, rtol=1e-5)
    clear = found.depth_mm == 0.0
    to_humerus = (lines.end == HUMERUS)[None, :, None]
    through = np.where(to_humerus, points[0], points[-1])
    np.testing.assert_allclose(through[:, clear], found.attachment_mm[:, clear], atol=1e-9)
    trunk = lines.start == THORAX
    thorax = np.broadcast_to(lines.start_mm[..., None], points[0].shape)
    np.testing.assert_allclose(points[0][:, trunk][:, clear[trunk]], thorax[:, trunk][:, clear[trunk]], atol=1e-9)
    centre, axes = (np.asarray(x)[:, None, None] for x in (model.girdle.centre_mm, model.girdle.semi_axes_mm))
    outward = (((points - centre) / axes) ** 2).sum(axis=1)
    assert outward[:, lines.of(SERRATUS)].min() > 1.0 - 1e-9


def test_the_measure_of_a_muscle_is_the_length_of_its_mean_arm():
    lines = muscle_lines(load_model("R2"))
    arms = np.zeros((3, len(lines.name), 1))
    serratus = np.flatnonzero(lines.of(SERRATUS))
    arms[0, serratus[:6]], arms[0, serratus[6:]], arms[1, serratus] = 10.0, -10.0, 4.0
    assert muscle_arms_mm(lines, arms)[lines.muscles.index(SERRATUS), 0] == pytest.approx(4.0)


def test_a_pull_is_a_unit_force_but_for_attachments_inside():
    model, q, _ = postures("R4")
    lines = muscle_lines(model)
    found = pulls(lines, model.girdle, q)
    size = np.linalg.norm(found.pull, axis=0)
    np.testing.assert_allclose(size[found.depth_mm == 0.0], 1.0, atol=1e-12)
    assert (found.contact_mm[lines.of(SERRATUS)] > 0.0).any()
    assert (found.contact_mm[~lines.wraps] == 0.0).all()
    for joint, arms in ((CLAVICLE, found.about_sc_mm), (SCAPULA, found.about_ac_mm), (HUMERUS, found.about_gh_mm)):
        np.testing.assert_array_equal(arms[:, ~lines.crosses(joint)], 0.0)
        assert (np.linalg.norm(arms[:, lines.crosses(joint)], axis=0) > 0.0).all()


def test_contact_pushes_outward_and_the_conoid_pulls_to_the_clavicle():
    """Check directions by slopes of A1-A3: along its force each grows by 1 (TS, AI) or shrinks by 1 (conoid)."""
    model, q, _ = postures("R6")
    forces = contact_forces(model.girdle.repeated(q.shape[1]), q)
    np.testing.assert_allclose(np.linalg.norm(forces.direction, axis=0), 1.0, atol=1e-12)
    assert (forces.direction[2, :2] > 0.0).all()  # on the back of the thorax, outward is backward
    np.testing.assert_array_equal(forces.about_sc_mm[:, 2], 0.0)


def test_angles_between_directions():
    x, y = np.array([1.0, 0.0, 0.0]), np.array([np.cos(1e-9), np.sin(1e-9), 0.0])
    assert angle_deg(x, y) == pytest.approx(np.degrees(1e-9), rel=1e-9)
    assert angle_deg(x, -x) == pytest.approx(180.0)
