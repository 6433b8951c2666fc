"""The parts of the fast path with effects: D on the engine, and the curvature that is learnt from the steps."""

from dataclasses import replace

import numpy as np
import pytest
from adapt.solvers.reference.posture import mean_square_deg2, objective_weights

from adapt.engine.batching import take_problems
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.objective import WEIGHT, ThoraxPoints
from adapt.solvers.rows import posture_rows
from adapt.solvers.posture_fits import at_rest_where_unknown, reference_fit
from adapt.solvers.problems import problems_of, sets_of, subject_problem
from adapt.solvers.projection import thorax_term
from adapt.solvers.projection.postures import fit_by_newton, fit_extended
from adapt.solvers.projection.secant import secant
from adapt.solvers.projection.subjects import solve_extended
from adapt.solvers.projection.thorax_term import Thorax
from models import load_model
from models.adapted_parameters import ADAPTED
from models.effects.amplitudes import active_effects
from models.parameter_sets import shortest_conoid_mm
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE
from motions.table import ANGLES

OFF_DEG = 20.0
"""Noise of postures that no chain is near: projections leave some 2 % of them."""

SAME_RAD = 1e-10
"""Of an optimum from two solvers: their tolerances of the slope, over the curvature."""

MOST = 0.95
"""Of postures; projections leave the others to Newton steps."""

SAME_MM = 1e-5
"""Of optima that two paths find to a slope of 1e-8 mm^2 a mm, where E bends by 1e-3 or more."""

SAME_DEG2 = 1e-6
"""Of J there, up to 100."""

CONOID = ADAPTED.index("conoid_length")

SAME = 1e-9
"""mm^2 a mm, of numbers up to 100: rounding of two texts."""


@pytest.fixture(scope="module")
def thorax() -> tuple[Thorax, np.ndarray]:
    """The points of R2 off nine ellipsoids, at levels off their surface."""
    sets = sets_of([load_model("R2")], [f"s{number}" for number in range(9)])
    generator = np.random.default_rng(2)
    theta = np.asarray(sets.girdle.adapted_mm) + 8.0 * generator.standard_normal((len(ADAPTED), 9))
    levels = 5.0 * generator.standard_normal(sets.point_weights.shape)
    return Thorax(sets.girdle, sets.points_mm, sets.point_weights, levels), theta


def test_d_of_parts_is_that_of_the_objective(thorax):
    points, theta = thorax
    found, by_hand = points(theta.T), ThoraxPoints(*points)
    np.testing.assert_allclose(found.D, by_hand.value(theta), rtol=1e-12)
    np.testing.assert_allclose(found.gradient.T, by_hand.slope(theta), atol=SAME)


def test_its_matrix_is_the_curvature_of_d_where_the_points_lie_on_their_levels(thorax):
    points, theta = thorax
    at, _ = ThoraxPoints(*points).distances(theta)
    on_level = points._replace(levels_mm=points.levels_mm + at.d)
    found = on_level(theta.T)
    np.testing.assert_allclose(found.D, 0.0, atol=SAME)
    np.testing.assert_allclose(np.moveaxis(found.matrix, 0, -1), ThoraxPoints(*on_level).curvature(theta), atol=SAME)


def test_machine_code_and_xla_give_the_same_d(thorax):
    points, theta = thorax
    one, other = (run(*points, theta) for run in (thorax_term._kernel.by_machine, thorax_term._kernel.by_jax))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, atol=SAME)


def matrices(count: int, seed: int) -> np.ndarray:
    """Positive ones, 3 by 3."""
    root = np.random.default_rng(seed).standard_normal((count, 5, 3))
    return np.swapaxes(root, 1, 2) @ root


def test_the_learnt_curvature_explains_the_last_change_of_the_gradient():
    H, M, S = matrices(4, 0), 0.5 * matrices(4, 1), 0.3 * matrices(4, 2)
    step = np.random.default_rng(3).standard_normal((4, 3))
    change = (H @ step[..., None])[..., 0]
    found = secant(S, M, step, change)
    np.testing.assert_allclose(((M + found) @ step[..., None])[..., 0], change, atol=1e-12)
    np.testing.assert_allclose(found, np.swapaxes(found, 1, 2), atol=1e-12)


def test_in_one_dimension_it_is_what_gauss_newton_leaves_out():
    one = np.ones((1, 1, 1))
    assert secant(0.0 * one, 2.0 * one, np.array([[0.1]]), np.array([[0.5]])) == pytest.approx(3.0)


def test_where_gauss_newton_leaves_nothing_out_it_is_forgotten():
    M, step = matrices(2, 5), np.random.default_rng(6).standard_normal((2, 3))
    found = secant(matrices(2, 7), M, step, (M @ step[..., None])[..., 0])
    np.testing.assert_allclose(found, 0.0, atol=1e-12)


