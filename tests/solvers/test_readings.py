"""Every variant of E against a scalar implementation in NumPy and SciPy: rotations, distances, postures and E anew."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracles import Bones, bones, cardan, ellipsoid_distance, slsqp, with_theta

from adapt.evaluation.curvature import curvature
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.objective import KINK_MM, OBJECTIVES, WEIGHT
from adapt.solvers.problems import Problems, problems_of, select_problems, subject_problem
from adapt.solvers.projection.thorax_term import Thorax
from adapt.solvers.rows import posture_rows
from models import load_model
from motions import Motions, read_motions
from motions.landmarks.sampled_postures import SLIPPED
from motions.rotations import DEG
from scripts.rooms import ROOT

SAME = 1e-7
"""Relative tolerance. SLSQP ends where J falls by less than 1e-10 per step; constraint violations are then 1e-9 mm."""

STEP_MM = 0.05
"""Step of each parameter from the optimum. The sharpest rounded-off kink is 0.01 mm wide."""

NO_LOWER = 1e-6
"""Relative amount by which SLSQP's E may be lower one step away. Half of W, or wrong point weights, give 1e-4."""

SETTLED = {"squares": 1e-6, "roots": 1e-4, "lengths": 1e-3}
"""Relative excess of E over its value at another variant's optimum: iterated weights converge to 1e-4 only."""

D_AND_J: dict[str, Callable[[np.ndarray, np.ndarray], tuple[Any, Any]]] = {
    "mm2_deg2": lambda d, j: (np.mean(d**2), np.mean(j)),
    "cm2_deg2": lambda d, j: (np.mean((d / 10.0) ** 2), np.mean(j)),
    "cm2_rad2": lambda d, j: (np.mean((d / 10.0) ** 2), np.mean(j * np.radians(1.0) ** 2)),
    "rms_cm_rad": lambda d, j: (np.sqrt(np.mean((d / 10.0) ** 2)), np.radians(np.sqrt(np.mean(j)))),
    "rms_mm_deg": lambda d, j: (np.sqrt(np.mean(d**2)), np.sqrt(np.mean(j))),
    "mm_deg2": lambda d, j: (np.mean(length(d)), np.mean(j)),
    "cm_deg2": lambda d, j: (np.mean(length(d) / 10.0), np.mean(j)),
    "sum_mm2_deg2": lambda d, j: (np.sum(d**2), np.mean(j)),
    "sum_cm2_deg2": lambda d, j: (np.sum((d / 10.0) ** 2), np.mean(j)),
    "sum_mm_deg2": lambda d, j: (np.sum(length(d)), np.mean(j)),
    "sum_mm2_sum_deg2": lambda d, j: (np.sum(d**2), np.sum(j)),
    "mm2_sum_deg2": lambda d, j: (np.mean(d**2), np.sum(j)),
    "mm2_deg2_landmarks": lambda d, j: (np.mean(d**2), np.mean(j)),
}
"""D and J from the distances (mm) and the J_p (deg^2), written anew."""

LANDMARKS = "mm2_deg2_landmarks"

PALPATED_MM = 6.0
"""SD of a landmark about its place in the model at the measured angles: large enough that L moves the optimum."""


def length(d: np.ndarray) -> np.ndarray:
    """Compute |d|, rounded off at 0."""
    return np.hypot(d, KINK_MM)


@pytest.fixture(scope="module")
def motions() -> Motions:
    """Six postures of a shipped (simulated) subject."""
    every = read_motions(ROOT / "motions" / "data" / "simulated_subjects.csv")
    mine = np.flatnonzero(every.subject == every.subjects[1])[::3]
    six = every.select(np.isin(np.arange(len(every.subject)), mine[:6]))
    return replace(six, landmarks_mm=palpated(six.angles_deg))


def palpated(angles_deg: np.ndarray) -> dict[str, np.ndarray]:
    """Simulate positions of TS and AI; TS is missing in the second posture, and one coordinate of AI in the third."""
    own, generator = bones(load_model("R6").girdle), np.random.default_rng(5)
    found = {}
    for name, place in (("TS", own.ts_mm), ("AI", own.ai_mm)):
        exact = [own.sc_mm + cardan(q[:3])[0] @ own.ac_mm + cardan(q[3:])[0] @ place for q in angles_deg]
        found[name] = np.stack(exact) + PALPATED_MM * generator.standard_normal((len(angles_deg), 3))
    found["TS"][1] = np.nan
    found["AI"][2, 1] = np.nan
    return found


@pytest.fixture(scope="module")
def data(motions) -> Problems:
    return problems_of(posture_rows(motions), [load_model("R6")])


@pytest.fixture(scope="module")
def adapted(data) -> dict[str, Adapted]:
    return {name: adapt_batch(data, WEIGHT, name) for name in OBJECTIVES}


@pytest.fixture(scope="module")
def scalar_e(motions, data) -> Callable[..., float]:
    """Return E of a variant at theta, with every posture fitted by SLSQP from the postures of an optimum."""
    own, points = bones(data.girdle, 0), np.asarray(data.points_mm)[..., 0].T

    def E(name: str, theta: np.ndarray, near: Adapted) -> float:
        moved = with_theta(own, theta)
        d = np.array([ellipsoid_distance(p - moved.centre_mm, moved.semi_axes_mm)[0] for p in points])
        starts = (near.angles[..., 0] * DEG).T
        fits = [slsqp(moved, s, start) for s, start in zip(motions.angles_deg, starts, strict=False)]
        assert max(fit.open_mm for fit in fits) < 1e-6
        D, J = D_AND_J[name](d, np.array([fit.j_deg2 for fit in fits]))
        return float(D + (scalar_l(motions, moved) if name == LANDMARKS else 0.0) + WEIGHT * J)

    return E


