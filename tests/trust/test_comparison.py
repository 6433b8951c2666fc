# pyright: reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false
# (pandas types nearly every result as "Series | DataFrame | scalar")
"""The thesis's tables for consistency, and ``girdle compare`` against tables made by hand and the summary."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from handmade import adaptations, motions_of, rising

from adapt.trust.thesis import printed
from adapt.trust.thesis.comparison import COLUMNS, FIVE, MotionNames, _mean_motions, conclusions
from models import load_model
from motions import read_motions, write_motions
from motions.rhythm_subjects import DATA_FILE
from motions.table import ANGLES
from tests.helpers.command import girdle, refused

HALF_DIGIT = 0.05 + 1e-9
"""Half of the last printed digit, 0.1, of means and of subjects; the rounding of subjects averages out."""

NAMES = MotionNames("abduction", "forward_flexion")


@pytest.mark.parametrize("name", ["Table 6.1", "Table 6.2", "Table 6.3", "Table 6.4"])
@pytest.mark.parametrize("statistic", printed.STATISTICS)
def test_statistics_are_those_of_the_printed_subjects_but_for_the_misprints(name, statistic):
    table = printed.tables()[name]
    recomputed = printed.STATISTICS[statistic](table.of_subjects)
    wrong = {one.column: one for one in printed.misprints() if (one.table, one.row) == (name, statistic)}
    for column, value in zip(table.columns, recomputed, strict=True):
        off = abs(table.cell(statistic, column) - value)
        if column in wrong:
            assert table.cell(statistic, column) == wrong[column].printed
            assert value == pytest.approx(wrong[column].recomputed, abs=0.005)
            assert off > HALF_DIGIT
        else:
            assert off <= HALF_DIGIT, column


def test_every_table_is_whole():
    for table in printed.tables().values():
        assert table.values.shape == (len(table.rows), len(table.columns))
        assert table.pages
    assert [len(table.of_subjects) for table in printed.tables().values()] == [0, 0, 10, 10, 10, 10, 0, 0]


def test_six_angles_in_j_would_have_grown_with_r6():
    """Check the bound J >= (mean absolute difference)^2: R6 goes from 96 to 122 deg^2, up in eight of ten subjects."""
    for angles, (before, after, grew) in ((printed.ANGLES, (96, 122, 8)), (FIVE, (47, 29, 1))):
        least = [printed.least_mean_j_deg2(printed.gaps_deg(adapted), angles)[2] for adapted in (False, True)]
        assert [round(float(x.mean())) for x in least] == [before, after]
        assert int((least[1] > least[0]).sum()) == grew


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Run and tables for three shipped subjects, one of them declared a mean motion."""
    home = tmp_path_factory.mktemp("compare")
    motions = read_motions(DATA_FILE)
    motions = motions.select(np.isin(motions.subject, motions.subjects[:3]))
    write_motions(motions, home / "three.csv")
    sets = [word for name in ("R2", "R6", "das3") for word in ("--model", name)]
    ended = girdle("compare", home / "three.csv", *sets, "--mean", motions.subjects[0], "--out", home / "out")
    assert ended.status == 0, ended.err
    write_motions(motions.select(motions.subject != motions.subjects[0]), home / "two.csv")
    assert girdle("adapt", home / "two.csv", *sets, "--out", home / "adapted").status == 0
    return home, ended, pd.read_csv(home / "out" / "comparison.csv")


def test_tables_6_1_to_6_6_are_those_of_an_adaptation_to_both_motions(compared):
    home, _, table = compared
    assert tuple(table.columns) == COLUMNS
    summary = pd.read_csv(home / "adapted" / "summary.csv")
    summary = summary[summary["motion"] == "abduction"].set_index(["model", "adapted", "subject"])
    ours = table[table["source"] == "girdle"].set_index(["table", "model", "row", "quantity"])["value"]
    for model in ("R2", "R6", "das3"):
        for adapted, (clavicle, scapula) in ((0, ("Table 6.1", "Table 6.2")), (1, ("Table 6.3", "Table 6.4"))):
            for subject in ("simulated02", "simulated03", "mean", "std", "max", "min"):
                for k, angle in enumerate(ANGLES):
                    name = clavicle if k < 3 else scapula
                    assert ours[name, model, subject, angle] == summary.loc[(model, adapted, subject), f"{angle}_deg"]
    parameters = pd.read_csv(home / "adapted" / "parameters.csv").groupby("model")["A_y_mm"].mean()
    assert ours["Table 6.5", "R6", "mean", "A_y"] == pytest.approx(parameters["R6"])
    assert ours["Table 6.6", "R2", "set", "A_y"] == 404.0


