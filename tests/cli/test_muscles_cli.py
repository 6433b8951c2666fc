# pyright: reportGeneralTypeIssues=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""``girdle muscles`` as a user runs it: files, messages and refusals."""

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import Ended, girdle, refused, shipped_lines, written
from pages import data_of, words_of

from adapt import adapt_subjects
from adapt.tables.muscle_tables import muscle_tables
from models import load_model
from models.muscles.arm_load import arm_load
from models.muscles.muscle_lines import muscle_lines
from models.person.family import load_personal_sets
from motions import write_motions
from scripts.research.person.simulated_persons import landmark_table, simulate_persons

ALONE_MM = 1e-6
"""Tolerance between a subject adapted in a batch and alone, equal to rounding; files hold 1e-9."""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Ended, Path]:
    folder = tmp_path_factory.mktemp("muscles")
    motions = written(folder, shipped_lines(2))
    return girdle(
        "muscles", motions, "--model", "R2", "--body-mass-kg", 60, "--load-kg", 1.5, "--out", folder / "out"
    ), folder / "out"


def test_it_writes_a_table_of_each_kind_and_a_figure(run):
    ended, out = run
    assert ended.status == 0, ended.err
    tables = {name: pd.read_csv(out / f"{name}.csv") for name in ("muscle_arms", "muscles", "balance", "muscle_lines")}
    lines = muscle_lines(load_model("R2"))
    assert len(tables["balance"]) == 28
    assert len(tables["muscle_arms"]) == 2 * len(lines.muscles)
    assert len(tables["muscles"]) == 28 * len(lines.muscles)
    assert len(tables["muscle_lines"]) == 2 * 28 * len(lines.name)
    assert set(tables["balance"]["status_before"]) == set(tables["balance"]["status_after"]) == {"ok"}
    assert (tables["muscle_lines"]["length_mm"] > 10.0).all()  # shortest: long biceps to its via point, 11 mm, arm up
    assert ElementTree.parse(out / "muscle_arms.svg").getroot().tag.endswith("svg")
    assert (out / "parameters.csv").exists()
    assert set(pd.read_csv(out / "heldout.csv")["subject"]) == set(tables["balance"]["subject"])


def test_muscles_hold_arm_and_load_up_and_press_the_humerus_into_the_glenoid(run):
    """In every posture the moments of the muscles about GH are minus those of arm and load (thesis, Figure 3.8)."""
    _, out = run
    muscles, balance = pd.read_csv(out / "muscles.csv"), pd.read_csv(out / "balance.csv")
    for state in ("before", "after"):
        held = muscles.groupby(["subject", "motion", "posture"], sort=False)[f"moment_gh_{state}_Nm"].sum().to_numpy()
        np.testing.assert_allclose(held, -balance[f"load_gh_{state}_Nm"], atol=1e-6)
        assert held.max() > 8.0
        assert balance[f"GH_off_centre_{state}"].between(0.0, 1.0).all()
        assert balance.loc[balance["humerus_elevation_deg"] == 75.0, f"GH_{state}_N"].min() > 200.0
    assert set(balance["humerus_known_by"]) == {"motion"}
    planes = balance.groupby("motion")["humerus_plane_deg"].unique()
    assert planes["abduction"] == [0.0]
    assert planes["forward_flexion"] == [90.0]
    old = ["about_sc_before_mm", "about_sc_after_mm", "about_ac_before_mm", "about_ac_after_mm", "force_before_N"]
    assert list(muscles)[6:11] == old
    assert list(muscles)[-1] == "moment_gh_after_Nm"


def test_a_column_without_a_number_is_refused_before_anything_is_fitted(tmp_path):
    header, *rows = shipped_lines(1)
    lines = [f"{header},humerus_plane_deg", *(f"{row},{'forward' if k == 2 else 30}" for k, row in enumerate(rows))]
    motions = written(tmp_path, lines)
    refused(
        girdle("muscles", motions, "--model", "R2", "--out", tmp_path / "out"),
        "simulated01, abduction, posture 3",
        "humerus_plane_deg is 'forward'",
        "Give degrees between -180 and 180, or leave the cell empty",
    )


def test_it_prints_arms_and_forces_before_and_after(run):
    ended, _ = run
    assert "serratus_anterior" in ended.out
    assert "->" in ended.out
    assert "no balance" not in ended.out
    assert "in 28 of 28 postures is assumed from the motion's name" in ended.out


