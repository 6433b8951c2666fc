"""Shortest paths round a sphere and a cylinder: by hand, by ellipsoids, by OpenSim; derivatives, lift-off."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import few_runs

from models import load_model
from models.muscles.muscle_lines import HUMERUS, muscle_lines, published_lines
from models.muscles.pulls import line_points_mm, pulls
from models.muscles.round_bones import round_contact_mm, round_depth_mm, round_length_mm, round_points_mm
from models.muscles.wrapping import path_length_mm
from motions.landmarks.frames import humerus_rotation
from motions.rhythm import REST_DEG
from motions.rotations import DEG, rotate

SPHERE, SHAFT = np.zeros((3, 1)), np.array([[0.0], [0.0], [1.0]])

RADIUS = np.array([20.0])

ROUNDING = 1e-9

SLOPE = 1e-6
"""Tolerance for central differences over 2e-3 mm."""

OPENSIM_MM = 1.0
"""Tolerance of the project; OpenSim's paths round spheres and cylinders are closed forms too, and agree to 0.01 mm."""


def outside(count: int, seed: int, nearest: float = 1.001) -> tuple[np.ndarray, np.ndarray]:
    """Draw pairs of points, at ``nearest`` to 1.8 radii from the z-axis, less than 150 degrees apart about it."""
    generator = np.random.default_rng(seed)
    angle = np.stack([generator.uniform(-np.pi, np.pi, count), np.zeros(count)])
    angle[1] = angle[0] + generator.uniform(-1.0, 1.0, count) * np.radians(150.0)
    distance = RADIUS * generator.uniform(nearest, 1.8, (2, count))
    z = 30.0 * generator.standard_normal((2, count))
    one, other = (np.stack([distance[k] * np.cos(angle[k]), distance[k] * np.sin(angle[k]), z[k]]) for k in range(2))
    return one, other


def test_over_the_top_of_a_ball():
    """Check paths between points at 2 r from the centre, in one plane through it.

    Opposite points have two tangents of sqrt(3) r, and an arc of a third of half a turn.
    """
    p, q = np.array([[-40.0], [0.0], [0.0]]), np.array([[40.0 * np.cos(2.0)], [40.0 * np.sin(2.0)], [0.0]])
    expected = 2.0 * np.sqrt(3.0) * 20.0 + 20.0 * (np.pi - 2.0 - 2.0 * np.arccos(0.5))
    if np.pi - 2.0 <= 2.0 * np.arccos(0.5):
        expected = np.linalg.norm(p - q)
    np.testing.assert_allclose(round_length_mm(p, q, SPHERE, RADIUS), expected, atol=ROUNDING)
    opposite = np.array([[40.0], [1e-9], [0.0]])
    half_round = 2.0 * np.sqrt(3.0) * 20.0 + 20.0 * np.pi / 3.0
    np.testing.assert_allclose(round_length_mm(p, opposite, SPHERE, RADIUS), half_round, atol=1e-6)
    np.testing.assert_allclose(round_contact_mm(p, opposite, SPHERE, RADIUS), 20.0 * np.pi / 3.0, atol=1e-6)


def test_a_helix_is_a_straight_line_on_the_unrolled_cylinder():
    """Points on the surface, a quarter of a turn and 30 mm apart: the diagonal of 10 pi by 30 mm."""
    p, q = np.array([[20.0], [0.0], [0.0]]), np.array([[0.0], [20.0], [30.0]])
    expected = np.hypot(10.0 * np.pi, 30.0)
    np.testing.assert_allclose(round_length_mm(p, q, SHAFT, RADIUS), expected, atol=ROUNDING)
    np.testing.assert_allclose(round_contact_mm(p, q, SHAFT, RADIUS), expected, atol=ROUNDING)


def test_a_ball_is_an_ellipsoid_of_three_equal_axes():
    p, q = outside(64, 1)
    geodesic = few_runs(path_length_mm)(p, q, np.full((3, 64), RADIUS))
    np.testing.assert_allclose(round_length_mm(p, q, SPHERE, RADIUS), geodesic, atol=1e-6)


