# pyright: reportGeneralTypeIssues=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""``girdle muscles`` as a person runs it: what it writes, says and refuses."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pandas as pd
import pytest
from command import Ended, girdle, refused, shipped_lines, written

from models import load_model
from models.muscles.balance import arm_weight_N
from models.muscles.muscle_lines import muscle_lines


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Ended, Path]:
    folder = tmp_path_factory.mktemp("muscles")
    motions = written(folder, shipped_lines(2))
    return girdle("muscles", motions, "--model", "R2", "--body-mass-kg", 60, "--out", folder / "out"), folder / "out"


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
    assert (tables["muscle_lines"]["length_mm"] > 20.0).all()
    assert ElementTree.parse(out / "muscle_arms.svg").getroot().tag.endswith("svg")
    assert (out / "parameters.csv").exists()


def test_it_prints_arms_and_forces_before_and_after(run):
    ended, _ = run
    assert "serratus_anterior" in ended.out
    assert "->" in ended.out
    assert "no balance" not in ended.out


def test_the_record_has_the_options(run):
    _, out = run
    record = json.loads((out / "run.json").read_text())
    assert record["command"] == "muscles"
    assert record["options"]["body_mass_kg"] == 60
    assert arm_weight_N(60.0) == pytest.approx(29.43)


def test_a_set_without_landmarks_is_refused_before_anything_is_fitted(tmp_path):
    motions = written(tmp_path, shipped_lines(1))
    refused(
        girdle("muscles", motions, "--model", "das3", "--out", tmp_path / "out"),
        "das3",
        "TS is not on the x-axis of the scapula frame",
        "use another set",
    )
    assert not (tmp_path / "out").exists()
