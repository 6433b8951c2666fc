"""Every reading of E against a scalar one in NumPy and SciPy: rotations, distances, postures and E written anew."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from oracles import bones, constraints, ellipsoid_distance, slsqp, with_theta

from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.objective import KINK_MM, READINGS, WEIGHT
from adapt.solvers.padded_batch import pack
from adapt.solvers.problem_batch import ProblemBatch, problem_batch
from models import load_model
from motions import Motions, read_motions
from motions.rotations import DEG
from scripts.rooms import ROOT

SAME = 1e-7
"""Relative. SLSQP ends where J falls by less than 1e-10 a step; the chains then gape by 1e-9 mm."""

STEP_MM = 0.05
"""Off the optimum, of each parameter. The sharpest rounded-off kink is 0.01 mm wide."""

NO_LOWER = 1e-6
"""Relative: what SLSQP's E may be lower one step away. Half of W, or points counted otherwise, make it 1e-4."""

SETTLED = {"squares": 1e-6, "roots": 1e-4, "lengths": 1e-3}
"""Relative: by how much E may lie above that at another reading's optimum. Iterated weights settle to 1e-4 only."""

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
}
"""D and J of the distances (mm) and the J_p (deg^2), said once more."""


def length(d: np.ndarray) -> np.ndarray:
    """|d|, rounded off."""
    return np.hypot(d, KINK_MM)


@pytest.fixture(scope="module")
def motions() -> Motions:
    """Six postures of a shipped (simulated) subject."""
    every = read_motions(ROOT / "motions" / "data" / "simulated_subjects.csv")
    mine = np.flatnonzero(every.subject == every.subjects[1])[::3]
    return every.select(np.isin(np.arange(len(every.subject)), mine[:6]))


@pytest.fixture(scope="module")
def data(motions) -> ProblemBatch:
    return problem_batch(pack(motions), [load_model("R6")])


@pytest.fixture(scope="module")
def adapted(data) -> dict[str, Adapted]:
    return {name: adapt_batch(data, WEIGHT, name) for name in READINGS}


@pytest.fixture(scope="module")
def scalar_e(motions, data) -> Callable[..., float]:
    """E of a reading at theta, every posture fitted by SLSQP from the postures of an optimum."""
    own, points = bones(data.girdle, 0), np.asarray(data.points_mm)[..., 0].T

    def E(name: str, theta: np.ndarray, near: Adapted) -> float:
        moved = with_theta(own, theta)
        d = np.array([ellipsoid_distance(p - moved.centre_mm, moved.semi_axes_mm)[0] for p in points])
        starts = (near.angles[..., 0] * DEG).T
        fits = [slsqp(moved, s, start) for s, start in zip(motions.angles_deg, starts, strict=False)]
        assert max(fit.open_mm for fit in fits) < 1e-6
        D, J = D_AND_J[name](d, np.array([fit.j_deg2 for fit in fits]))
        return float(D + WEIGHT * J)

    return E


def test_every_reading_is_written_anew():
    assert list(D_AND_J) == list(READINGS)


@pytest.mark.parametrize("name", READINGS)
def test_e_is_that_of_the_scalar_one_and_no_lower_nearby(name, data, adapted, scalar_e):
    """In every parameter, up and down, within the bounds."""
    found = adapted[name]
    assert found.status[0] == "ok"
    theta, E = found.theta_mm[:, 0], found.E[0]
    assert scalar_e(name, theta, found) == pytest.approx(E, rel=SAME)
    lower, upper = np.asarray(data.bounds_mm)[..., 0]
    for k in range(len(theta)):
        for step in (STEP_MM, -STEP_MM):
            moved = np.clip(theta + step * np.eye(len(theta))[k], lower, upper)
            assert scalar_e(name, moved, found) >= E - NO_LOWER * E, (k, step)


@pytest.mark.parametrize("name", READINGS)
def test_no_other_reading_s_optimum_is_lower(name, adapted, scalar_e):
    """And some are higher: the readings are not one."""
    others = {other: scalar_e(name, found.theta_mm[:, 0], found) for other, found in adapted.items()}
    assert min(others.values()) >= others[name] * (1.0 - SETTLED[READINGS[name].form])
    assert max(others.values()) > 1.01 * others[name]


def test_angles_left_out_are_not_in_j(motions, data):
    """Without the clavicle's axial rotation, J is the mean of five squares and the five alone place the posture."""
    angles_deg = motions.angles_deg.copy()
    angles_deg[:, 2] = np.nan
    blank = Motions(**{**vars(motions), "angles_deg": angles_deg})
    found = adapt_batch(problem_batch(pack(blank), [load_model("R6")]))
    moved = with_theta(bones(data.girdle, 0), found.theta_mm[:, 0])
    five = np.arange(6) != 2
    simulated = (found.angles[..., 0] * DEG).T[: len(angles_deg)]
    fits = [slsqp(moved, s, start, five) for s, start in zip(motions.angles_deg, simulated, strict=True)]
    assert np.mean([fit.j_deg2 for fit in fits]) == pytest.approx(found.mean_j_deg2[0], rel=SAME)
    squares = (simulated - motions.angles_deg)[:, five] ** 2
    assert np.mean(squares) == pytest.approx(found.mean_j_deg2[0], rel=1e-12)
    assert max(np.abs(constraints(moved, q)[0]).max() for q in simulated) < 1e-6
