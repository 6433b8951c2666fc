"""The moment balance: its conditions of optimality, a case by hand, another solver, and what has no solution."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from programs import few_runs, one_run
from scipy.optimize import linprog, minimize

from models import load_model
from models.drive import drive, free_coordinates_mm
from models.girdle import constraint_residuals_mm, landmarks
from models.muscles.balance import BEYOND_STRENGTH, INVALID, NO_SOLUTION, OK, arm_weight_N, balance, least_stress
from models.muscles.contact import contact_forces
from models.muscles.muscle_lines import muscle_lines
from models.muscles.pulls import arms_by_angle_mm, pulls
from motions.rhythm import REST_DEG
from motions.rotations import DEG, rotate, rotation_from_cardan

WEIGHT_N = arm_weight_N(75.0)

MIRRORED = ("centre_mm", "sc_mm", "ac_mm", "clavicle_conoid_mm", "scapula_conoid_mm", "ts_mm", "ai_mm")
"""Points of a girdle; its other numbers are lengths."""

OPTIMAL = 1e-9
"""Moments are of order 1e4 Nmm, shares of 0.1; the solver works to rounding."""


@pytest.fixture(scope="module")
def solved():
    model = load_model("R4")
    rest = np.asarray(free_coordinates_mm(model.girdle, REST_DEG / DEG))
    offsets = np.array(
        [[0.0, 6.0, -5.0, 3.0, 8.0, 15.0], [0.0, -4.0, 3.0, 6.0, -7.0, 5.0], [0.0, 3.0, -2.0, 4.0, 2.0, 1.0]]
    )
    driven = one_run(drive)(model.girdle, rest[:, None] + offsets)
    q = np.asarray(driven.angles)[:, driven.words == "ok"]
    girdle, lines = model.girdle.repeated(q.shape[1]), muscle_lines(model)
    found, contact = pulls(lines, girdle, q), contact_forces(girdle, q)
    return lines, girdle, q, found, contact, balance(lines, found, contact, girdle, q, WEIGHT_N)


def moments(lines, girdle, q, found, contact):
    """A, C and w written again, by hand: of the scapula about AC, of both bones about SC."""
    A = np.concatenate([found.about_ac_mm, found.about_sc_mm]) * lines.strongest_force_N[None, :, None]
    C = np.concatenate([contact.about_ac_mm, contact.about_sc_mm])
    at = landmarks(girdle, q)
    GH = at.AC + rotate(rotation_from_cardan(q[3:]), lines.gh_mm[:, None])
    down = np.array([0.0, -WEIGHT_N, 0.0])
    w = [
        np.concatenate([np.cross(GH[:, p] - at.AC[:, p], down), np.cross(GH[:, p] - girdle.sc_mm[:, p], down)])
        for p in range(q.shape[1])
    ]
    return A, C, np.array(w).T


def test_moments_are_balanced_and_the_conditions_of_optimality_hold(solved):
    lines, girdle, q, found, contact, forces = solved
    A, C, w = moments(lines, girdle, q, found, contact)
    assert (forces.status == OK).all()
    assert (forces.share >= 0.0).all()
    assert (forces.contact_N >= 0.0).all()
    for p in range(q.shape[1]):
        x, c, y = forces.share[:, p], forces.contact_N[:, p], forces.multipliers[:, p]
        np.testing.assert_allclose(A[..., p] @ x + C[..., p] @ c + w[:, p], 0.0, atol=1e4 * OPTIMAL)
        np.testing.assert_allclose(x, np.maximum(A[..., p].T @ y, 0.0), atol=OPTIMAL)
        assert (C[..., p].T @ y).max() < OPTIMAL
        np.testing.assert_allclose(c * (C[..., p].T @ y), 0.0, atol=OPTIMAL)


def test_another_solver_finds_no_less_stress(solved):
    """SciPy's SLSQP on the same problem, from the same shares for all and from the solution's contact forces."""
    lines, girdle, q, found, contact, forces = solved
    A, C, w = (part[..., 0] for part in moments(lines, girdle, q, found, contact))
    n = A.shape[1]
    size = 1e4
    result = minimize(
        lambda u: (u[:n] @ u[:n], np.concatenate([2.0 * u[:n], np.zeros(3)])),
        np.full(n + 3, 0.1),
        jac=True,
        method="SLSQP",
        bounds=[(0.0, None)] * (n + 3),
        constraints={
            "type": "eq",
            "fun": lambda u: (A @ u[:n] + C @ u[n:] + w) / size,
            "jac": lambda u: np.hstack([A, C]) / size,
        },
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert result.success
    np.testing.assert_allclose(result.x[:n], forces.share[:, 0], atol=1e-5)
    np.testing.assert_allclose(result.x[n:], forces.contact_N[:, 0], atol=1e-2)


def test_many_random_problems_are_solved_or_proved_to_have_no_solution():
    """Whether there is a solution, as linear programming says (HiGHS); and the conditions of optimality if there is."""
    generator = np.random.default_rng(3)
    solved = 0
    for _ in range(300):
        A, C, w = (
            generator.standard_normal((6, 8)),
            generator.standard_normal((6, 3)),
            0.1 * generator.standard_normal(6),
        )
        x, c, y, status = least_stress(A, C, w)
        feasible = (
            linprog(np.zeros(11), A_eq=np.hstack([A, C]), b_eq=-w, bounds=(0.0, None), method="highs").status == 0
        )
        assert (status in (OK, BEYOND_STRENGTH)) == feasible
        if feasible:
            solved += 1
            scale = max(x.max(), 1.0)
            np.testing.assert_allclose(A @ x + C @ c + w, 0.0, atol=1e-8 * scale)
            np.testing.assert_allclose(x, np.maximum(A.T @ y, 0.0), atol=1e-7 * scale)
            assert (C.T @ y).max() < 1e-7 * scale
    assert 50 < solved < 250


def test_contact_forces_are_the_multipliers_of_the_constraints(solved):
    """Virtual work in the six angles: the multipliers of A1-A3 are the forces of TS and AI, and minus the conoid's."""
    lines, girdle, q, found, _, forces = solved
    by_angle = arms_by_angle_mm(lines, found, girdle, q)
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


