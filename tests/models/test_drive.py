"""The girdle driven by AC_y, AC_z and TS_x: a case by hand, round trips, coordinates out of reach, derivatives."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import few_runs, one_run

from adapt import fit_postures
from adapt.tables.driven_table import drive_each
from models import load_model
from models.drive import DRIVEN, Driven, drive, free_coordinates_mm
from models.girdle import Girdle, constraint_residuals_mm
from motions import read_motions
from motions.rhythm import REST_DEG
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG, cardan_from_rotation

ROUND_TRIP_DEG = 1e-9
"""Tolerance; measured are 1e-11: rounding of 100s of mm, magnified by the derivatives of the drive."""

CLOSED_MM = 1e-9
"""Constraint tolerance of a driven posture."""

SLOPES = 1e-9
"""Relative tolerance between two ways through the same geometry, whose 6 x 6 matrix costs some digits."""

DIFFERENCES = 1e-6
"""Relative tolerance for central differences over 1e-3 mm: truncation 1e-9, rounding 1e-12 / 1e-3."""


def driven(girdle: Girdle, coordinates_mm, start=REST_DEG / DEG) -> Driven:
    """Drive one posture or several by the program of ``girdle drive``, compiled once for all tests."""
    asked, near = np.asarray(coordinates_mm).reshape(3, -1), np.asarray(start).reshape(6, -1)
    count = asked.shape[1]
    found = drive_each(girdle.repeated(count), asked, np.broadcast_to(near, (6, count)))
    return found if np.ndim(coordinates_mm) > 1 else Driven(found.angles[:, 0], found.status[0])


@pytest.fixture
def at_postures(monkeypatch):
    """Return a way to compile a function that drives; the postures, found by ``driven``, are an argument.

    No derivative goes through the search for the postures, which takes most of the compilation.
    """

    def compiled(function):
        def told(postures: Driven, *x):
            with monkeypatch.context() as patch:
                patch.setattr("models.drive._search", lambda *_: postures)
                return function(*x)

        return few_runs(told)

    return compiled


SETS = ("R2", "R4", "R6", "breteler_dissection", "breteler_mri")


def by_hand() -> Girdle:
    """Build a sphere of radius 50 about (60, 50, 40), SC in the origin, a clavicle of 130, |AC-TS| = 100, |TS-AI| = 60.

    AC_y = 50 and AC_z = 0 give AC_x = 120. TS_x = 60 puts TS on the circle (60, 50 + 80 cos t, 80 sin t), and its
    square distance to the centre is 8000 - 6400 sin t = 69.28^2 at t = 30 and 150 degrees. AI meets |AI - centre|^2 =
    |TS - centre|^2 + 60^2 where TS-AI is perpendicular to TS-centre and to AC-TS.
    """
    return Girdle(
        centre_mm=np.array([60.0, 50.0, 40.0]),
        semi_axes_mm=np.full(3, 50.0),
        sc_mm=np.zeros(3),
        ac_mm=np.array([130.0, 0.0, 0.0]),
        clavicle_conoid_mm=np.array([100.0, 10.0, 0.0]),
        ts_mm=np.array([-100.0, 0.0, 0.0]),
        ai_mm=np.array([-100.0, -60.0, 0.0]),
        scapula_conoid_mm=np.zeros(3),  # set by ``solved_by_hand``
        ts_distance_mm=np.array(np.sqrt(4800.0) - 50.0),
        ai_distance_mm=np.array(np.sqrt(4800.0 + 3600.0) - 50.0),
        conoid_length_mm=np.array(np.sqrt(1200.0)),
    )


COORDINATES_MM = np.array([50.0, 0.0, 60.0])


def solved_by_hand(upper: bool, down: bool) -> tuple[Girdle, np.ndarray]:
    """Return the girdle and its angles, deg, on one of four branches.

    The conoid's attachment on the scapula is 20 mm in front of AC: -200 sin c = (130^2 + 20^2 + 100^2 + 10^2 - 1200) /
    2 - 13000 = 100, so that c = -30 deg.
    """
    girdle = by_hand()
    AC, TS = np.array([120.0, 50.0, 0.0]), np.array([60.0, 50.0 + (80.0 if upper else -80.0) * np.sqrt(0.75), 40.0])
    x = (AC - TS) / 100.0
    square = np.cross(x, TS - girdle.centre_mm)
    y = square / np.linalg.norm(square)
    y = y if (y[1] > 0.0) == down else -y
    R = np.stack([x, y, np.cross(x, y)], axis=1)
    clavicle = [0.0, np.arcsin(50.0 / 130.0) * DEG, -30.0]
    angles = np.array([*clavicle, *np.asarray(cardan_from_rotation(jnp.asarray(R))) * DEG])
    return replace(girdle, scapula_conoid_mm=R.T @ np.array([0.0, 0.0, -20.0])), angles


@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("down", [False, True])
def test_each_branch_of_a_girdle_solved_by_hand_is_found_from_nearby(upper, down):
    girdle, expected_deg = solved_by_hand(upper, down)
    found = driven(girdle, COORDINATES_MM, (expected_deg + np.array([5.0, -4.0, 8.0, 6.0, -7.0, 5.0])) / DEG)
    assert found.words == "ok"
    np.testing.assert_allclose(np.asarray(found.angles) * DEG, expected_deg, rtol=0.0, atol=ROUND_TRIP_DEG)


@pytest.mark.parametrize(
    ("word", "coordinates", "changed"),
    [
        ("unreachable_AC", [131.0, 0.0, 60.0], {}),
        ("unreachable_AC", [100.0, 90.0, 60.0], {}),
        ("unreachable_TS", [50.0, 0.0, 19.0], {}),  # 101 mm medial of AC
        ("unreachable_TS", COORDINATES_MM, {"ts_distance_mm": np.array(39.9 - 50.0)}),  # 8000 - 6400 sin t >= 40^2
        ("unreachable_AI", COORDINATES_MM, {"ai_distance_mm": np.array(200.0)}),
        ("unreachable_conoid", COORDINATES_MM, {"conoid_length_mm": np.array(np.sqrt(999.0))}),  # sin c >= -1
        ("unreachable_conoid", COORDINATES_MM, {"conoid_length_mm": np.array(np.sqrt(1801.0))}),  # sin c <= 1
        ("invalid", [np.nan, 0.0, 60.0], {}),
        ("invalid", COORDINATES_MM, {"conoid_length_mm": np.array(np.nan)}),
        ("unreachable_AI", COORDINATES_MM, {"ts_distance_mm": np.array(40.1 - 50.0)}),  # TS is reached
        ("ok", COORDINATES_MM, {"conoid_length_mm": np.array(np.sqrt(1001.0))}),
        ("ok", COORDINATES_MM, {"conoid_length_mm": np.array(np.sqrt(1799.0))}),
    ],
)
def test_what_cannot_be_reached_is_named_and_has_no_angles(word, coordinates, changed):
    girdle, near_deg = solved_by_hand(upper=True, down=True)
    found = driven(replace(girdle, **changed), np.asarray(coordinates), near_deg / DEG)
    assert found.words == word
    assert np.isfinite(found.angles).all() == (word == "ok")


def closed_postures(name: str) -> tuple[Girdle, np.ndarray]:
    """Return the closed ones of 140 fitted postures of ten simulated subjects, rad."""
    model = load_model(name)
    fitted = fit_postures(read_motions(DATA_FILE), model).by_model[name]
    return model.girdle, fitted.angles[:, fitted.status == "ok"]


@pytest.mark.parametrize("name", SETS)
def test_angles_to_coordinates_to_angles_from_rest(name):
    """Check round trips from rest. With the slack conoid of breteler_mri, another axial rotation of the clavicle is
    nearer to rest in three postures, which start near their own angles."""
    girdle, angles = closed_postures(name)
    assert angles.shape[1] > 130
    coordinates = free_coordinates_mm(girdle, angles)
    found = driven(girdle, coordinates)
    assert set(found.words) == {"ok"}
    same = np.abs(np.asarray(found.angles) - angles).max(axis=0) * DEG <= ROUND_TRIP_DEG
    assert (~same).sum() == (3 if name == "breteler_mri" else 0)
    near = np.asarray(driven(girdle, coordinates, np.where(same, angles, angles + 1.0 / DEG)).angles)
    np.testing.assert_allclose(near * DEG, angles * DEG, rtol=0.0, atol=ROUND_TRIP_DEG)
    back = free_coordinates_mm(girdle, np.asarray(found.angles))
    np.testing.assert_allclose(back, coordinates, rtol=0.0, atol=ROUND_TRIP_DEG)


def test_coordinates_to_angles_to_coordinates_of_coordinates_all_around():
    """Check coordinates all around: reached ones are exact and closed, others, farther out, have no angles."""
    girdle = load_model("R2").girdle
    rest = np.asarray(free_coordinates_mm(girdle, REST_DEG / DEG))[:, None]
    asked = rest + np.random.default_rng(3).uniform(-120.0, 120.0, (3, 400))
    found = driven(girdle, asked)
    good = found.words == "ok"
    assert 40 < good.sum() < 360
    reached = np.asarray(found.angles)[:, good]
    np.testing.assert_allclose(free_coordinates_mm(girdle, reached), asked[:, good], rtol=0.0, atol=CLOSED_MM)
    assert np.abs(constraint_residuals_mm(girdle.over_axes(1), reached)).max() <= CLOSED_MM
    assert np.isnan(np.asarray(found.angles)[:, ~good]).all()
    assert {"unreachable_AC", "unreachable_TS"} <= set(found.words) <= set(DRIVEN)


def test_without_a_start_it_starts_at_rest(monkeypatch):
    starts = []
    monkeypatch.setattr("models.drive._search", lambda girdle, coordinates, start: starts.append(start))
    drive(load_model("R2").girdle, np.zeros((3, 2)))
    np.testing.assert_array_equal(starts[0], np.repeat(REST_DEG[:, None] / DEG, 2, axis=1))


def test_one_posture_without_numbers_leaves_the_others_as_they_are():
    girdle, angles = closed_postures("R2")
    coordinates = np.array(free_coordinates_mm(girdle, angles))
    alone = driven(girdle, coordinates)
    coordinates[1, 3] = np.inf
    found = driven(girdle, coordinates)
    assert found.words[3] == "invalid"
    others = np.arange(coordinates.shape[1]) != 3
    np.testing.assert_allclose(found.angles[:, others], alone.angles[:, others], rtol=0.0, atol=ROUND_TRIP_DEG / DEG)


def test_slopes_are_those_of_the_implicit_equations(at_postures):
    """d angles / d coordinates is the inverse of d (coordinates, g) / d angles, its columns of the coordinates."""
    girdle = load_model("R4").girdle
    _, angles = closed_postures("R4")
    q = jnp.asarray(angles[:, 5])
    coordinates = free_coordinates_mm(girdle, q)

    def equations(angles):
        return jnp.concatenate([free_coordinates_mm(girdle, angles), constraint_residuals_mm(girdle, angles)])

    expected = np.linalg.inv(np.asarray(one_run(jax.jacfwd(equations))(q)))[:, :3]
    both_ways = at_postures(
        lambda at: [way(lambda at: drive(girdle, at).angles)(at) for way in (jax.jacfwd, jax.jacrev)]
    )
    for found in both_ways(driven(girdle, coordinates), coordinates):
        np.testing.assert_allclose(found, expected, rtol=SLOPES, atol=SLOPES * np.abs(expected).max())


def test_slopes_in_the_girdle_and_second_slopes_agree_with_differences(at_postures):
    girdle = load_model("R6").girdle
    _, angles = closed_postures("R6")
    coordinates = free_coordinates_mm(girdle, jnp.asarray(angles[:, 9]))
    theta = jnp.asarray(girdle.adapted_mm)
    h = 1e-3

    def adapted(theta):
        return jax.tree.map(jnp.asarray, girdle).with_adapted(theta)

    def check(function, postures, x):
        steps = h * jnp.eye(len(x))
        slope_and_value = at_postures(jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True))
        near = [[x + sign * step for sign in (1.0, -1.0)] for step in steps]
        beside = [[slope_and_value(postures(one), one)[1] for one in pair] for pair in near]
        expected = jnp.stack([(more - less) / (2.0 * h) for more, less in beside], axis=-1)
        found, _ = slope_and_value(postures(x), x)
        np.testing.assert_allclose(found, expected, rtol=DIFFERENCES, atol=DIFFERENCES * np.abs(expected).max())

    check(
        lambda theta: drive(adapted(theta), coordinates).angles,
        lambda theta: driven(adapted(theta), coordinates),
        theta,
    )
    check(jax.jacrev(lambda at: drive(girdle, at).angles), lambda at: driven(girdle, at), coordinates)


def test_a_posture_out_of_reach_leaves_the_slopes_in_a_shared_girdle_as_they_are(at_postures):
    girdle = load_model("R2").girdle
    _, angles = closed_postures("R2")
    coordinates = free_coordinates_mm(girdle, angles[:, :3])
    far = coordinates.at[0, 1].add(500.0)
    middle = coordinates[:, [1, 1, 1]]
    assert driven(girdle, far).words.tolist() == ["ok", "unreachable_AC", "ok"]

    def total(theta, at):
        found = drive(jax.tree.map(jnp.asarray, girdle).with_adapted(theta), at)
        return jnp.sum(jnp.where(found.status == 0, found.angles, 0.0))

    compiled = at_postures(jax.grad(total))

    def slope(at):
        return compiled(driven(girdle, at), jnp.asarray(girdle.adapted_mm), at)

    found, expected = slope(far), slope(coordinates) - slope(middle) / 3.0
    assert np.abs(expected).max() > 0.0
    np.testing.assert_allclose(found, expected, rtol=SLOPES)


def test_degrees_are_refused():
    girdle, angles_deg = load_model("R2").girdle, np.asarray(REST_DEG)
    with pytest.raises(ValueError, match="in radians"):
        free_coordinates_mm(girdle, angles_deg)
    with pytest.raises(ValueError, match="in radians"):
        drive(girdle, np.zeros(3), start=angles_deg)
