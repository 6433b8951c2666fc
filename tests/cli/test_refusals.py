"""Bad input on the command line: exit status 2, one line with place, cause and remedy, and no files written."""

import subprocess
import sys
from pathlib import Path

import pytest
from command import Ended, girdle, refused, shipped_lines, written

from models.parameter_sets import FOLDER


@pytest.fixture(scope="module")
def motion(tmp_path_factory) -> Path:
    """Write two shipped subjects; all runs of this file have these shapes, so that little is compiled."""
    return written(tmp_path_factory.mktemp("motion"), shipped_lines())


HEADER = (
    "subject,motion,posture,humerus_elevation_deg,clavicle_y_deg,clavicle_z_deg,clavicle_x_deg,"
    "scapula_y_deg,scapula_z_deg,scapula_x_deg"
)
ROWS = [f"P1,abduction,{k},{30 * k},-30,12,7,32,{10 * k},-10" for k in range(1, 4)]
LEFT = [f"P1,abduction,{k},{30 * k},30,-12,7,-32,-11,-10" for k in range(1, 4)]
RADIANS = [f"P1,abduction,{k},{30 * k},-0.52,0.21,0.12,0.56,0.{k},-0.17" for k in range(1, 4)]
METRES = [f"{row},0.17,0.02,0.05" for row in ROWS]

BAD_MOTIONS = {
    "column in capitals": (
        [HEADER.replace("scapula_x_deg", "Scapula_X_deg"), *ROWS],
        1,
        "column scapula_x_deg is missing",
        "Rename Scapula_X_deg",
    ),
    "missing column": ([HEADER.replace(",scapula_x_deg", ""), *ROWS], 1, "column scapula_x_deg is missing", "Add it"),
    "radians": ([HEADER, *RADIANS], 2, "look like radians", "in degrees"),
    "metres": ([HEADER + ",AC_x_mm,AC_y_mm,AC_z_mm", *METRES], 2, "look like metres", "in mm"),
    "row of NaN": ([HEADER, *ROWS, "P1,abduction,4,120" + ",nan" * 6], 5, "no angle was measured", "Delete the row"),
    "duplicate posture": ([HEADER, *ROWS, ROWS[1]], 5, "posture 2 of motion 'abduction'", "Delete one"),
    "unmarked left shoulder": ([HEADER, *LEFT], 2, "looks like a left shoulder", "column side with the word left"),
    "table of fits": (["model,subject,clavicle_y_simulated_deg", "R2,P1,3"], 1, "are missing", "table of results"),
    "table of parameters": (["model,A_x_mm,conoid_length_mm_model", "R2,3,4"], 1, "are missing", "run.json beside it"),
    "empty file": ([], None, "the file is empty", "Give a file with a header"),
    "no rows": ([HEADER], None, "no rows under the header", "Add one row"),
}


@pytest.mark.parametrize("command", ["fit", "adapt"])
@pytest.mark.parametrize(("lines", "row", "cause", "remedy"), BAD_MOTIONS.values(), ids=BAD_MOTIONS)
def test_a_bad_motion_file_is_refused(tmp_path, command, lines, row, cause, remedy):
    path = written(tmp_path, lines)
    ended = girdle(command, path, "--out", tmp_path / "out")
    refused(ended, str(path) if row is None else f"{path}, line {row}", cause, remedy)
    assert not (tmp_path / "out").exists()


BAD_OPTIONS = {
    "unknown model": (["--model", "R3"], "R3", "no parameter set of this name", "The sets are R2, R4, R6"),
    "misspelt model": (["--model", "breteler_mir"], "breteler_mir", "no parameter set", "Did you mean breteler_mri?"),
    "model file not there": (["--model", "no.toml"], "no.toml", "cannot be read", "Check the path"),
    "one model twice": (["--model", "R2", "--model", "R2"], "--model", "two models are called 'R2'", "Give each one"),
    "unknown objective": (["--reading", "mm_deg"], "--objective", "unknown variant 'mm_deg'", "Use one of mm2_deg2"),
}


@pytest.mark.parametrize(("options", "where", "cause", "remedy"), BAD_OPTIONS.values(), ids=BAD_OPTIONS)
def test_a_bad_option_is_refused(tmp_path, motion, options, where, cause, remedy):
    ended = girdle("adapt", motion, "--out", tmp_path / "out", *options)
    refused(ended, where, cause, remedy)
    assert not (tmp_path / "out").exists()