def test_a_left_girdle_has_the_mirrored_arms_and_the_same_forces(solved):
    """Points mirrored in x = 0, angles Y and Z reversed: moments, which are axial vectors, keep x and turn y and z."""
    lines, girdle, q, found, contact, forces = solved
    mirror = np.array([-1.0, 1.0, 1.0])
    moment = -mirror[:, None, None]

    def left(points):
        return points * mirror.reshape(3, *[1] * (points.ndim - 1))

    points = {name: left(getattr(girdle, name)) for name in MIRRORED}
    left_girdle = replace(girdle, **points)
    left_lines = replace(lines, **{name: left(getattr(lines, name)) for name in ("thorax_mm", "bone_mm", "gh_mm")})
    left_q = q * np.array([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])[:, None]
    left_found, left_contact = pulls(left_lines, left_girdle, left_q), contact_forces(left_girdle, left_q)
    np.testing.assert_allclose(left_found.length_mm, found.length_mm, atol=1e-8)
    for name in ("about_sc_mm", "about_ac_mm"):
        np.testing.assert_allclose(getattr(left_found, name), moment * getattr(found, name), atol=1e-6)
        np.testing.assert_allclose(getattr(left_contact, name), moment * getattr(contact, name), atol=1e-8)
    left_forces = balance(left_lines, left_found, left_contact, left_girdle, left_q, WEIGHT_N)
    np.testing.assert_allclose(left_forces.force_N, forces.force_N, atol=1e-6)
    np.testing.assert_allclose(left_forces.contact_N, forces.contact_N, atol=1e-6)


def test_two_muscles_share_a_moment_by_their_arms():
    """min x1^2 + x2^2 with 3 x1 + 4 x2 = 50: x = 50 (3, 4) / 25. The contact forces carry the other moments."""
    A, w = np.zeros((6, 2)), np.zeros(6)
    C = np.vstack([np.zeros((3, 3)), np.eye(3)])
    A[0], w[0] = [3.0, 4.0], -50.0
    w[3:] = [-1.0, -2.0, 0.0]
    x, c, y, status = least_stress(A, C, w)
    assert status == BEYOND_STRENGTH
    assert least_stress(A, C, w / 10.0)[3] == OK
    np.testing.assert_allclose(x, [6.0, 8.0], atol=1e-9)
    np.testing.assert_allclose(c, [1.0, 2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(y[0], 2.0, atol=1e-9)


def test_an_antagonist_stays_slack_unless_contact_needs_it():
    """A muscle of the wrong sign is at rest; where a contact force would have to pull, a muscle has to press it on."""
    A = np.zeros((6, 2))
    A[0] = [1.0, -1.0]
    C = np.vstack([np.zeros((3, 3)), np.eye(3)])
    x, c, _, status = least_stress(A, C, np.array([-5.0, 0, 0, 0, 0, 0]))
    assert status == BEYOND_STRENGTH
    np.testing.assert_allclose(x, [5.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(c, 0.0, atol=1e-9)
    A[3] = [-1.0, -1.0]  # both press the first contact
    x, c, _, status = least_stress(A, C, np.array([-5.0, 0, 0, 9.0, 0, 0]))
    assert status == BEYOND_STRENGTH
    np.testing.assert_allclose(x, [7.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(c, [0.0, 0.0, 0.0], atol=1e-9)


def test_what_cannot_be_balanced_is_named():
    A = np.zeros((6, 1))
    A[0] = 1.0
    C = np.vstack([np.zeros((3, 3)), np.eye(3)])
    assert least_stress(A, C, np.array([1.0, 0, 0, 0, 0, 0]))[3] == NO_SOLUTION  # the muscle would have to push
    assert least_stress(A, C, np.array([-1.0, 0, 0, 1.0, 0, 0]))[3] == NO_SOLUTION  # a contact would have to pull
    assert least_stress(A, C, np.array([-1.0, 1.0, 0, 0, 0, 0]))[3] == NO_SOLUTION  # nothing turns that way
    assert least_stress(A, C, np.array([np.nan, 0, 0, 0, 0, 0]))[3] == INVALID


def test_no_weight_needs_no_force_and_twice_the_weight_twice_the_force(solved):
    lines, girdle, q, found, contact, forces = solved
    none = balance(lines, found, contact, girdle, q, 0.0)
    np.testing.assert_allclose(none.force_N, 0.0, atol=1e-9)
    twice = balance(lines, found, contact, girdle, q, 2.0 * WEIGHT_N)
    np.testing.assert_allclose(twice.force_N, 2.0 * forces.force_N, atol=1e-6)
    assert arm_weight_N(80.0) == pytest.approx(0.05 * 80.0 * 9.81)