def test_a_cylinder_is_a_very_long_ellipsoid():
    """Check semi-axes of 20, 20 and 1000 mm (the search ends at 50 to 1): near the middle thinner by 10 (z / 1000)^2
    mm."""
    p, q = outside(64, 2)
    p[2], q[2] = 0.1 * p[2], 0.1 * q[2]
    geodesic = few_runs(path_length_mm)(p, q, np.array([[20.0], [20.0], [1000.0]]) * np.ones(64))
    np.testing.assert_allclose(round_length_mm(p, q, SHAFT, RADIUS), geodesic, atol=0.01)


@pytest.mark.parametrize("axis", [SPHERE, SHAFT], ids=["sphere", "cylinder"])
def test_slopes_and_bends_are_those_of_the_length(axis):
    p, q = outside(60, 3, 1.05)  # on the surface, the second derivative off it is unbounded

    def length(p):
        return round_length_mm(p, q, axis, RADIUS)

    def slope(p):
        return jax.grad(lambda p: length(p).sum())(p)

    far = np.abs(np.asarray(length(p)) - np.linalg.norm(p - q, axis=0)) > 1e-3  # at lift-off the bend has a step
    assert far.sum() > 10
    h = 1e-3
    for k in range(3):
        step = np.zeros((3, 1))
        step[k] = h
        np.testing.assert_allclose(slope(p)[k], (length(p + step) - length(p - step)) / (2.0 * h), atol=SLOPE)
        bend = jax.jvp(slope, (jnp.asarray(p),), (jnp.broadcast_to(jnp.asarray(step) / h, p.shape),))[1]
        difference = np.asarray((slope(p + step) - slope(p - step)) / (2.0 * h))
        np.testing.assert_allclose(np.asarray(bend)[:, far], difference[:, far], atol=1e-5)


@pytest.mark.parametrize("axis", [SPHERE, SHAFT], ids=["sphere", "cylinder"])
def test_contact_comes_and_goes_continuously(axis):
    height = np.linspace(15.0, 25.0, 401)
    p = np.stack([np.full_like(height, -60.0), height, np.zeros_like(height)])
    q = np.stack([np.full_like(height, 60.0), height, np.full_like(height, 10.0)])
    length, contact = (np.asarray(f(p, q, axis, RADIUS)) for f in (round_length_mm, round_contact_mm))
    assert contact[0] > 0.0
    assert contact[-1] == 0.0
    slope = np.diff(length) / np.diff(height)
    assert np.abs(np.diff(slope)).max() < 0.005


@pytest.mark.parametrize("axis", [SPHERE, SHAFT], ids=["sphere", "cylinder"])
def test_the_points_of_a_path_are_outside_and_as_far_apart_as_it_is_long(axis):
    p, q = outside(50, 4)
    points = np.asarray(round_points_mm(p, q, axis, RADIUS, 300))
    along = np.linalg.norm(np.diff(points, axis=0), axis=1).sum(axis=0)
    np.testing.assert_allclose(along, round_length_mm(p, q, axis, RADIUS), rtol=1e-5)
    across = points - (points * axis).sum(axis=1, keepdims=True) * axis
    assert np.linalg.norm(across, axis=1).min() > RADIUS[0] - 1e-9
    np.testing.assert_allclose(points[0], p, atol=ROUNDING)
    np.testing.assert_allclose(points[-1], q, atol=ROUNDING)


@pytest.mark.parametrize("axis", [SPHERE, SHAFT], ids=["sphere", "cylinder"])
def test_a_path_reads_the_same_from_both_ends_and_in_a_mirror(axis):
    p, q = outside(50, 5)
    length = np.asarray(round_length_mm(p, q, axis, RADIUS))
    np.testing.assert_allclose(round_length_mm(q, p, axis, RADIUS), length, atol=ROUNDING)
    mirror = np.array([[-1.0], [1.0], [1.0]])
    np.testing.assert_allclose(round_length_mm(mirror * p, mirror * q, axis, RADIUS), length, atol=ROUNDING)


