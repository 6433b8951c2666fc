"""A few of the broken files of scripts/fuzz_readers.py; `make fuzz` tries thousands."""

import tempfile
from pathlib import Path

import pytest

from motions import InputError
from motions.formats.marker_files import c3d
from motions.landmarks.mapping import read_mapping
from scripts.fuzz_readers import READ, REFUSED, Kind, file_number, kinds, outcome

SEED, FEW = 7, 40
with tempfile.TemporaryDirectory() as _folder:
    _KINDS = kinds(Path(_folder))
NAMES = [name for name, kind in _KINDS.items() if not kind.in_child]
IN_CHILD = [name for name, kind in _KINDS.items() if kind.in_child]


@pytest.fixture(scope="module")
def every(tmp_path_factory) -> dict[str, Kind]:
    """Return all kinds of files, in one folder as in ``make fuzz``; making valid files takes a tenth of a second."""
    return kinds(tmp_path_factory.mktemp("kinds"))


@pytest.mark.parametrize("name", [*NAMES, *IN_CHILD])
def test_the_valid_file_is_read(every, tmp_path, name):
    kind = every[name]
    assert outcome(kind, kind.valid, tmp_path) == READ


@pytest.mark.parametrize("name", NAMES)
def test_broken_files_are_read_or_refused_in_one_line(every, tmp_path, name):
    kind = every[name]
    found = [outcome(kind, file_number(kind, SEED, number), tmp_path) for number in range(FEW)]
    assert set(found) <= {READ, REFUSED}
    assert REFUSED in found or name == "list of a run"  # this reader skips invalid lines


def test_a_surface_on_which_vtk_crashes_ends_in_a_message(every, tmp_path):
    """Found by fuzzing: for a PLY file without vertex_indices vtk frees memory that it never allocated."""
    kind = every["ply"]
    (tmp_path / "x.ply").write_bytes(kind.valid.replace(b"vertex_indices", b"indices"))
    with pytest.raises(InputError, match=r"vtk cannot read the file|no whole surface"):
        kind.read(tmp_path / "x.ply")


def test_a_reader_that_fails_is_found_out(every, tmp_path):
    """Test of the check itself: another exception class, and a warning."""

    def raising(error: Exception):
        def read(_):
            raise error

        return read

    kind = every["mapping"]
    for error in (KeyError("x"), ValueError("x"), RuntimeWarning("x"), RecursionError()):
        said = outcome(type(kind)(kind.ending, raising(error), b""), b"", tmp_path)
        assert said not in (READ, REFUSED)


def test_an_error_that_quotes_a_file_is_one_printable_line():
    """Found by fuzzing: names of columns and markers that contain control characters."""
    error = InputError("f\n", None, "column 'A\tI' is\ntwice", "Rename \x1b[31mit")
    assert str(error) == "f?: column 'A?I' is?twice. Rename ?[31mit."


def test_a_mapping_nested_too_deep_ends_in_a_message(tmp_path):
    """Regression test for a fault found by fuzzing."""
    (tmp_path / "map.toml").write_text("axes = " + "[" * 5000)
    with pytest.raises(InputError, match="not a TOML file"):
        read_mapping(tmp_path / "map.toml")


def crashing_c3d(every: dict[str, Kind]) -> bytes:
    """Return a .c3d file with a byte count in a parameter that makes ezc3d 1.6 read outside its memory."""
    return file_number(every["c3d"], 1, 26)


def test_a_c3d_file_on_which_ezc3d_crashes_ends_in_a_message(every, tmp_path):
    (tmp_path / "x.c3d").write_bytes(crashing_c3d(every))
    with pytest.raises(InputError, match=r"ezc3d cannot read the file \(it crashes\)"):
        c3d.read_c3d(tmp_path / "x.c3d")


def test_a_c3d_file_that_ezc3d_reads_for_ever_ends_in_a_message(every, tmp_path, monkeypatch):
    monkeypatch.setattr(c3d, "_PATIENCE_S", 0.0)
    (tmp_path / "x.c3d").write_bytes(every["c3d"].valid)
    with pytest.raises(InputError, match="does not come to an end"):
        c3d.read_c3d(tmp_path / "x.c3d")