def test_two_files_with_models_of_one_name_are_refused(tmp_path, motion):
    for name in ("first.toml", "second.toml"):
        (tmp_path / name).write_text((FOLDER / "R4.toml").read_text())
    models = ["--model", tmp_path / "first.toml", "--model", tmp_path / "second.toml"]
    ended = girdle("fit", motion, *models, "--out", tmp_path / "out")
    refused(ended, "--model", "two models are called 'R4'", 'the line name = "R4" of its TOML file')
    assert not (tmp_path / "out").exists()


def test_a_motion_file_that_is_not_there_is_refused(tmp_path, motion):
    ended = girdle("fit", motion, tmp_path / "no.csv", "--out", tmp_path / "out")
    refused(ended, str(tmp_path / "no.csv"), "does not exist", "Check its name")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("below", ["", "below/it"])
def test_a_file_where_the_folder_should_be_is_refused(tmp_path, motion, below):
    blocked = tmp_path / "out"
    blocked.write_text("mine")
    ended = girdle("fit", motion, "--out", blocked / below)
    refused(ended, str(blocked / below), "cannot be written to", "--out")
    assert blocked.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    "arguments", [["fit"], ["fit", "m.csv"], ["adapt", "m.csv", "--out", "out", "--weight", "-1"], ["fly"]]
)
def test_a_command_that_cannot_be_understood_is_status_2(arguments):
    ended = girdle(*arguments)
    assert ended.status == 2
    assert "Usage" in ended.err
    assert "Traceback" not in ended.err


@pytest.mark.parametrize("option", [("--model", "R4"), ("--effect", "none"), ("--seed", "2")])
def test_an_option_that_takes_one_is_not_given_twice(tmp_path, option):
    """Otherwise the last value would silently replace the first."""
    ended = girdle("simulate", "--model", "R2", "--effect", "conoid_strain", "--seed", "1", *option, "--out", tmp_path)
    assert ended.status == 2
    assert f"{option[0]} is there 2 times. Give it once." in ended.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("weight", "cause", "remedy"),
    [
        ("inf", "w of E = D + w mean(J) is inf", "between 0 and 100000, as 10"),
        ("1e308", "w of E = D + w mean(J) is 1e+308", "between 0 and 100000, as 10"),
        ("0", "with w = 0 the measured angles have no part in E", "use girdle fit"),
    ],
)
@pytest.mark.parametrize("command", ["adapt", "trust", "muscles"])
def test_a_weight_with_which_nothing_is_adapted_is_refused(tmp_path, motion, command, weight, cause, remedy):
    refused(girdle(command, motion, "--weight", weight, "--out", tmp_path / "out"), "--weight", cause, remedy)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("number", ["inf", "nan"])
@pytest.mark.parametrize(
    "arguments",
    [
        ["adapt", "m.csv", "--weight"],
        ["adapt", "m.csv", "--thorax-downweighting"],
        ["diagnose", "m.csv", "--noise-deg"],
        ["diagnose", "m.csv", "--position-noise-mm"],
        ["muscles", "m.csv", "--body-mass-kg"],
        ["simulate", "--noise-deg"],
        ["contour", "s.png", "--clicks", "c.csv", "--vector-px"],
        ["contour", "s.png", "--clicks", "c.csv", "--half-width-px"],
        ["contour", "s.png", "--clicks", "c.csv", "--pixel-mm"],
        ["contour", "s.png", "--clicks", "c.csv", "--slice-mm"],
        ["convert", "m.trc", "m.csv", "--at"],
    ],
)
def test_what_is_no_number_is_refused_by_its_option(arguments, number):
    ended = girdle(*arguments, number, *(["--out", "out"] if arguments[0] != "convert" else []))
    assert ended.status == 2
    assert arguments[-1] in ended.err
    assert "Traceback" not in ended.err


def test_the_installed_command_exits_with_2_and_one_line(tmp_path):
    """The command runs as a separate process, as from a shell."""
    command = [str(Path(sys.executable).with_name("girdle")), "fit", "no.csv", "--out", "out"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    refused(Ended(ended.returncode, ended.stdout, ended.stderr), "no.csv", "does not exist", "Check its name")
    assert list(tmp_path.iterdir()) == []
