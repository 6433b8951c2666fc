"""The study of chapter 7: who is a person, intervals by hand, the courses, and a run on simulated subjects."""

import numpy as np
import pytest
import typer
from handmade import motions_of, rising
from typer.testing import CliRunner

from motions import InputError, read_motions
from motions.motion_csv.writing import write_motions
from motions.rhythm_subjects import DATA_FILE
from scripts.research.thesis.chapter7.ellipsoids import line_over_elevation, mean_change
from scripts.research.thesis.chapter7.shoulders import Persons, whole
from scripts.research.thesis.study_chapter7 import MEASURED, SIMULATED, app

EXACT = 1e-12


def persons() -> Persons:
    names = ["ann_left", "ann_right", "bob", "mean_of_ten", "cy_R"]
    return Persons.of(motions_of(rising(5, 3), names), ["mean_of_ten"])


def test_sides_of_one_person_are_one_and_group_means_none():
    values = np.array([1.0, 3.0, 4.0, 100.0, 6.0])
    np.testing.assert_array_equal(persons().each(values), [2.0, 4.0, 6.0])
    assert persons().of_means(values) == "100.0"
    np.testing.assert_array_equal(persons().each(np.array([1.0, np.nan, np.nan, 100.0, 6.0])), [1.0, 6.0])


def test_the_interval_is_the_t_interval_over_persons():
    """Mean 4, SD 2 of three: 4 +- 4.3027 x 2 / sqrt 3 = 4 +- 4.968."""
    assert persons().cell(np.array([1.0, 3.0, 4.0, 100.0, 6.0]), 2) == "4.00 (-0.97 to 8.97)"


def test_a_mean_that_is_no_subject_is_refused():
    with pytest.raises(typer.BadParameter, match=r"no subject is called 'dee'.*ann_left"):
        Persons.of(motions_of(rising(1, 3), ["ann_left"]), ["dee"])


def test_postures_without_all_angles_are_left_out_and_none_is_an_error():
    motions = motions_of(rising(1, 3))
    motions.angles_deg[1, 2] = np.nan
    assert len(whole(motions).posture) == 2
    motions.angles_deg[:] = np.nan
    with pytest.raises(InputError, match="no posture has six angles"):
        whole(motions)


def test_courses_are_the_mean_and_the_line():
    seen, unseen = np.array([0.0, 50.0, 100.0]), np.array([25.0, 200.0])
    change = np.stack([1.0 + 0.1 * seen, np.full(3, -2.0)])
    np.testing.assert_allclose(line_over_elevation(change, seen, unseen), [[3.5, 21.0], [-2.0, -2.0]], rtol=EXACT)
    np.testing.assert_allclose(mean_change(change, seen, unseen), [[6.0, 6.0], [-2.0, -2.0]], rtol=EXACT)


def test_a_run_prints_every_table_of_subjects_that_follow_the_rhythm(tmp_path):
    motions = read_motions(DATA_FILE)
    file = tmp_path / "three.csv"
    write_motions(motions.select(np.isin(motions.subject, motions.subjects[:3])), file)
    ended = CliRunner().invoke(app, [str(file), "--model", "R6"], catch_exceptions=False)
    assert ended.exit_code == 0
    tables = [part for part in ended.stdout.split("\n\n") if part.startswith("|")]
    assert [len(one.splitlines()) - 2 for one in tables] == [4, 9, 1, 1, 4, 4]
    assert {line.split(" | ")[0] for line in tables[4].splitlines()[2:]} == {f"| {MEASURED}", f"| {SIMULATED}"}
    rhythm = [line.split(" | ") for line in tables[1].splitlines()[2:4]]
    published, own = (float(line[2].split(" ")[0]) for line in rhythm)
    assert own < published < 10.0  # they follow the rhythm from a rest of their own, with 1.5 deg of noise
    assert "nan" not in ended.stdout