def test_a_point_inside_counts_as_its_closest_point_of_the_surface():
    inside, q = np.array([[5.0], [12.0], [3.0]]), np.array([[-50.0], [-10.0], [20.0]])
    np.testing.assert_allclose(round_depth_mm(inside, SHAFT, RADIUS), 7.0, atol=ROUNDING)
    np.testing.assert_allclose(round_depth_mm(q, SHAFT, RADIUS), 0.0)
    moved = inside * np.array([[20.0 / 13.0], [20.0 / 13.0], [1.0]])
    for function in (round_length_mm, round_contact_mm):
        found, expected = (function(x, q, SHAFT, RADIUS) for x in (inside, moved))
        np.testing.assert_allclose(found, expected, atol=ROUNDING)


ARMS_DEG = np.array([[0.0, 0.0, 30.0, 90.0, 0.0], [0.0, 90.0, 60.0, 120.0, 45.0], [0.0, 0.0, -30.0, -90.0, -45.0]])
"""Angles p, e, q: hanging, abduction, in the plane of the scapula, flexion, abduction with outward rotation."""


def arms(name: str):
    """Return the set's lines in these postures of the arm, with the girdle at rest."""
    model = load_model(name)
    lines, count = muscle_lines(model), ARMS_DEG.shape[1]
    angles = np.repeat((REST_DEG / DEG)[:, None], count, axis=1)
    return model, lines, angles, ARMS_DEG / DEG


def problems_on_the_humerus(name: str, turned: np.ndarray) -> tuple[list, list[tuple[int, int]], np.ndarray]:
    """Return problems for OpenSim, the line and posture of each, and our lengths.

    The problems are all lines with a contour on the humerus whose ends lie outside it. ``turned`` is added to the three
    angles of the arm, rad.
    """
    model, lines, angles, humerus = arms(name)
    humerus = humerus + turned
    found = pulls(lines, model.girdle, angles, humerus)
    ends = line_points_mm(lines, model.girdle, angles, 3, humerus)[[0, -1]]
    GH = np.asarray(ends[-1][:, lines.of("deltoid_scapular")][:, 0])  # an end on the humerus, from which GH follows
    R = humerus_rotation(humerus)
    first = int(np.flatnonzero(lines.of("deltoid_scapular"))[0])
    GH = GH - rotate(R, lines.end_mm[:, first, None])
    problems, places = [], []
    for k in np.flatnonzero([contour not in ("", "thorax") for contour in lines.contour]).tolist():
        contour = published_lines()["contour"][lines.contour[k]]
        size = float(lines.humerus_size)
        along_z = to_z(np.array(contour["axis"]))
        for p in np.flatnonzero(found.depth_mm[k] == 0.0).tolist():
            in_humerus = R[:, :, p].T @ (ends[:, :, k, p] - GH[:, p]).T - size * np.array(contour["centre_mm"])[:, None]
            start, end = (along_z @ in_humerus).T / 1000.0
            length = [size * 0.12] if any(contour["axis"]) else []
            problems.append([start.tolist(), end.tolist(), [size * contour["radius_mm"] / 1000.0, *length]])
            places.append((k, p))
    return problems, places, np.array([found.length_mm[place] for place in places])


def opensim_mm(problems: list, folder: Path) -> np.ndarray:
    """Compute OpenSim's lengths."""
    file = folder / "problems.json"
    file.write_text(json.dumps(problems))
    helper = Path(__file__).parents[1] / "helpers" / "wrapped_in_opensim.py"
    done = subprocess.run([sys.executable, str(helper), str(file)], capture_output=True, text=True, check=True)
    return 1000.0 * np.array(json.loads(done.stdout))


without_opensim = pytest.mark.skipif(sys.version_info >= (3, 14), reason="opensim has no wheel for this Python")


