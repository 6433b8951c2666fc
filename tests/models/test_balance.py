"""The moment balance: conditions of optimality, a case by hand, another solver, and problems without a solution."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from programs import few_runs, one_run
from scipy.optimize import linprog, minimize

from models import load_model
from models.drive import drive, free_coordinates_mm
from models.girdle import constraint_residuals_mm, landmarks
from models.muscles.arm_load import arm_load
from models.muscles.balance import (
    BEYOND_RIM,
    BEYOND_STRENGTH,
    INVALID,
    NO_SOLUTION,
    OK,
    balance,
    least_stress,
    load_moments,
    upper_arm_mm,
)
from models.muscles.contact import contact_forces
from models.muscles.glenoid import CORNERS, glenoid_axes, half_angles, off_centre, rim_sides
from models.muscles.muscle_lines import HUMERUS, SCAPULA, muscle_lines, published_lines
from models.muscles.pulls import arms_by_angle_mm, line_points_mm, pulls
from motions.landmarks.frames import humerus_rotation
from motions.rhythm import REST_DEG
from motions.rotations import DEG, rotate, rotation_from_cardan

LOAD = arm_load(75.0)

WEIGHT_N = LOAD.weight_N.sum()

MIRRORED = ("centre_mm", "sc_mm", "ac_mm", "clavicle_conoid_mm", "scapula_conoid_mm", "ts_mm", "ai_mm")
"""Points of a girdle; its other numbers are lengths."""

OPTIMAL = 1e-9
"""Tolerance for shares: moments are of order 1e4 Nmm, shares of 0.1, and the solver works to rounding."""


@pytest.fixture(scope="module")
def solved():
    model = load_model("R4")
    rest = np.asarray(free_coordinates_mm(model.girdle, REST_DEG / DEG))
    offsets = np.array(
        [[0.0, 6.0, -5.0, 3.0, 8.0, 15.0], [0.0, -4.0, 3.0, 6.0, -7.0, 5.0], [0.0, 3.0, -2.0, 4.0, 2.0, 1.0]]
    )
    driven = one_run(drive)(model.girdle, rest[:, None] + offsets)
    q = np.asarray(driven.angles)[:, driven.words == "ok"]
    girdle, lines, arm = model.girdle.repeated(q.shape[1]), muscle_lines(model), held(q.shape[1])
    found, contact = pulls(lines, girdle, q, arm), contact_forces(girdle, q)
    return lines, girdle, q, arm, found, contact, balance(lines, found, contact, girdle, q, arm, LOAD)


def held(count: int) -> np.ndarray:
    """Return angles p, e, q of arms in the plane of the scapula, with rising elevation."""
    elevation = np.linspace(0.0, 60.0, count)
    return np.stack([np.full(count, 30.0), elevation, np.full(count, -30.0)]) / DEG


def moments(lines, girdle, q, arm, found, contact):
    """Compute A, C, w, K and k anew: moments of the arm about GH, of scapula and arm about AC, of all about SC."""
    A = np.concatenate([found.about_gh_mm, found.about_ac_mm, found.about_sc_mm])
    A = A * lines.strongest_force_N[None, :, None]
    C = np.concatenate([np.zeros_like(contact.about_ac_mm), contact.about_ac_mm, contact.about_sc_mm])
    at = landmarks(girdle, q)
    R_scapula = rotation_from_cardan(q[3:])
    GH = at.AC + rotate(R_scapula, lines.gh_mm[:, None])
    w = np.zeros((9, q.shape[1]))
    for weight, distance in zip(LOAD.weight_N, LOAD.distance, strict=True):
        centre = GH - distance * upper_arm_mm() * lines.humerus_size * humerus_rotation(arm)[:, 1]
        down = np.array([0.0, -weight, 0.0])
        for k, joint in enumerate((GH, at.AC, girdle.sc_mm)):
            w[3 * k : 3 * k + 3] += np.cross(centre - joint, down, axisa=0, axisb=0, axisc=0)
    sides = rim_sides(glenoid_axes(published_lines()), half_angles(published_lines()), R_scapula)
    on_humerus = found.pull * (lines.strongest_force_N * (lines.end == HUMERUS))[None, :, None]
    K = np.einsum("kxp,xlp->klp", sides, on_humerus)
    return A, C, w, K, -WEIGHT_N * sides[:, 1]


def test_moments_are_balanced_and_the_conditions_of_optimality_hold(solved):
    lines, girdle, q, arm, found, contact, forces = solved
    A, C, w, K, k = moments(lines, girdle, q, arm, found, contact)
    assert (forces.status == OK).all()
    assert (forces.share >= 0.0).all()
    assert (forces.contact_N >= 0.0).all()
    for p in range(q.shape[1]):
        x, c, y, v = forces.share[:, p], forces.contact_N[:, p], forces.multipliers[:, p], forces.rim_multipliers[:, p]
        np.testing.assert_allclose(A[..., p] @ x + C[..., p] @ c + w[:, p], 0.0, atol=1e4 * OPTIMAL)
        np.testing.assert_allclose(x, np.maximum(A[..., p].T @ y + K[..., p].T @ v, 0.0), atol=OPTIMAL)
        assert (C[..., p].T @ y).max() < OPTIMAL
        np.testing.assert_allclose(c * (C[..., p].T @ y), 0.0, atol=OPTIMAL)
        room = K[..., p] @ x + k[:, p]
        assert room.min() > -1e3 * OPTIMAL
        assert v.min() > -OPTIMAL
        np.testing.assert_allclose(v * room, 0.0, atol=1e3 * OPTIMAL)


def test_the_force_in_gh_is_within_the_rim_and_on_it_where_the_rim_holds_it(solved):
    *_, forces = solved
    holds = forces.rim_multipliers.max(axis=0) > OPTIMAL
    np.testing.assert_allclose(forces.off_centre[holds], 1.0, atol=0.006)  # a side is up to 0.5 % inside the ellipse
    assert ((forces.off_centre >= 0.0) & (forces.off_centre < 1.0 + 1e-9)).all()


def test_the_force_in_gh_is_what_muscles_and_weights_leave(solved):
    """Check GH's force by adding up the forces on the humerus along the other ends of the lines."""
    lines, girdle, q, arm, _, _, forces = solved
    points = line_points_mm(lines, girdle, q, 201, arm)
    first = points[1] - points[0]
    first = np.where(np.linalg.norm(first, axis=0) > 0.0, first, points[2] - points[1])  # some lines begin on a contour
    first /= np.linalg.norm(first, axis=0)
    reaching = lines.end == HUMERUS
    pressed = -np.einsum("xlp,lp->xp", first[:, reaching], forces.force_N[reaching])
    pressed[1] -= WEIGHT_N
    np.testing.assert_allclose(pressed, forces.gh_N, atol=0.01 * np.linalg.norm(forces.gh_N, axis=0).max())