def test_its_page_has_the_lines_and_the_arms_of_the_tables(run):
    """The page has every posture and line; tests/report checks how it shows them."""
    _, out = run
    html = (out / "report.html").read_text(encoding="utf-8")
    assert "takes the arm of the serratus anterior about SC from" in words_of(html)
    (muscles,) = data_of(html)["muscles"]
    for state, number in (("before", 0), ("after", 1)):
        assert len(muscles["states"][state]["paths"]) == 28
        table = pd.read_csv(out / "muscles.csv").query("muscle == 'rhomboids'")
        at = muscles["muscles"].index("rhomboids")
        drawn = muscles["states"][state]["arms_mm"][number][at]
        joint = ("sc", "ac")[number]
        assert sorted(drawn) == pytest.approx(sorted(table[f"about_{joint}_{state}_mm"]), abs=0.051)


def test_persons_have_the_lines_of_their_own_sets_and_who_has_none_is_left_out_by_name(tmp_path):
    """Simulated persons; `girdle model` makes sets of all but the last from their landmarks."""
    persons = simulate_persons(load_model("R2"), 3, 1.0, 2)
    *known, last = persons.motions.subjects
    write_motions(persons.motions, tmp_path / "motions.csv")
    landmark_table(persons, known).to_csv(tmp_path / "landmarks.csv", index=False)
    made = girdle("model", tmp_path / "landmarks.csv", "--out", tmp_path / "own")
    assert made.status == 0, made.err
    ran = girdle("muscles", tmp_path / "motions.csv", "--models-of", tmp_path / "own", "--out", tmp_path / "out")
    assert ran.status == 3
    assert f"there is no parameter set of subject '{last}'" in ran.err
    tables = {
        name: pd.read_csv(tmp_path / "out" / f"{name}.csv") for name in ("muscle_lines", "balance", "muscle_arms")
    }
    own = load_personal_sets(tmp_path / "own")
    for table in tables.values():
        assert set(table["subject"]) == set(known)
        assert set(table["model"]) == {"own"}
    for subject in known:
        mine = persons.motions.select(persons.motions.subject == subject)
        alone = adapt_subjects(mine, own.of(subject), held_out=())
        expected = muscle_tables([own.of(subject)], alone.fits, alone.parameters)
        rows = tables["muscle_lines"][tables["muscle_lines"]["subject"] == subject]
        np.testing.assert_allclose(rows["length_mm"], expected.lines["length_mm"], atol=ALONE_MM)
    lengths = tables["muscle_lines"].groupby("subject")["length_mm"].mean()
    assert lengths.max() - lengths.min() > 1.0, "persons of different sizes"
    ran = girdle("trust", tmp_path / "motions.csv", "--models-of", tmp_path / "own", "--out", tmp_path / "trust")
    assert ran.status == 3
    checks = pd.read_csv(tmp_path / "trust" / "plausibility.csv")
    assert checks.groupby("subject")["check"].apply(lambda names: "serratus arm about SC" in set(names)).all()
    assert_said(ran.out, checks)


def assert_said(out: str, checks: pd.DataFrame) -> None:
    """Assert that the terminal shows every check: passed in one list, or as a warning with limits and reason."""
    (passed,) = re.findall(r"^own: pass: (.*)$", out, re.MULTILINE)
    for name, rows in checks.groupby("check"):
        outside = int((rows["verdict"] == "warning").sum())
        warning = re.search(rf"^own, {re.escape(str(name))}: warning: (.*)$", out, re.MULTILINE)
        assert (str(name) in passed.split("; ")) == (outside == 0)
        assert bool(warning) == (outside > 0)
        if warning:
            assert warning[1].startswith(f"{outside} of {len(rows)} subjects not within ")
            assert f"({rows.iloc[0]['reason']})" in warning[1]


def test_the_record_has_the_options(run):
    _, out = run
    record = json.loads((out / "run.json").read_text())
    assert record["command"] == "muscles"
    assert record["options"]["body_mass_kg"] == 60
    assert record["options"]["load_kg"] == 1.5
    assert arm_load(60.0).weight_N.sum() == pytest.approx(29.43)


def test_a_set_without_landmarks_is_refused_before_anything_is_fitted(tmp_path):
    motions = written(tmp_path, shipped_lines(1))
    refused(
        girdle("muscles", motions, "--model", "das3", "--out", tmp_path / "out"),
        "das3",
        "TS is not on the x-axis of the scapula frame",
        "use another set",
    )
    assert not (tmp_path / "out").exists()
