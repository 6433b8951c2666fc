"""Refusals of --repeat: changed inputs, records of other commands, invalid records."""

import importlib.metadata
import json
from pathlib import Path

import pytest
from command import girdle, refused, written

from adapt.output import repeat
from adapt.output.run_files import inputs_record, versions, write_run
from models.parameter_sets import FOLDER


@pytest.fixture
def record(tmp_path) -> Path:
    """Write the record of an invented run, of two motion files, a shipped model and one of the user's own."""
    motions = [written(tmp_path, [f"x{k}"], f"{k}.csv") for k in (1, 2)]
    own = tmp_path / "own.toml"
    own.write_text((FOLDER / "R2.toml").read_text().replace('"R2"', '"own"'))
    inputs = inputs_record(motions, ["R4", str(own)])
    write_run(tmp_path, "adapt", inputs, {"weight": 5.0, "objective": "mm2_deg2"})
    return tmp_path / "run.json"


def changed(record: Path, **entries: object) -> None:
    record.write_text(json.dumps(json.loads(record.read_text()) | entries))


@pytest.mark.parametrize("name", ["2.csv", "own.toml"])
def test_an_input_that_changed_is_named(record, tmp_path, name):
    with (tmp_path / name).open("a") as file:
        file.write("\n")
    ended = girdle("adapt", "--repeat", record, "--out", tmp_path / "out")
    refused(ended, str(tmp_path / name), f"the file has changed since the run of {record}", "Put it back as it was")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["1.csv", "own.toml"])
def test_an_input_that_is_gone_is_named(record, tmp_path, name):
    (tmp_path / name).unlink()
    ended = girdle("adapt", "--repeat", record, "--out", tmp_path / "out")
    refused(ended, str(tmp_path / name), "no longer where it was", "run the command without --repeat")


def test_a_record_of_another_command(record, tmp_path):
    ended = girdle("fit", "--repeat", record, "--out", tmp_path / "out")
    refused(ended, str(record), "the record of 'girdle adapt', not of 'girdle fit'", "girdle adapt --repeat")


def test_a_record_does_not_say_where_to_write(record, tmp_path):
    """The output folder of a record is not used, even where --out is missing."""
    changed(record, options={"weight": 5.0, "out": str(tmp_path / "elsewhere")})
    ended = girdle("adapt", "--repeat", record)
    refused(ended, str(record), "girdle adapt has no option 'out' to repeat", "Give the run.json of a run")
    assert not (tmp_path / "elsewhere").exists()


def test_a_record_is_read_once(record, tmp_path, monkeypatch):
    """The file may be a pipe, or change a moment later."""
    read = []
    monkeypatch.setattr(repeat, "read_text", lambda path, remedy: read.append(path) or path.read_text())
    changed(record, versions={})
    ended = girdle("adapt", "--repeat", record, "--out", tmp_path / "out")
    assert "the last digits may differ" in ended.err
    assert read == [record]


def test_other_versions_are_a_note(record, tmp_path):
    """The run continues: here to its first file, which does not exist."""
    versions = json.loads(record.read_text())["versions"]
    changed(record, versions=versions | {"numpy": "0.1"})
    ended = girdle("adapt", "--repeat", record, "--out", tmp_path / "out")
    assert ended.status == 2
    note, error = ended.messages
    assert note == f"note: the last digits may differ: numpy 0.1, now {versions['numpy']}"
    assert error.startswith(f"error: {tmp_path / '1.csv'}, line 1: columns subject, ")


def test_a_library_that_is_missing_is_recorded_as_none(monkeypatch):
    """llvmlite may be missing: XLA does its work."""

    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert versions()["llvmlite"] == "none"


NO_RECORDS = {
    "no file": (None, "cannot be read"),
    "no JSON": (b"{", "not a JSON file"),
    "deep": (b"[" * 100_000, "not a JSON file"),
    "a list": (b"[]", "not the record of a run"),
    "empty": (b"{}", "not the record of a run"),
    "files by number": (
        b'{"command": "adapt", "options": {}, "versions": {}, "motions": [1], "models": []}',
        "not the record of a run",
    ),
    "no model": (
        b'{"command": "adapt", "options": {}, "versions": {}, "motions": [], "models": []}',
        "not the record of a run",
    ),
}


@pytest.mark.parametrize(("content", "cause"), NO_RECORDS.values(), ids=NO_RECORDS)
def test_what_is_no_record(tmp_path, content, cause):
    path = tmp_path / "run.json"
    if content is not None:
        path.write_bytes(content)
    refused(girdle("adapt", "--repeat", path, "--out", tmp_path / "out"), str(path), cause, "")


@pytest.mark.parametrize("weight", ["x", [1], {"a": 1}, -1, True, None, 1e999])
def test_an_option_of_another_kind_is_status_2(record, tmp_path, weight):
    """For null and true, which the command line accepts as a weight, the error is that of the first file."""
    changed(record, options={"weight": weight})
    ended = girdle("adapt", "--repeat", record, "--out", tmp_path / "out")
    assert ended.status == 2
    assert "Traceback" not in ended.err