def test_the_rim_is_the_published_ellipse():
    """Check that a force toward a corner is on the rim; the frame is right-handed, with x from GH into the glenoid."""
    document, upright = published_lines(), np.eye(3)[..., None]
    axes, angles = glenoid_axes(document), half_angles(document)
    np.testing.assert_allclose(np.degrees(angles), [44.37, 38.55])
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert axes[0, 0] < -0.7  # into the glenoid is medial
    assert axes[1, 1] > 0.8  # up
    assert axes[2, 2] < -0.5  # forward
    sides = rim_sides(axes, angles, upright)[..., 0]
    corner = (np.arange(CORNERS) + 0.5) * 2.0 * np.pi / CORNERS
    forces = axes @ np.stack([np.ones(CORNERS), np.cos(corner) * np.tan(angles[0]), np.sin(corner) * np.tan(angles[1])])
    room = sides @ forces
    np.testing.assert_allclose(room.min(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(off_centre(axes, angles, upright, forces), 1.0, atol=1e-12)
    assert (sides @ axes[:, 0] > 0.9).all()
    assert (sides @ -axes[:, 0] < 0.0).all()  # a pull is beyond the rim


def test_a_load_in_the_hand_is_held_where_the_hand_is(solved):
    """Horizontal arm, 75 kg: about GH 20.6 N at 0.436 and 16.2 N at 1.535 upper arms, and 2 kg at 2.079."""
    lines, girdle, q, *_ = solved
    out = np.array([[0.0], [90.0], [0.0]]) / DEG * np.ones(q.shape[1])
    upper = upper_arm_mm() * float(lines.humerus_size)
    assert upper_arm_mm() == pytest.approx(288.2, abs=0.1)
    without, with_load = (load_moments(lines, girdle, q, out, arm_load(75.0, kg)) for kg in (0.0, 2.0))
    np.testing.assert_allclose(without[2] / upper, -(20.60 * 0.436 + 16.19 * 1.5353), atol=0.02)
    np.testing.assert_allclose((with_load - without)[2] / upper, -19.62 * 2.0788, atol=0.02)
    np.testing.assert_allclose(without[:2], 0.0, atol=1e-6)


def test_another_solver_finds_no_less_stress(solved):
    """Check against SciPy's SLSQP on the same problem, started at 0.1 for all shares and contact forces (N)."""
    lines, girdle, q, arm, found, contact, forces = solved
    A, C, w, K, k = (part[..., 0] for part in moments(lines, girdle, q, arm, found, contact))
    n = A.shape[1]
    size = 1e4
    result = minimize(
        lambda u: (u[:n] @ u[:n], np.concatenate([2.0 * u[:n], np.zeros(3)])),
        np.full(n + 3, 0.1),
        jac=True,
        method="SLSQP",
        bounds=[(0.0, None)] * (n + 3),
        constraints=[
            {
                "type": "eq",
                "fun": lambda u: (A @ u[:n] + C @ u[n:] + w) / size,
                "jac": lambda u: np.hstack([A, C]) / size,
            },
            {
                "type": "ineq",
                "fun": lambda u: (K @ u[:n] + k) / 100.0,
                "jac": lambda u: np.hstack([K, np.zeros((len(k), 3))]) / 100.0,
            },
        ],
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert result.success
    np.testing.assert_allclose(result.x[:n], forces.share[:, 0], atol=1e-5)
    np.testing.assert_allclose(result.x[n:], forces.contact_N[:, 0], atol=1e-2)


def test_many_random_problems_are_solved_or_proved_to_have_no_solution():
    """Check solvability against linear programming (HiGHS), and the conditions of optimality of solutions."""
    generator = np.random.default_rng(3)
    solved = 0
    for _ in range(300):
        A, C, w = (
            generator.standard_normal((6, 8)),
            generator.standard_normal((6, 3)),
            0.1 * generator.standard_normal(6),
        )
        K, k = generator.standard_normal((2, 8)), 0.1 * generator.standard_normal(2)
        x, c, y, v, status = least_stress(A, C, w, K, k)
        feasible, without = (
            linprog(
                np.zeros(11),
                A_eq=np.hstack([A, C]),
                b_eq=-w,
                A_ub=-np.hstack([K, np.zeros((2, 3))]) * limited,
                b_ub=k * limited,
                bounds=(0.0, None),
                method="highs",
            ).status
            == 0
            for limited in (1.0, 0.0)
        )
        assert (status in (OK, BEYOND_STRENGTH)) == feasible
        assert (status == BEYOND_RIM) == (without and not feasible)
        if feasible:
            solved += 1
            scale = max(x.max(), 1.0)
            np.testing.assert_allclose(A @ x + C @ c + w, 0.0, atol=1e-8 * scale)
            np.testing.assert_allclose(x, np.maximum(A.T @ y + K.T @ v, 0.0), atol=1e-7 * scale)
            assert (K @ x + k).min() > -1e-7 * scale
            assert (C.T @ y).max() < 1e-7 * scale
    assert 20 < solved < 250


def test_contact_forces_are_the_multipliers_of_the_constraints(solved):
    """Check by virtual work in the six angles, with a constant orientation of the arm.

    The multipliers of A1-A3 are the forces of TS and AI, and minus the conoid's force.
    """
    lines, girdle, q, arm, found, _, forces = solved
    by_angle = arms_by_angle_mm(lines, found, girdle, q, arm)
    by_q = few_runs(jax.jacfwd(lambda q: constraint_residuals_mm(girdle, q).sum(axis=-1)))
    slopes = np.moveaxis(np.asarray(by_q(q)), -1, 0)

    def height(q):
        return (landmarks(girdle, q).AC + rotate(rotation_from_cardan(q[3:]), lines.gh_mm[:, None]))[1].sum()

    falling = -WEIGHT_N * np.asarray(few_runs(jax.grad(height))(q))
    for p in range(q.shape[1]):
        generalised = by_angle[..., p] @ forces.force_N[:, p] + falling[:, p]
        multipliers, left, *_ = np.linalg.lstsq(-slopes[p].T, generalised, rcond=None)
        assert left.size == 0 or left[0] < 1e-6
        np.testing.assert_allclose(multipliers * [1.0, 1.0, -1.0], forces.contact_N[:, p], atol=1e-6)


def test_a_left_girdle_has_the_mirrored_arms(solved):
    """Check points mirrored in x = 0 and angles Y and Z reversed: moments, which are axial vectors, keep x and reverse
    y and z.

    The check is of the girdle alone: contours of humerus and glenoid are those of a right shoulder.
    """
    lines, girdle, q, _, found, contact, _ = solved
    mirror = np.array([-1.0, 1.0, 1.0])
    moment = -mirror[:, None, None]

    def left(points):
        return points * mirror.reshape(3, *[1] * (points.ndim - 1))

    points = {name: left(getattr(girdle, name)) for name in MIRRORED}
    left_girdle = replace(girdle, **points)
    left_lines = replace(lines, **{name: left(getattr(lines, name)) for name in ("start_mm", "end_mm", "gh_mm")})
    left_q = q * np.array([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])[:, None]
    left_found, left_contact = pulls(left_lines, left_girdle, left_q), contact_forces(left_girdle, left_q)
    of_girdle = lines.end <= SCAPULA
    np.testing.assert_allclose(left_found.length_mm[of_girdle], found.length_mm[of_girdle], atol=1e-8)
    for name in ("about_sc_mm", "about_ac_mm"):
        own, mirrored = (getattr(one, name)[:, of_girdle] for one in (found, left_found))
        np.testing.assert_allclose(mirrored, moment * own, atol=1e-6)
        np.testing.assert_allclose(getattr(left_contact, name), moment * getattr(contact, name), atol=1e-8)


NO_RIM = np.zeros((0, 2)), np.zeros(0)


def test_two_muscles_share_a_moment_by_their_arms():
    """min x1^2 + x2^2 with 3 x1 + 4 x2 = 50: x = 50 (3, 4) / 25. The contact forces carry the other moments."""
    A, w = np.zeros((6, 2)), np.zeros(6)
    C = np.vstack([np.zeros((3, 3)), np.eye(3)])
    A[0], w[0] = [3.0, 4.0], -50.0
    w[3:] = [-1.0, -2.0, 0.0]
    x, c, y, _, status = least_stress(A, C, w, *NO_RIM)
    assert status == BEYOND_STRENGTH
    assert least_stress(A, C, w / 10.0, *NO_RIM)[-1] == OK
    np.testing.assert_allclose(x, [6.0, 8.0], atol=1e-9)
    np.testing.assert_allclose(c, [1.0, 2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(y[0], 2.0, atol=1e-9)


def test_an_antagonist_stays_slack_unless_contact_needs_it():
    """Check that an antagonist is slack; where a contact would have to pull, a muscle must press it on."""
    A = np.zeros((6, 2))
    A[0] = [1.0, -1.0]
    C = np.vstack([np.zeros((3, 3)), np.eye(3)])
    x, c, _, _, status = least_stress(A, C, np.array([-5.0, 0, 0, 0, 0, 0]), *NO_RIM)
    assert status == BEYOND_STRENGTH
    np.testing.assert_allclose(x, [5.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(c, 0.0, atol=1e-9)
    A[3] = [-1.0, -1.0]  # both press the first contact
    x, c, _, _, status = least_stress(A, C, np.array([-5.0, 0, 0, 9.0, 0, 0]), *NO_RIM)
    assert status == BEYOND_STRENGTH
    np.testing.assert_allclose(x, [7.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(c, [0.0, 0.0, 0.0], atol=1e-9)


def test_a_rim_makes_a_second_muscle_press():
    """min x1^2 + x2^2 with 2 x1 = 4, where x1 pulls beyond the rim and x2 compensates: x2 >= x1 / 2."""
    A, C = np.zeros((6, 2)), np.vstack([np.zeros((3, 3)), np.eye(3)])
    A[0] = [2.0, 0.0]
    w, K = np.array([-4.0, 0, 0, 0, 0, 0]), np.array([[-0.5, 1.0]])
    x, _, y, v, status = least_stress(A / 10.0, C, w / 100.0, K, np.zeros(1))
    assert status == OK
    np.testing.assert_allclose(x, [0.2, 0.1], atol=1e-9)
    np.testing.assert_allclose(v, [0.1], atol=1e-9)
    np.testing.assert_allclose(0.2 * y[0] - 0.5 * v[0], x[0], atol=1e-9)
    K[0, 1] = 0.0
    assert least_stress(A, C, w, K, np.zeros(1))[-1] == BEYOND_RIM


def test_what_cannot_be_balanced_is_named():
    A, rim = np.zeros((6, 1)), (np.zeros((0, 1)), np.zeros(0))
    A[0] = 1.0
    C = np.vstack([np.zeros((3, 3)), np.eye(3)])

    def status(*w):
        return least_stress(A, C, np.array([*w, 0.0, 0.0]), *rim)[-1]

    assert status(1.0, 0.0, 0.0, 0.0) == NO_SOLUTION  # the muscle would have to push
    assert status(-1.0, 0.0, 0.0, 1.0) == NO_SOLUTION  # a contact would have to pull
    assert status(-1.0, 1.0, 0.0, 0.0) == NO_SOLUTION  # no force acts about that axis
    assert status(np.nan, 0.0, 0.0, 0.0) == INVALID


def test_an_arm_whose_elevation_is_not_known_is_invalid_alone(solved):
    lines, girdle, q, arm, *_, contact, forces = solved
    arm = arm.copy()
    arm[1, 1] = np.nan
    found = balance(lines, pulls(lines, girdle, q, arm), contact, girdle, q, arm, LOAD)
    assert found.status[1] == INVALID
    np.testing.assert_allclose(np.delete(found.force_N, 1, axis=1), np.delete(forces.force_N, 1, axis=1), atol=1e-6)


def test_no_weight_needs_no_force_and_twice_the_weight_twice_the_force(solved):
    lines, girdle, q, arm, found, contact, forces = solved
    none = balance(lines, found, contact, girdle, q, arm, LOAD._replace(weight_N=np.zeros(3)))
    np.testing.assert_allclose(none.force_N, 0.0, atol=1e-9)
    twice = balance(lines, found, contact, girdle, q, arm, LOAD._replace(weight_N=2.0 * LOAD.weight_N))
    np.testing.assert_allclose(twice.force_N, 2.0 * forces.force_N, atol=1e-6)
    assert arm_load(80.0).weight_N.sum() == pytest.approx(0.05 * 80.0 * 9.81)