def scalar_l(motions: Motions, moved: Bones) -> float:
    """Compute L at an ellipsoid, mm^2."""
    squares = [
        (ellipsoid_distance(p - moved.centre_mm, moved.semi_axes_mm)[0] - const) ** 2
        for name, const in (("TS", moved.ts_distance_mm), ("AI", moved.ai_distance_mm))
        for p in motions.landmarks_mm[name]
        if np.isfinite(p).all()
    ]
    assert len(squares) == 2 * len(motions.posture) - 2
    return float(np.mean(squares))


def test_every_reading_is_written_anew():
    assert list(D_AND_J) == list(OBJECTIVES)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_e_is_that_of_the_scalar_one_and_no_lower_nearby(name, data, adapted, scalar_e):
    """Check every parameter, up and down, within the bounds."""
    found = adapted[name]
    assert found.status[0] == "ok"
    theta, E = found.theta_mm[:, 0], found.E[0]
    assert scalar_e(name, theta, found) == pytest.approx(E, rel=SAME)
    lower, upper = np.asarray(data.bounds_mm)[..., 0]
    for k in range(len(theta)):
        for step in (STEP_MM, -STEP_MM):
            moved = np.clip(theta + step * np.eye(len(theta))[k], lower, upper)
            assert scalar_e(name, moved, found) >= E - NO_LOWER * E, (k, step)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_no_other_reading_s_optimum_is_lower(name, adapted, scalar_e):
    """Check also that some optima are clearly higher: the variants differ."""
    others = {other: scalar_e(name, found.theta_mm[:, 0], found) for other, found in adapted.items()}
    assert min(others.values()) >= others[name] * (1.0 - SETTLED[OBJECTIVES[name].form])
    assert max(others.values()) > 1.01 * others[name]


def test_landmarks_count_where_they_were_measured_in_the_postures_that_do(motions, data, adapted):
    """Check that L counts the postures of the adaptation; without landmarks E is that of the default variant."""
    found = adapted[LANDMARKS]
    moved = with_theta(bones(data.girdle, 0), found.theta_mm[:, 0])
    assert found.L_mm2[0] == pytest.approx(scalar_l(motions, moved), rel=SAME)
    assert found.E[0] == pytest.approx(found.D_mm2[0] + found.L_mm2[0] + WEIGHT * found.mean_j_deg2[0], rel=1e-12)
    assert np.isnan(adapted["mm2_deg2"].L_mm2[0])
    first = np.asarray(data.counted) & (np.arange(len(data.counted)) < 1)[:, None]
    of_first = adapt_batch(select_problems(data, np.array([0]), counted=first), WEIGHT, LANDMARKS)
    moved, at = with_theta(bones(data.girdle, 0), of_first.theta_mm[:, 0]), motions.landmarks_mm
    away = [
        ellipsoid_distance(at[name][0] - moved.centre_mm, moved.semi_axes_mm)[0] - const
        for name, const in (("TS", moved.ts_distance_mm), ("AI", moved.ai_distance_mm))
    ]
    assert of_first.L_mm2[0] == pytest.approx(np.mean(np.square(away)), rel=SAME)
    nobody = adapt_batch(
        problems_of(posture_rows(replace(motions, landmarks_mm={})), [load_model("R6")]), WEIGHT, LANDMARKS
    )
    assert np.isnan(nobody.L_mm2[0])
    np.testing.assert_allclose(nobody.theta_mm, adapted["mm2_deg2"].theta_mm, rtol=0.0, atol=1e-6)


def test_with_landmarks_the_covariance_knows_of_them(data, adapted):
    """Check the curvature of the points against differences of the gradient of the whole thorax term."""
    found = adapted[LANDMARKS]
    curved = curvature(data, found)
    assert np.abs(curved.of_points - curvature(data, adapted["mm2_deg2"]).of_points).max() > 0.01
    fixed = subject_problem(data, found.weight, 1.0)
    thorax = Thorax(*fixed[:4])
    for k in range(5):
        step = 1e-3 * np.eye(6)[k][:, None]
        up, down = (thorax(found.theta_mm + sign * step)[1] for sign in (1.0, -1.0))
        slope = (up - down) / 2e-3
        np.testing.assert_allclose(curved.of_points[:, k], slope, rtol=0.0, atol=1e-6)


def test_landmarks_with_an_active_effect_of_no_size(motions, data, adapted):
    """Check the slower and the fast path of effects with an effect of size 0 against the batch without effects."""
    rows = posture_rows(motions, {"scapula_landmark_bias": (0.0, 0.0, 0.0)})
    found = adapt_batch(problems_of(rows, [load_model("R6")]), WEIGHT, LANDMARKS)
    assert found.status[0] == "ok"
    np.testing.assert_allclose(found.theta_mm, adapted[LANDMARKS].theta_mm, rtol=0.0, atol=1e-5)
    assert found.E[0] == pytest.approx(adapted[LANDMARKS].E[0], rel=1e-10)


def test_a_landmark_that_slipped_is_not_one_that_was_measured(motions):
    marks = ["", "AI", "", "", "TS AC"]
    marked = replace(motions, extra=motions.extra.assign(**{SLIPPED: marks}))
    before, after = (posture_rows(one).landmarks_mm for one in (motions, marked))
    for name, row in (("AI", 1), ("TS", 4)):
        gone = np.isnan(after[name]) & ~np.isnan(before[name])
        np.testing.assert_array_equal(gone, np.broadcast_to(np.arange(len(marks)) == row, gone.shape))
