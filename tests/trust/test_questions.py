# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportAssignmentType=false
# (pandas types nearly every result as "Series | DataFrame | scalar")
"""The questions of chapter 7: persons and their sides, intervals and courses by hand, and a whole run."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from handmade import motions_of, rising

from adapt.trust.questions.ellipsoids import MEASURED, SIMULATED, line_over_elevation, mean_change, spread_mm
from adapt.trust.questions.persons import Interval, Persons, whole
from adapt.trust.thesis.printed import sd_mm
from models.adapted_parameters import PERSON_SD_MM
from motions import InputError, read_motions
from motions.motion_csv.writing import write_motions
from motions.rhythm_subjects import DATA_FILE
from tests.helpers.command import girdle, refused

EXACT = 1e-12


def persons() -> Persons:
    names = ["ann_left", "ann_right", "bob", "mean_of_ten", "cy_R"]
    return Persons.of(motions_of(rising(5, 3), names), ["mean_of_ten"])


def test_sides_of_one_person_are_one_and_group_means_none():
    values = np.array([1.0, 3.0, 4.0, 100.0, 6.0])
    np.testing.assert_array_equal(persons().each(values), [2.0, 4.0, 6.0])
    assert persons().means(values) == {"mean_of_ten": 100.0}
    np.testing.assert_array_equal(persons().each(np.array([1.0, np.nan, np.nan, 100.0, 6.0])), [1.0, 6.0])


def test_the_interval_is_the_t_interval_over_persons():
    """Mean 4, SD 2 of three: 4 +- 4.3027 x 2 / sqrt 3 = 4 +- 4.968."""
    found = persons().interval(np.array([1.0, 3.0, 4.0, 100.0, 6.0]))
    assert (found.value, found.low, found.high) == pytest.approx((4.0, -0.968, 8.968), abs=1e-3)


def test_one_person_has_no_interval_and_nobody_no_mean():
    one = persons().interval(np.array([1.0, 3.0, np.nan, 100.0, np.nan]))
    assert one.value == 2.0
    assert np.isnan([one.low, one.high]).all()
    assert np.isnan(vars(persons().interval(np.full(5, np.nan)))["value"])
    assert isinstance(one, Interval)


def test_a_mean_that_is_no_subject_is_refused():
    with pytest.raises(InputError, match=r"no subject is called 'dee'.*ann_left"):
        Persons.of(motions_of(rising(1, 3), ["ann_left"]), ["dee"])


def test_postures_without_all_angles_are_left_out_and_none_is_an_error():
    motions = motions_of(rising(1, 3))
    motions.angles_deg[1, 2] = np.nan
    assert len(whole(motions).posture) == 2
    motions.angles_deg[:] = np.nan
    with pytest.raises(InputError, match="no posture has six angles"):
        whole(motions)


def test_courses_are_the_mean_and_the_line():
    fitted, others = np.array([0.0, 50.0, 100.0]), np.array([25.0, 200.0])
    change = np.stack([1.0 + 0.1 * fitted, np.full(3, -2.0)])
    np.testing.assert_allclose(line_over_elevation(change, fitted, others), [[3.5, 21.0], [-2.0, -2.0]], rtol=EXACT)
    np.testing.assert_allclose(mean_change(change, fitted, others), [[6.0, 6.0], [-2.0, -2.0]], rtol=EXACT)


def test_changes_are_in_units_of_table_6_5_where_it_has_the_set():
    np.testing.assert_array_equal(spread_mm("R4"), sd_mm()[1])
    np.testing.assert_array_equal(spread_mm("das3"), PERSON_SD_MM)


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """Three shipped subjects, who follow the rhythm from individual rest postures with 1.5 deg of noise."""
    motions = read_motions(DATA_FILE)
    file = tmp_path_factory.mktemp("questions") / "three.csv"
    write_motions(motions.select(np.isin(motions.subject, motions.subjects[:3])), file)
    return file


def test_a_run_answers_every_question_of_subjects_that_follow_the_rhythm(three, tmp_path):
    ended = girdle("questions", three, "--model", "R6", "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "nan" not in ended.out
    table = pd.read_csv(tmp_path / "out" / "questions.csv")
    cases = table.groupby("question")["case"].unique()
    assert len(cases["constant_distance"]) == 4
    assert {case.partition(",")[0] for case in cases["ellipsoid_per_posture"]} == {MEASURED, SIMULATED}
    rhythm = table[table["quantity"] == "scapula, mean difference"].set_index("case")["value"]
    ways = ("rhythm from the subject's rest, no model", "rhythm from the published rest, no model")
    own, published = rhythm[list(ways)].to_numpy(float)
    assert own < published < 10.0
    known = table.dropna(subset=["low"])
    assert (known["low"] <= known["value"]).to_numpy().all()
    again = girdle("questions", "--repeat", tmp_path / "out" / "run.json", "--out", tmp_path / "again")
    assert again.status == 0, again.err
    assert (tmp_path / "again" / "questions.csv").read_bytes() == (tmp_path / "out" / "questions.csv").read_bytes()


def test_one_motion_and_an_unknown_plane_answer_what_they_can(three, tmp_path):
    motions = read_motions(three)
    one = motions.select(motions.motion == "abduction")
    write_motions(replace(one, motion=np.full(len(one.motion), "reach")), tmp_path / "one.csv")
    ended = girdle("questions", tmp_path / "one.csv", "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert (
        "A rhythm, or scapula and clavicle measured? Mean difference, degrees: these motions do not tell" in ended.out
    )
    assert "Gap on held-out motions, degrees: these motions do not tell" in ended.out
    assert "rhythm_or_measured" not in set(pd.read_csv(tmp_path / "out" / "questions.csv")["question"])


def test_five_angles_and_unknown_means_are_refused(three, tmp_path):
    motions = read_motions(three)
    motions.angles_deg[:, 2] = np.nan
    write_motions(motions, tmp_path / "five.csv")
    refused(
        girdle("questions", tmp_path / "five.csv", "--out", tmp_path / "out"),
        "the motions",
        "no posture has six angles and an elevation of the arm",
        "estimated axial rotation",
    )
    refused(girdle("questions", three, "--mean", "dee", "--out", tmp_path / "out"), "--mean", "'dee'", "Take one of")