@without_opensim
def test_opensim_goes_round_head_and_shaft_as_long(tmp_path: Path):
    """Check every line with a contour on the humerus, for two sets and five postures of the arm.

    OpenSim goes straight from a point inside; one line has such a point: its origin is next to the head.
    """
    parts = [problems_on_the_humerus(name, np.zeros((3, 1))) for name in ("R2", "breteler_dissection")]
    theirs = opensim_mm([problem for problems, _, _ in parts for problem in problems], tmp_path)
    assert len(theirs) > 2 * 5 * 57 - 1
    np.testing.assert_allclose(np.concatenate([ours for _, _, ours in parts]), theirs, atol=OPENSIM_MM)


@without_opensim
def test_arms_about_gh_are_those_of_opensims_paths(tmp_path: Path):
    """Check our arms against -dL/dphi of OpenSim's lengths, with each angle of the arm changed by 0.01 rad either way.

    Only every seventh line and posture is checked: OpenSim takes a tenth of a second for each.
    """
    model, lines, angles, humerus = arms("R2")
    found, h = pulls(lines, model.girdle, angles, humerus), 0.01
    for k in range(3):
        step = h * np.eye(3)[:, [k]]
        (more, places, _), (less, others, _) = (problems_on_the_humerus("R2", sign * step) for sign in (1.0, -1.0))
        assert places == others
        some, count = places[k::7], len(places[k::7])
        lengths = opensim_mm([*more[k::7], *less[k::7]], tmp_path)
        theirs = -(lengths[:count] - lengths[count:]) / (2.0 * h)
        ours = np.einsum("xp,xlp->lp", euler_axis(humerus, k), found.about_gh_mm)
        np.testing.assert_allclose([ours[place] for place in some], theirs, atol=OPENSIM_MM)


def to_z(axis: np.ndarray) -> np.ndarray:
    """Return a rotation of a cylinder's axis to z; for a sphere, whose axis is 0, the identity."""
    if not axis.any():
        return np.eye(3)
    z = axis / np.linalg.norm(axis)
    x = np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


@pytest.mark.parametrize("name", ["R2", "breteler_dissection"])
def test_arms_about_gh_are_slopes_for_small_turns_of_the_humerus(name):
    model, lines, angles, humerus = arms(name)
    found = pulls(lines, model.girdle, angles, humerus)
    h = 1e-6
    for k in range(3):
        step = np.zeros((3, 1))
        step[k] = h
        more, less = (pulls(lines, model.girdle, angles, humerus + sign * step).length_mm for sign in (1.0, -1.0))
        arm = np.einsum("xp,xlp->lp", euler_axis(humerus, k), found.about_gh_mm)
        np.testing.assert_allclose(arm, -(more - less) / (2.0 * h), atol=1e-5)


def euler_axis(humerus: np.ndarray, k: int) -> np.ndarray:
    """Return the axis, thorax frame, of the k-th rotation of R = Ry(p) Rz(e) Ry(q)."""
    p, e, _ = humerus
    zero, one = np.zeros_like(p), np.ones_like(p)
    y = np.stack([zero, one, zero])
    return (y, np.stack([np.sin(p), zero, np.cos(p)]), humerus_rotation(np.stack([p, e, zero]))[:, 1])[k]


def test_lines_of_the_girdle_do_not_know_of_the_arm():
    model, lines, angles, humerus = arms("R4")
    one, other = pulls(lines, model.girdle, angles, humerus), pulls(lines, model.girdle, angles)
    still = lines.end < HUMERUS
    np.testing.assert_array_equal(one.length_mm[still], other.length_mm[still])
    np.testing.assert_array_equal(one.about_gh_mm[:, still], 0.0)
    assert np.abs(one.length_mm - other.length_mm)[~still, 1:].max() > 20.0


def test_small_shapes_share_a_program():
    """Check that a batch of any shape gives the same lengths."""
    p, q = outside(30, 6)
    length = few_runs(partial(round_length_mm, radius_mm=jnp.asarray(20.0)))
    shaped = length(p.reshape(3, 5, 6), q.reshape(3, 5, 6), SHAFT[..., None])
    np.testing.assert_allclose(np.ravel(shaped), round_length_mm(p, q, SHAFT, RADIUS), atol=ROUNDING)
