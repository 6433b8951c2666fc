"""The page without a browser: upload names, limits, mapping, reading messages, child processes, the zip."""

import asyncio
import os
import socket
import subprocess
import sys
import tomllib
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from command import girdle, refused, shipped_lines, written
from handmade import motions_of, rising

from adapt.cli.ending import ENDS_WITH_STDIN
from adapt.cli.local_page import uploads
from adapt.cli.local_page.child_runs import PROGRESS, PROGRESS_LINES, Children
from adapt.cli.local_page.marker_names import HEADING, guessed, mapping_toml, pointing_here
from adapt.cli.local_page.session import MAPPING, LaboratoryOptions, Session, convert_arguments
from adapt.cli.local_page.uploads import State, TrialLabels, Upload, accepted, shown_name, with_own_names
from adapt.cli.local_page.what_was_read import subjects_read, warnings
from motions import InputError

ROOT = Path(__file__).parents[2]

ENDS_WITHIN_S = 60
"""Time limit on a machine that is busy with other tests."""


@pytest.mark.parametrize(
    "client_name", ["../../etc/passwd.csv", "C:\\lab\\..\\trial.csv", "/root/.ssh/x.csv", "a\x1b[31m/..\\b.CSV"]
)
def test_a_browsers_name_gives_no_place(client_name):
    upload = accepted(client_name, 10, [])
    assert upload.stored == "001.csv"
    assert "/" not in upload.own_name
    assert "\\" not in upload.own_name
    assert upload.own_name.isprintable()


def test_a_number_is_not_given_twice_while_its_file_is_there():
    first = accepted("a.csv", 1, [])
    second = accepted("a.csv", 1, [first])
    assert [first.stored, second.stored, accepted("b.trc", 1, [second]).stored] == ["001.csv", "002.csv", "003.trc"]


@pytest.mark.parametrize(
    ("name", "size", "cause"),
    [
        ("run.exe", 5, "this kind of file is not known"),
        ("noending", 5, "this kind of file is not known"),
        ("a.csv", 0, "the file is empty"),
        ("a.c3d", uploads.LARGEST_FILE_BYTES + 1, "larger than 200 MB"),
    ],
)
def test_what_is_refused_says_why(name, size, cause):
    with pytest.raises(InputError, match=cause) as refused:
        accepted(name, size, [])
    assert refused.value.file == name


def test_a_session_has_its_limits():
    many = [Upload(f"{number:03}.csv", "a.csv", 1) for number in range(uploads.MOST_FILES)]
    with pytest.raises(InputError, match="more than 200 files"):
        accepted("b.csv", 1, many)
    large = [Upload(f"{number:03}.c3d", "a.c3d", uploads.LARGEST_FILE_BYTES) for number in range(5)]
    with pytest.raises(InputError, match="1 GB"):
        accepted("b.csv", 1, large)


def test_labels_are_proposed_by_the_name():
    assert uploads.first_labels("P01_abduction.trc") == TrialLabels("P01", "abduction", at=uploads.USUAL_ELEVATIONS)
    assert uploads.first_labels("walk.mot") == TrialLabels("walk", "walk")


def test_messages_have_the_persons_names_of_files():
    known = [Upload("001.trc", "P01.trc", 1), Upload("002.csv", "two.csv", 1)]
    said = with_own_names("uploads/001.trc: bad. motions/002.csv, line 3: worse.", known)
    assert said == "P01.trc: bad. two.csv, line 3: worse."
    assert shown_name("") == "without a name"


def test_landmarks_are_guessed_by_their_names_alone():
    assert guessed(["P01:IJ", "PX", "x:PX", "a:C7", "b:C7", "ac "]) == {"IJ": "P01:IJ", "PX": "PX", "AC": "ac "}


def test_messages_name_the_controls_of_the_page():
    said = pointing_here("Name its marker in a mapping file (--map), or place it with --sc-from-ij kaptein1999")
    assert said == f'Name its marker below, under "{HEADING}", or place it with "SC from IJ" kaptein1999'
    kept = 'turn one round with axes = ["x", "y", "-z"] in a mapping file (--map)'
    assert pointing_here(kept) == kept  # the page has no control for this option, so the text stays


def test_the_mapping_is_what_convert_reads():
    names = {"IJ": 'a "quoted" \\ name\x7f', "C7": "2*b - c", "AC": ""}
    read = tomllib.loads(mapping_toml(names, "cm"))
    assert read == {"unit": "cm", "markers": {"IJ": names["IJ"], "C7": "2*b - c"}}


