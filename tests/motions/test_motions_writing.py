"""Writing motion files: the same arrays are read back, and a file is complete or absent."""

import csv
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motions import ANGLES, LANDMARKS, InputError, Motions, read_motions, write_motions
from motions.errors import InputWarning
from motions.files import atomic_write

NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=6).filter(
    lambda name: name == name.strip()
)
CELLS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=6)
# Scapular protraction and lateral rotation above pi, and clavicular retraction: neither radians nor a left shoulder.
ANGLE = st.floats(-180.0, 180.0) | st.just(np.nan)
PROTRACTION, RETRACTION = st.floats(20.0, 60.0), st.floats(-60.0, -4.0)
# Large enough to be read as mm.
COORDINATE = st.floats(50.0, 1e6)


@st.composite
def fields(draw) -> dict:
    """Draw fields of Motions that can be read back."""
    count = draw(st.integers(1, 5))

    def column(values: st.SearchStrategy) -> np.ndarray:
        return np.array(draw(st.lists(values, min_size=count, max_size=count)))

    strategies = {"clavicle_y": RETRACTION, "scapula_y": PROTRACTION, "scapula_z": st.floats(4.0, 90.0)}
    landmarks = draw(st.sets(st.sampled_from(LANDMARKS)))
    position = st.tuples(COORDINATE, COORDINATE, COORDINATE) | st.just((np.nan,) * 3)
    return {
        "subject": column(NAMES),
        "motion": column(NAMES),
        "posture": np.arange(count) + draw(st.integers(-5, 10**9)),
        "humerus_elevation_deg": column(st.floats(4.0, 180.0) | st.just(np.nan)),
        "angles_deg": np.column_stack([column(strategies.get(angle, ANGLE)) for angle in ANGLES]),
        "landmarks_mm": {name: column(position) for name in LANDMARKS if name in landmarks},
        "extra": pd.DataFrame({"a note": column(CELLS)}, dtype=str),
    }


def assert_same(left: Motions, right: Motions) -> None:
    assert left.subject.tolist() == right.subject.tolist()
    assert left.motion.tolist() == right.motion.tolist()
    np.testing.assert_array_equal(left.posture, right.posture)
    np.testing.assert_array_equal(left.humerus_elevation_deg, right.humerus_elevation_deg)
    np.testing.assert_array_equal(left.angles_deg, right.angles_deg)
    assert list(left.landmarks_mm) == list(right.landmarks_mm)
    for name, position_mm in left.landmarks_mm.items():
        np.testing.assert_array_equal(position_mm, right.landmarks_mm[name])
    assert left.extra.to_dict("list") == right.extra.to_dict("list")


@settings(max_examples=100, deadline=None)
@given(arrays=fields())
def test_what_was_written_is_read_again(tmp_path_factory, arrays):
    motions, path = Motions(**arrays), tmp_path_factory.getbasetemp() / "round_trip.csv"
    write_motions(motions, path)
    with warnings.catch_warnings(action="ignore", category=InputWarning):  # random angles are implausible
        assert_same(read_motions(path), motions)


def test_a_left_shoulder_is_mirrored_once_only(tmp_path):
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    header = "subject,motion,posture,humerus_elevation_deg," + ",".join(f"{angle}_deg" for angle in ANGLES)
    first.write_text(f"{header},side\nP1,abduction,1,0,30,-12,7,-32,-11,-10,left\n")
    once = read_motions(first)
    write_motions(once, second)
    assert_same(read_motions(second), once)


def test_not_measured_is_an_empty_cell(tmp_path):
    path = tmp_path / "m.csv"
    motions = Motions(
        subject=np.array(["P1"]),
        motion=np.array(["abduction"]),
        posture=np.array([1]),
        humerus_elevation_deg=np.array([np.nan]),
        angles_deg=np.array([[-30.0, 0.1, np.nan, 32.0, 1e-17, -10.0]]),
        landmarks_mm={"AC": np.array([[170.0, np.nan, np.nan]])},
        extra=pd.DataFrame(index=range(1)),
    )
    write_motions(motions, path)
    with path.open(newline="") as lines:
        header, row = csv.reader(lines)
    assert header[-3:] == ["AC_x_mm", "AC_y_mm", "AC_z_mm"]
    assert row == ["P1", "abduction", "1", "", "-30.0", "0.1", "", "32.0", "1e-17", "-10.0", "170.0", "", ""]


@pytest.mark.parametrize("name", ["nowhere/m.csv", "file.csv/m.csv", "folder"])
def test_a_place_that_cannot_be_written(tmp_path, name):
    (tmp_path / "file.csv").write_text("kept")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="cannot be written") as caught:
        atomic_write(tmp_path / name, "text")
    assert (caught.value.file, caught.value.row) == (str(tmp_path / name), None)
    assert "folder that exists" in caught.value.remedy
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file.csv", "folder"]


def test_a_write_that_breaks_off_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "m.csv"
    atomic_write(path, "old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match="No space left on device"):
        atomic_write(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_is_replaced_and_line_ends_are_kept(tmp_path):
    path = tmp_path / "m.csv"
    atomic_write(path, "old")
    atomic_write(str(path), "ä\r\nb\n")
    assert path.read_bytes() == "ä\r\nb\n".encode()
    assert list(tmp_path.iterdir()) == [path]
