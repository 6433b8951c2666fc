"""The benchmark's other solvers get the same problem as ours, and the oracles judge their answers."""

import casadi as ca
import numpy as np
import pytest
from oracles import T_SCALE_MM2, bones, foot_point_multipliers, slsqp, subject_problem, whole_objective

from models import load_model
from scripts.research.speed import side_by_side
from scripts.research.speed.peers.casadi_compiled import fatrop_call, in_stages
from scripts.research.speed.peers.cases import Cases
from scripts.research.speed.roofline.counted import times_an_iteration

ROUNDING = 1e-12
"""Relative tolerance for sums of some hundred numbers in another order."""


@pytest.fixture(scope="module")
def two_postures() -> Cases:
    """Return two postures of one subject, with theta inside its bounds."""
    model = load_model("R2")
    known, points = bones(model.girdle), np.asarray(model.points_mm)
    bounds = np.asarray(model.bounds_mm)
    theta = np.array([*known.centre_mm[1:], *known.semi_axes_mm, known.conoid_length_mm])
    targets = np.array([[-20.0, 10.0, 5.0, 30.0, 5.0, -8.0], [-25.0, 15.0, 10.0, 35.0, 15.0, -5.0]]).T
    return Cases(known, points, bounds, np.clip(theta, *bounds), [targets])


def test_an_answer_counts_with_closed_chains_and_theta_in_its_bounds(two_postures):
    known, target, theta = two_postures.bones, two_postures.targets_deg[0], two_postures.theta_mm
    closed = np.array([slsqp(known, angles, angles).angles_deg for angles in target.T]).T
    E, _ = whole_objective(known, two_postures.points_mm, target, theta, closed)
    assert two_postures.E([(theta, closed)]) == pytest.approx([E], rel=ROUNDING)
    beyond = two_postures.bounds_mm[1] + 1.0
    assert np.isnan(two_postures.E([(theta, closed + 0.01)])).all()
    assert np.isnan(two_postures.E([(beyond, closed)])).all()


def test_fatrop_gets_the_problem_of_ipopt(two_postures):
    target, theta = two_postures.targets_deg[0], two_postures.theta_mm
    P, N = target.shape[1], two_postures.points_mm.shape[1]
    call = fatrop_call(two_postures, target)
    t = foot_point_multipliers(two_postures.bones, two_postures.points_mm, theta, target) / T_SCALE_MM2
    whole, (staged, stages) = subject_problem(P, N), in_stages(P, N)
    E, g = _values(whole, np.concatenate([target.T.ravel(), theta, t]), call["p"])
    E_staged, g_staged = _values(staged, call["x0"], call["p"])
    assert E_staged == pytest.approx(E, rel=ROUNDING)
    copies = np.zeros(6 * P)  # residuals of the constraints that each stage's theta equals the stage before
    assert np.sort(g_staged) == pytest.approx(np.sort(np.concatenate([g, copies])), rel=ROUNDING, abs=1e-9)
    assert sum(stages["nx"]) + sum(stages["nu"]) == len(call["x0"])


def _values(problem, x, p) -> tuple[float, np.ndarray]:
    E, g = ca.Function("values", [problem["x"], problem["p"]], [problem["f"], problem["g"]])(x, p)
    return float(E), np.array(g).ravel()


def test_what_is_not_installed_is_left_out_and_said(monkeypatch, capsys):
    there, missing = side_by_side.PEERS["ipopt"], side_by_side.Peer(side_by_side.ipopt.run, "no_such_package")
    monkeypatch.setattr(side_by_side, "PEERS", {"there": there, "missing": missing})
    assert list(side_by_side.installed_peers()) == ["there"]
    assert capsys.readouterr().err == "missing is left out: no_such_package is not installed\n"


def test_optima_are_compared_subject_by_subject():
    ours, peer = np.array([1.0, 1.0, 1.0, 1.0, 5.0]), np.array([1.0, 1.0 + 1e-8, 1.1, np.nan])
    found = side_by_side.compared(ours, peer)
    assert found == {
        "subjects": 4.0,
        "same": 0.5,
        "same_to_rounding": 0.25,
        "ours_lower": 0.25,
        "ours_higher": 0.0,
        "peer_failed": 0.25,
    }


def test_loops_of_an_iteration_run_as_often_as_they_are_long():
    assert times_an_iteration(("block", "while", "posture", "while"), 14, 24) == 14
    assert times_an_iteration(("block", "while", "point"), 14, 24) == 24
    assert times_an_iteration(("block", "while", "times.8."), 14, 24) == 8
    assert times_an_iteration(("block", "posture"), 14, 24) == 0