def test_printed_numbers_stand_beside_the_sets_of_the_thesis_alone(compared):
    _, ended, table = compared
    thesis = table[table["source"] == "thesis"]
    assert set(thesis["model"]) == {"R2", "R6"}
    one = thesis.set_index(["table", "model", "row", "quantity"])
    assert one.loc[("Table 6.1", "R6", "4", "clavicle_x"), "value"] == 28.5
    assert one.loc[("Table 6.4", "R2", "mean", "scapula_x"), "value"] == 4.4
    assert tuple(one.loc[("Table 6.5", "R2", "mean", "M_y"), ["value", "sd"]]) == (-273.0, 31.0)
    assert tuple(one.loc[("Table 3.5", "R2", "mean of ten subjects", "scapula_y"), ["value", "sd"]]) == (7.6, 5.8)
    assert "R2 thesis" in ended.out
    assert "das3 thesis" not in ended.out


def test_what_the_thesis_concludes_comes_out_of_its_tables(compared):
    """Scapula of R2: (9.5 + 3.7 + 7.8) / 3 = 7.0 before, (3.4 + 2.9 + 4.4) / 3 = 3.5 after; largest 23.5 and 7.1."""
    found = conclusions(compared[2]).set_index(["source", "model", "bone", "measure"])
    assert found.loc[("thesis", "R2", "scapula", "mean")].tolist() == pytest.approx([7.0, 3.55], abs=0.06)
    assert found.loc[("thesis", "R2", "scapula", "max")].tolist() == [23.5, 7.1]


def test_table_3_4_of_fits_made_by_hand():
    """A gap of 6 degrees in every angle and posture: mean 6.0, SD 0.0."""
    made = adaptations(motions_of(rising(2, 4), motion="abduction"), [load_model("R4")])
    rows = list(_mean_motions(made.fits[made.fits["adapted"] == 0], NAMES))
    assert len(rows) == 2 * 6  # 2 subjects, 6 angles
    assert {row[0] for row in rows} == {"Table 3.4"}
    np.testing.assert_allclose([row[-2:] for row in rows], [(6.0, 0.0)] * len(rows), atol=1e-9)


def test_other_names_of_motions_and_who_lacks_one(compared, tmp_path):
    home, *_ = compared
    motions = read_motions(home / "two.csv")
    other = np.where(motions.motion == "abduction", "up", "ahead")
    lacks = (motions.subject == "simulated03") & (motions.motion == "forward_flexion")
    write_motions(replace(motions, motion=other).select(~lacks), tmp_path / "other.csv")
    names = ("--abduction", "up", "--flexion", "ahead")
    ended = girdle("compare", tmp_path / "other.csv", *names, "--out", tmp_path / "out")
    assert ended.status == 3
    assert "not handled: simulated03: no motion ahead, and Tables 6.1-6.6 are of both" in ended.err
    again = girdle("compare", "--repeat", tmp_path / "out" / "run.json", "--out", tmp_path / "again")
    assert again.status == 3
    assert (tmp_path / "again/comparison.csv").read_bytes() == (tmp_path / "out/comparison.csv").read_bytes()
    twice = ("--abduction", "up", "--flexion", "up")
    refused(
        girdle("compare", tmp_path / "other.csv", *twice, "--out", tmp_path / "none"),
        "--flexion",
        "abduction and flexion are both 'up'",
        "Name two motions",
    )
    refused(
        girdle("compare", tmp_path / "other.csv", "--out", tmp_path / "none"),
        "the motions",
        "there is no motion 'abduction'",
        "--abduction NAME; there are ahead, up",
    )
    mean = ("--mean", "dee")
    refused(girdle("compare", home / "two.csv", *mean, "--out", tmp_path / "none"), "--mean", "'dee'", "Take one of ")