def test_a_step_that_tells_nothing_raises_no_warning():
    nothing, step = np.zeros((1, 3, 3)), np.array([[1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(secant(nothing, nothing, step, 0.0 * step), nothing)
    assert np.isfinite(secant(nothing, nothing, step, 1e10 * step)).all()


def test_a_gradient_that_falls_along_the_step_adds_no_curvature():
    S, step = 0.1 * matrices(1, 8), np.array([[1.0, 0.0, 0.0]])
    found = secant(S, matrices(1, 9), step, -step)
    np.testing.assert_allclose(found, S)


def test_newton_steps_end_where_the_reference_solver_does_and_projections_do_not():
    measured = read_motions(DATA_FILE).angles_deg.T
    off = [np.random.default_rng(seed).standard_normal(measured.shape) for seed in range(3)]
    every = np.radians(np.concatenate([measured + OFF_DEG * one for one in off], axis=1))
    girdles = sets_of([load_model("R2")], [f"posture_{number}" for number in range(every.shape[1])]).girdle
    projected = fit_extended(girdles, every, objective_weights(np.ones(every.shape, bool)), None)
    left = np.flatnonzero(~projected.converged)
    girdle, target, start = take_problems((girdles, every, projected.angles), left)
    weights = objective_weights(np.ones(target.shape, bool))
    found, reference = fit_by_newton(girdle, target, weights, start), reference_fit(girdle, target, weights, None)
    solved = found.converged
    assert solved.mean() > 1.0 / 3.0
    again = reference_fit(girdle, target, weights, found.angles)
    np.testing.assert_allclose(found.angles[:, solved], again.angles[:, solved], atol=SAME_RAD)
    both = solved & reference.converged
    assert (found.j_deg2[both] <= reference.j_deg2[both] * (1.0 + SAME)).all()


def test_newton_steps_leave_a_chain_that_cannot_close():
    girdle = load_model("R2").girdle
    short = replace(girdle, conoid_length_mm=np.asarray(shortest_conoid_mm(girdle) - 1.0)).repeated(1)
    target = np.radians(read_motions(DATA_FILE).angles_deg.T[:, :1])
    found = fit_by_newton(short, target, objective_weights(np.ones((6, 1), bool)), target)
    assert not found.converged.any()
    assert np.isfinite(found.angles).all()


@pytest.mark.parametrize("free", [("clavicle_x",), ("clavicle_x", "scapula_x")])
def test_with_angles_that_were_not_measured_postures_end_where_the_reference_solver_does(free):
    measured_deg = read_motions(DATA_FILE).angles_deg.T
    known = np.ones(measured_deg.shape, bool)
    known[[ANGLES.index(name) for name in free]] = False
    target = at_rest_where_unknown(np.radians(measured_deg), known)
    weights = objective_weights(known)
    girdle = sets_of([load_model("R2")], [f"posture_{number}" for number in range(target.shape[1])]).girdle
    found, reference = fit_extended(girdle, target, weights, None), reference_fit(girdle, target, weights, None)
    assert found.converged.mean() > MOST
    both = found.converged & reference.converged
    assert (found.j_deg2[both] <= reference.j_deg2[both] + SAME).all()
    same = both & (np.abs(found.angles - reference.angles).max(axis=0) < 0.1)  # of two turns that close the chain alike
    assert same.mean() > MOST
    np.testing.assert_allclose(found.j_deg2[same], reference.j_deg2[same], atol=SAME)
    left = np.flatnonzero(~found.converged)
    by_newton = fit_by_newton(*take_problems((girdle, target, weights, found.angles), left))
    assert by_newton.converged.sum() >= len(left) / 2.0


def test_an_effect_of_no_size_changes_no_adaptation_where_angles_were_not_measured():
    """The path without effects and the one with them find one optimum, each by its own postures and slopes. The length
    of the conoid is any that an axial rotation which is free closes with."""
    every = read_motions(DATA_FILE)
    few = every.select(np.isin(every.subject, every.subjects[:3]))
    angles_deg = few.angles_deg.copy()
    angles_deg[few.subject != every.subjects[0], ANGLES.index("clavicle_x")] = np.nan
    motions = replace(few, angles_deg=angles_deg)
    batch = posture_rows(motions)
    data = problems_of(batch, [load_model("R2")])
    effect = active_effects({"scapulothoracic_gap": (0.0, 0.0)}, motions).at(batch.rows)
    plain, start = adapt_batch(data), at_rest_where_unknown(data.angles, data.measured)
    found = solve_extended(subject_problem(data, np.full(3, WEIGHT)), effect, data.girdle.adapted_mm, start)
    assert found.converged.all()
    np.testing.assert_allclose(found.theta[:, 0], plain.theta_mm[:, 0], atol=SAME_MM)
    np.testing.assert_allclose(found.theta[:CONOID], plain.theta_mm[:CONOID], atol=SAME_MM)
    before, after = (
        mean_square_deg2(one.angles, data.angles, objective_weights(data.measured)) for one in (plain, found)
    )
    np.testing.assert_allclose(np.where(data.counted, before - after, 0.0), 0.0, atol=SAME_DEG2)