def test_convert_is_told_what_the_page_says():
    trial = Upload("001.trc", "a.trc", 1, TrialLabels("-P", "up", "left", "30,60"), markers=("IJ",))
    said = convert_arguments(trial, LaboratoryOptions({}, aa_to_ac="kolz2020"))
    assert said == [
        *("convert", "uploads/001.trc", "motions/001.csv", "--subject=-P", "--motion=up", "--side=left"),
        *("--at=30,60", f"--map={MAPPING}", "--aa-to-ac=kolz2020"),
    ]
    assert len(convert_arguments(Upload("002.csv", "b.csv", 1, TrialLabels("P")), LaboratoryOptions({}))) == 3


def test_what_was_read_names_what_is_missing():
    motions = motions_of(rising(2, 5), motion="abduction")
    motions.angles_deg[0, 2] = np.nan
    motions.angles_deg[motions.subject == motions.subjects[1], 3] = np.nan
    first, second = subjects_read(motions)
    assert (first.motions, first.postures) == ("abduction (5)", 5)
    assert first.missing == "clavicle axial rotation in 1 of 5"
    assert second.missing == "scapula protraction"
    low, high = motions.humerus_elevation_deg.min(), motions.humerus_elevation_deg.max()
    assert first.elevation == f"{low:.0f} to {high:.0f}"
    assert warnings(motions)[0].startswith(f"{first.subject} has one motion only")
    few = warnings(motions.select(np.arange(len(motions.posture)) < 3))
    assert few == [f"{first.subject} has fewer than 4 postures: the diagnosis leaves it out."]


@pytest.fixture
def session(tmp_path) -> Session:
    return Session(tmp_path)


def test_the_zip_has_everything_and_whose_file_is_which(session):
    upload = session.place("../mine.csv", 3)
    (session.folder / upload.source).write_text("abc")
    (session.folder / upload.motions).write_text("def")
    (session.folder / "adapt").mkdir()
    (session.folder / "adapt" / "report.html").write_text("<p>")
    upload.state = State.READ
    with ZipFile(session.zipped()) as archive:
        assert set(archive.namelist()) == {
            *("files.csv", "uploads/001.csv", "motions/001.csv", "adapt/report.html"),
        }
        assert archive.read("files.csv").decode().splitlines()[1] == "uploads/001.csv,mine.csv,motions/001.csv"
        assert archive.read("uploads/001.csv") == b"abc"


def test_only_reports_are_given_out(session):
    (session.folder / "adapt").mkdir()
    (session.folder / "adapt" / "report.html").write_text("<p>")
    (session.folder / "motions" / "report.html").write_text("<p>")
    assert session.report("adapt") == session.folder / "adapt" / "report.html"
    assert session.report("diagnose") is None
    assert session.report("motions") is None
    assert session.report("../adapt") is None


def test_nothing_is_left_of_a_closed_session(session, tmp_path):
    session.place("a.csv", 1)
    session.close()
    assert list(tmp_path.iterdir()) == []


def test_a_child_says_how_it_ended_and_can_be_cancelled(tmp_path):
    children = Children(tmp_path)

    async def both():
        running = asyncio.create_task(children.girdle(["models"]))
        while not children._running:
            await asyncio.sleep(0.01)
        children.cancel()
        return await running

    cancelled = asyncio.run(both())
    assert cancelled.cancelled
    assert not cancelled.useful
    assert cancelled.message == "Cancelled. Nothing was kept of this run."
    assert not children._running


def test_a_command_tells_the_page_its_stages(monkeypatch, tmp_path):
    """The stages go through the pipe that the page reads, and only where there is one."""
    motions, out = written(tmp_path, shipped_lines(1)), tmp_path / "out"
    assert not [line for line in girdle("fit", motions, "--out", out).messages if line.startswith(PROGRESS)]
    monkeypatch.setenv(PROGRESS_LINES, "1")
    assert f"{PROGRESS}posture fits" in girdle("fit", motions, "--out", out).messages


def test_without_its_extra_the_command_says_what_to_install(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    refused(girdle("app"), "girdle app", "nicegui, which is not installed", f"{sys.executable} -m pip install nicegui")


def test_a_port_that_is_taken_is_named():
    pytest.importorskip("nicegui", reason="nicegui, of the extra app, is not installed")
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        refused(
            girdle("app", "--port", port, "--no-browser"), "--port", f"port {port} cannot be used", "Choose another"
        )


def test_a_command_of_the_page_ends_with_the_page():
    """However the page ends, the other end of the command's standard input is then closed."""
    pytest.importorskip("nicegui", reason="nicegui, of the extra app, is not installed")
    command = [sys.executable, "-P", "-m", "adapt", "app", "--no-browser"]
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
    environment |= {ENDS_WITH_STDIN: "1", "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as waiting:
        assert waiting.stdin is not None
        assert waiting.stdout is not None
        assert b"girdle app at" in waiting.stdout.readline()
        waiting.stdin.close()
        assert waiting.wait(ENDS_WITHIN_S) == 1
