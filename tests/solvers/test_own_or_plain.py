# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
# (own_bones is None after a plain adaptation; pandas types nearly every result as "Series | object")
"""Persons whose own bones are rejected: they get the plain adaptation, whatever else is in the run."""

from dataclasses import replace

import numpy as np
import pytest

from adapt import adapt_subjects
from adapt.api import Adaptations
from adapt.evaluation.own_or_plain import _folds
from adapt.output.large_runs.chunked_run import not_adapted
from adapt.own_bones import most_probable
from models import load_model
from models.adapted_parameters import ADAPTED
from motions import Motions, read_motions
from motions.rhythm_subjects import DATA_FILE

R2 = load_model("R2")


@pytest.fixture(scope="module")
def shipped() -> Motions:
    motions = read_motions(DATA_FILE)
    return motions.select(np.isin(motions.subject, motions.subjects[:3]))


@pytest.fixture(scope="module")
def refuted(shipped) -> Motions:
    """The second subject's frames are off by 20 degrees in the second motion, which no bones explain."""
    angles = shipped.angles_deg.copy()
    other = (shipped.subject == shipped.subjects[1]) & (shipped.motion == "forward_flexion")
    angles[other] += np.array([20.0, 0.0, 0.0, 20.0, 0.0, 0.0])
    return replace(shipped, angles_deg=angles)


def same_as_plain(found: Adaptations, plain: Adaptations, k: int) -> None:
    ours, theirs = found.adapted["R2"], plain.adapted["R2"]
    for field in ("theta_mm", "at_bound", "E", "D_mm2", "mean_j_deg2", "code"):
        np.testing.assert_array_equal(getattr(ours, field)[..., k], getattr(theirs, field)[..., k], err_msg=field)
    name = found.parameters["subject"][k]
    for own, other in ((found.fits, plain.fits), (found.heldout, plain.heldout)):
        np.testing.assert_array_equal(
            own[own["subject"] == name].to_numpy(object)[:, 5:].astype(str),
            other[other["subject"] == name].to_numpy(object)[:, 5:].astype(str),
        )
    np.testing.assert_array_equal(found.uncertainty.sd_mm[:, k], plain.uncertainty.sd_mm[:, k])


def test_bones_that_do_not_predict_are_not_taken(refuted):
    found, plain = (adapt_subjects(refuted, R2, own_bones=own) for own in (True, False))
    assert found.parameters["own_bones"].tolist() == ["adapted", "do_not_predict", "adapted"]
    assert found.parameters["status"].tolist() == ["ok"] * 3
    own = found.problems.own_bones
    np.testing.assert_array_equal(own.sizes[len(ADAPTED) :, 1], 0.0)
    assert np.isnan(own.sd[:, 1]).all()
    assert found.uncertainty.bounded.tolist() == [False, True, False]
    np.testing.assert_array_equal(found.adapted["R2"].theta_mm[:, 1], plain.adapted["R2"].theta_mm[:, 1])
    np.testing.assert_array_equal(found.uncertainty.sd_mm[:, 1], plain.uncertainty.sd_mm[:, 1])
    assert not_adapted(found) == {}


def test_the_others_are_as_without_such_a_person(shipped, refuted):
    found, others = (adapt_subjects(one, R2, held_out=(), own_bones=True) for one in (refuted, shipped))
    for k in (0, 2):
        np.testing.assert_array_equal(found.problems.own_bones.sizes[:, k], others.problems.own_bones.sizes[:, k])
        assert found.adapted["R2"].E[k] == others.adapted["R2"].E[k]


def test_where_no_search_converges_all_is_the_plain_adaptation_and_said(shipped, monkeypatch):
    monkeypatch.setattr(most_probable, "_FLAT", -1.0)
    found, plain = (adapt_subjects(shipped, R2, own_bones=own) for own in (True, False))
    assert found.parameters["own_bones"].tolist() == ["not_converged"] * 3
    for k in range(3):
        same_as_plain(found, plain, k)
    assert not_adapted(found) == dict.fromkeys(
        shipped.subjects, "own bones not_converged, the plain adaptation is kept"
    )


def test_each_motion_is_left_out_or_each_third():
    """Four problems with six places: two motions; one motion; one posture; three motions, one not counted."""
    counted = np.array([[1, 1, 1, 1, 1, 0], [1, 1, 1, 0, 0, 0], [1, 0, 0, 0, 0, 0], [1, 1, 0, 1, 0, 0]], bool).T
    motion = np.array([[0, 0, 1, 1, 1, 1], [5, 5, 5, 5, 5, 5], [0, 1, 1, 1, 1, 1], [2, 2, 3, 4, 4, 4]]).T
    problem, fitted, tested = _folds(counted, motion)
    assert problem.tolist() == [0, 0, 1, 1, 1, 3, 3]
    np.testing.assert_array_equal(fitted ^ tested, counted[:, problem])
    assert [np.flatnonzero(one).tolist() for one in tested.T] == [[0, 1], [2, 3, 4], [2], [0], [1], [0, 1], [3]]
