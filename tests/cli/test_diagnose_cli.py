"""`girdle diagnose` as a user sees it: files, terminal output, refusals, exit statuses."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import SHIPPED, Ended, girdle, refused, written
from diagnoses import NOTHING, ONE, TWO, gap_of
from handmade import adaptations

from adapt import diagnose
from adapt.cli.commands import assess_runs as cli
from adapt.diagnosis.result import Diagnoses
from adapt.diagnosis.texts.json_form import as_json
from adapt.diagnosis.texts.wording import sentence
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.output.diagnosis_figures import FIGURES, figures
from adapt.output.written_files import LIST
from models import load_model
from models.effects import EFFECTS
from motions import ANGLES, read_motions, write_motions

TABLES = ("fits.csv", "heldout.csv", "parameters.csv", "summary.csv")
FILES = sorted(["diagnosis.json", "positions.csv", "report.html", "run.json", LIST, *TABLES, *FIGURES])

# --- the command with a fake diagnosis ------------------------------------------------------------------------------

BOTH = {"R4": replace(NOTHING, model="R4", gaps=gap_of(3.0, 3.0)), "R2": TWO}
"""Fake diagnoses of two models; the gap of R2 is smaller."""

AS_IT_IS = {"noise_deg": None, "positions": "use", "position_noise_mm": None}
"""Options of the diagnosis where none is given."""

SIX_ANGLES = {"angles": "six"}
"""Option that the command handles itself: the diagnosis gets motions without the left-out angles."""

ROW = "subject,motion,posture,humerus_elevation_deg," + ",".join(f"{angle}_deg" for angle in ANGLES)
ROWS = [f"P1,abduction,{k},{30 * k},-30,12,7,32,{10 * k},-10" for k in range(1, 4)]


@pytest.fixture
def asked(monkeypatch) -> dict[str, Any]:
    """Replace the diagnosis by one that answers with two hand-made models; return the arguments that it gets."""
    asked: dict[str, Any] = {}
    made = []

    def adapted(motions, models, progress):
        made.append(adaptations(motions, models))
        return made[-1]

    def answer(motions, models, progress, adaptations, **given):
        progress("noise")
        assert adaptations is made[-1], "those of the tables"
        asked.update(models=[one.name for one in models], **given)
        return dict(BOTH)

    monkeypatch.setattr(cli, "diagnose_side_by_side", answer)
    monkeypatch.setattr(cli, "adapt_with_every_fold", adapted)
    return asked


def test_the_command_writes_its_files_and_nothing_else(asked, tmp_path):
    motion, out = written(tmp_path, [ROW, *ROWS]), tmp_path / "out"
    ended = girdle("diagnose", motion, "--model", "R4", "--model", "R2", "--out", out)
    assert (ended.status, ended.messages) == (0, [])
    assert asked == {"models": ["R4", "R2"], **AS_IT_IS}
    assert sorted(path.name for path in out.iterdir()) == FILES
    found = json.loads((out / "diagnosis.json").read_text())
    assert found == as_json(Diagnoses(BOTH))
    for name, svg in figures(TWO).items():
        assert (out / name).read_text() == svg
    record = json.loads((out / "run.json").read_text())
    assert (record["command"], record["options"]) == ("diagnose", AS_IT_IS | SIX_ANGLES)
    assert sentence(TWO) in " ".join(ended.out.split())
    assert max(map(len, ended.out.splitlines()[:-2])) <= 80, "nothing is cut, and nothing needs to be"


def test_the_terminal_says_cause_size_test_and_what_to_measure_and_type_next(asked, tmp_path):
    motion, out = written(tmp_path, [ROW, *ROWS]), tmp_path / "out"
    said = girdle("diagnose", motion, "--model", "R4", "--model", "R2", "--out", out).out
    words = " ".join(said.split())
    order = (
        "1. AC joint moves (ac_translation): 4.0 [3.9, 4.1] mm over the postures, up to 6.0 mm, mostly away from SC as",
        "goes from 2.00 to 1.40 deg. Tested on held-out motions and held-out persons.",
        "These data cannot tell it from conoid_strain.",
        "2. Scapula lifts off the thorax (scapulothoracic_gap): 12.0 [11.9, 12.1] mm over the postures, up to 18.0 mm",
        "something acts like it.",
        "Unexplained beyond noise: 24 % of the adapted gap. At the measured angles TS to the ellipsoid and length of "
        "the conoid are 1.2 and 1.1 mm off. Noise alone: 0.8 and 0.9 mm.",
        "Measure next: positions of SC and AC: in the 84 postures of the 5 persons, to 2 mm, with girdle convert. Gain",
        "Second choice: more persons: 10 in place of 5, by the same motions. Gain:",
    )
    places = [words.index(text) for text in order]
    assert places == sorted(places)
    assert "probability" not in said, "tables come with --tables"
    *_, next_line, page_line = said.rstrip().splitlines()
    causes = f"--own-bones --effects-of {out} --out {out}_adapted"
    assert next_line == f"Next: girdle adapt {motion} --model R2 {causes}"
    assert page_line == f"Open {out / 'report.html'}"


def test_five_angles_are_diagnosed_without_the_axial_rotation_and_so_is_what_to_type_next(asked, monkeypatch, tmp_path):
    seen, answer = [], cli.diagnose_side_by_side
    monkeypatch.setattr(
        cli, "diagnose_side_by_side", lambda motions, *a, **b: seen.append(motions) or answer(motions, *a, **b)
    )
    motion, out = written(tmp_path, [ROW, *ROWS]), tmp_path / "out"
    said = girdle("diagnose", motion, "--model", "R4", "--model", "R2", "--angles", "five", "--out", out).out
    assert np.isfinite(seen[0].angles_deg).all(axis=0).tolist() == [True, True, False, True, True, True]
    assert f"--model R2 --angles five --own-bones --effects-of {out}" in said
    assert json.loads((out / "run.json").read_text())["options"]["angles"] == "five"


def test_the_tables_show_the_gap_budget_first_and_then_the_causes(asked, tmp_path):
    motion = written(tmp_path, [ROW, *ROWS])
    said = girdle("diagnose", motion, "--model", "R4", "--model", "R2", "--tables", "--out", tmp_path / "out").out
    order = (
        "The gap on held-out motions",
        "Causes:",
        "Mean absolute gap",
        "Where:",
        "What to measure next",
        "Every parameter set",
    )
    places = [said.index(title) for title in order]
    assert places == sorted(places)
    rows = [line.split() for line in said.splitlines()]
    assert ["adapted", "2.80", "2.70-2.90", 20 * "#"] in rows
    assert ["+", "ac_translation", "1.40", "1.30-1.50", 10 * "#"] in rows
    assert ["ac_translation", "0.62", "50", "%", "4.0", "[3.9,", "4.1]", "mm", "3.0", "mm"] in rows
    assert ["or", "conoid_strain", "0.31"] in rows
    assert ["own", "bones", *3 * ["2.00", "[1.90,", "2.10]"]] in rows
    assert "(!)" in said


def test_without_a_cause_there_is_no_table_of_causes(monkeypatch, asked, tmp_path):
    nothing = replace(ONE, verdict=NOTHING.verdict, amplitude={})
    monkeypatch.setattr(cli, "diagnose_side_by_side", lambda *_, **__: {"R2": nothing})
    said = girdle("diagnose", written(tmp_path, [ROW, *ROWS]), "--tables", "--out", tmp_path / "out").out
    assert "Causes:" not in said
    assert "--effects-of" not in said
    assert "with the causes" not in said
    assert "Every parameter set" not in said


@pytest.mark.parametrize("noise_deg", [None, 1.7])
def test_a_repeated_diagnosis_asks_the_same_and_writes_the_same_bytes(asked, tmp_path, noise_deg):
    """The record alone gives the noise, where it was set, and both models."""
    motion, first, again = written(tmp_path, [ROW, *ROWS]), tmp_path / "first", tmp_path / "again"
    given = () if noise_deg is None else ("--noise-deg", noise_deg)
    assert girdle("diagnose", motion, "--model", "R4", "--model", "R2", *given, "--out", first).status == 0
    asked.clear()
    ended = girdle("diagnose", "--repeat", first / "run.json", "--out", again)
    assert (ended.status, ended.messages) == (0, [])
    assert asked == {"models": ["R4", "R2"], **AS_IT_IS, "noise_deg": noise_deg}
    assert sorted(path.name for path in again.iterdir()) == FILES
    for name in FILES:
        assert (again / name).read_bytes() == (first / name).read_bytes(), name


@pytest.mark.parametrize("noise", ["0", "-1", "nan", "inf", "100"])
def test_noise_that_cannot_be_is_refused(tmp_path, noise):
    motion = written(tmp_path, [ROW, *ROWS])
    ended = girdle("diagnose", motion, "--noise-deg", noise, "--out", tmp_path / "out")
    refused(ended, "--noise-deg", "is not between 0.1 and 20 degrees", "leave it to be estimated")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "word", "cause", "remedy"),
    [
        ("--positions", "chek", "there is no 'chek'", "Did you mean check? Use one of use, check, ignore"),
        ("--position-noise-mm", "0", "0 is not between 0.01 and 30 mm", "leave it to be estimated"),
        ("--position-noise-mm", "nan", "nan is not between 0.01 and 30 mm", "Give the SD of one coordinate in mm"),
        ("--position-noise-mm", "3", "the motions have no position of SC", "Leave --position-noise-mm out"),
        ("--positions check", "", "the motions have no position of SC", "Leave --positions check out"),
    ],
)
def test_words_of_positions_that_are_none_are_refused(tmp_path, option, word, cause, remedy):
    motion = written(tmp_path, [ROW, *ROWS])
    ended = girdle("diagnose", motion, *option.split(), *filter(None, [word]), "--out", tmp_path / "out")
    refused(ended, option, cause, remedy)
    assert not (tmp_path / "out").exists()


def test_noise_of_positions_that_are_ignored_is_refused(tmp_path):
    motion = written(tmp_path, [ROW, *ROWS])
    ended = girdle("diagnose", motion, "--positions", "ignore", "--position-noise-mm", "5", "--out", tmp_path / "out")
    refused(ended, "--position-noise-mm", "--positions ignore takes the positions", "Leave one of the two out")


def test_what_is_said_of_positions_is_carried_through(asked, tmp_path):
    with_sc = [f"{ROW},SC_x_mm,SC_y_mm,SC_z_mm", *(f"{row},25,-10,8" for row in ROWS)]
    motion, out = written(tmp_path, with_sc), tmp_path / "out"
    given = ("--positions", "check", "--position-noise-mm", "2.5")
    assert girdle("diagnose", motion, "--model", "R2", *given, "--out", out).status == 0
    assert (asked["positions"], asked["position_noise_mm"]) == ("check", 2.5)


BAD_INPUT = {
    "missing column": ([ROW.replace(",scapula_x_deg", ""), *ROWS], "column scapula_x_deg is missing", "Add it"),
    "too few postures": ([ROW, *ROWS], "no subject has 4 postures", "Give subjects with more postures"),
}


@pytest.mark.parametrize(("lines", "cause", "remedy"), BAD_INPUT.values(), ids=BAD_INPUT)
def test_bad_input_is_refused(tmp_path, lines, cause, remedy):
    ended = girdle("diagnose", written(tmp_path, lines), "--out", tmp_path / "out")
    assert ended.status == 2
    (message,) = ended.messages
    assert message.startswith("error: ")
    assert cause in message
    assert remedy in message
    assert not list(tmp_path.glob("out/*"))


def test_diagnose_is_part_of_the_python_api():
    assert diagnose.__module__ == "adapt.diagnosis.diagnosis"


# --- a real diagnosis -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real(tmp_path_factory) -> tuple[Ended, Path]:
    """Diagnose three simulated subjects whose scapula has a landmark bias, and one with three postures; noise given."""
    folder = tmp_path_factory.mktemp("diagnose")
    simulated = simulate_model_subjects(load_model("R2"), EFFECTS["scapula_landmark_bias"], 4, 1.5, 3).motions
    rows = np.arange(len(simulated.posture))
    last = np.flatnonzero(simulated.subject == "simulated04")[3:]
    write_motions(simulated.select(~np.isin(rows, last)), folder / "motions.csv")
    out = folder / "out"
    return girdle("diagnose", folder / "motions.csv", "--model", "R2", "--noise-deg", "1.7", "--out", out), out


def test_a_real_diagnosis_keeps_the_contract(real):
    ended, out = real
    text = (out / "diagnosis.json").read_text()
    found = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not strict JSON"))
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert found.keys() == as_json(Diagnoses({"R2": ONE})).keys()
    assert list(found["by_model"]) == ["R2"]
    assert found["by_model"]["R2"] == {key: value for key, value in found.items() if key != "by_model"}
    assert found["subjects"] == ["simulated01", "simulated02", "simulated03"]
    assert found["postures"] == 42
    assert {cell["angle"] for cell in found["where"]} == set(ANGLES)
    assert found["verdict"]["sentence"] in " ".join(ended.out.split())


def test_the_noise_given_is_used_and_reported(real):
    _, out = real
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["noise"] == {"angle_deg": 1.7, "source": "given", "freedom": None}
    assert json.loads((out / "run.json").read_text())["options"] == AS_IT_IS | SIX_ANGLES | {"noise_deg": 1.7}


def test_a_subject_with_too_few_postures_is_left_out_and_named(real):
    ended, out = real
    assert ended.status == 3
    why = "3 postures with more than 3 angles, fewer than 4"
    assert ended.messages == [f"not handled: simulated04: {why}"]
    assert json.loads((out / "diagnosis.json").read_text())["left_out"] == {"simulated04": why}


def test_a_recorded_trial_is_diagnosed_as_it_was_converted(tmp_path):
    """The angles were computed from the landmarks in the same file, so the landmarks do not count as well."""
    converted = tmp_path / "trial.csv"
    ended = girdle("convert", SHIPPED.parent / "simulated_trial.trc", converted, "--at", "0,20,40,60,80,100,120")
    assert ended.status == 0
    motions = read_motions(converted)
    assert "SC" in motions.landmarks_mm
    effects = [EFFECTS[name] for name in ("scapula_landmark_bias", "sc_translation")]
    (found,) = diagnose(motions, load_model("R2"), effects=effects).values()
    assert not found.verdict.causes, "of one motion of one person"
