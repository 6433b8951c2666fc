"""``girdle drive``: coordinates to postures and back, its files and refusals."""

import numpy as np
import pandas as pd
import pytest

from adapt.tables.driven_table import coordinates_of_postures
from models import load_model
from models.girdle import landmarks
from motions import read_motions
from motions.motion_csv.columns import ANGLE_COLUMNS
from motions.rotations import DEG
from tests.helpers.command import girdle, refused, shipped_lines, written

COORDINATES = ["AC_y_mm", "AC_z_mm", "TS_x_mm"]

ROUND_TRIP_DEG = 1e-9
"""Tolerance as in tests/models/test_drive.py."""


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    """Write a motion file: postures of the shipped subjects closed with R2, with its landmarks."""
    home = tmp_path_factory.mktemp("drive")
    written(home, shipped_lines(1))
    assert girdle("fit", home / "motion.csv", "--out", home / "fit").status == 0
    assert girdle("convert", home / "fit" / "fits.csv", home / "closed.csv").status == 0
    return home / "closed.csv"


def test_closed_postures_go_to_coordinates_and_back(closed, tmp_path):
    back = girdle("drive", closed, "--inverse", "--out", tmp_path / "back")
    assert back.status == 0, back.err
    table = pd.read_csv(tmp_path / "back" / "driven.csv")
    motions = read_motions(closed)
    at = landmarks(load_model("R2").girdle.repeated(len(table)), motions.angles_deg.T / DEG)
    np.testing.assert_allclose(table[COORDINATES].T, [at.AC[1], at.AC[2], at.TS[0]], atol=1e-12)
    assert table[["a1_mm", "a2_mm", "a3_mm"]].abs().to_numpy().max() < 1e-6
    driven = girdle("drive", tmp_path / "back" / "driven.csv", "--out", tmp_path / "there")
    assert driven.status == 0, driven.err
    found = read_motions(tmp_path / "there" / "motions.csv")
    np.testing.assert_allclose(found.angles_deg, motions.angles_deg, atol=1e-6)
    again = girdle("drive", tmp_path / "there" / "motions.csv", "--out", tmp_path / "again")  # from written AC and TS
    assert again.status == 0, again.err
    np.testing.assert_allclose(
        pd.read_csv(tmp_path / "again" / "driven.csv")[list(ANGLE_COLUMNS)], found.angles_deg, atol=ROUND_TRIP_DEG
    )
    onto = girdle("drive", tmp_path / "back" / "driven.csv", "--out", tmp_path / "back")
    refused(
        onto, str(tmp_path / "back"), "this run reads driven.csv in this folder and would replace it", "another folder"
    )
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "back" / "driven.csv"), table)
    whole = girdle("drive", "--repeat", tmp_path / "back" / "run.json", "--out", tmp_path / "repeated")
    assert whole.status == 0, whole.err
    assert (tmp_path / "repeated" / "driven.csv").read_bytes() == (tmp_path / "back" / "driven.csv").read_bytes()


def test_a_posture_out_of_reach_is_named_and_the_others_stay(tmp_path):
    lines = ["AC_y_mm,AC_z_mm,TS_x_mm", "45,80,55", "500,80,55"]
    ended = girdle("drive", written(tmp_path, lines), "--out", tmp_path / "out")
    assert ended.status == 3
    assert "not handled: motion: 1 unreachable_AC of 2 postures" in ended.err
    table = pd.read_csv(tmp_path / "out" / "driven.csv")
    assert table["status"].tolist() == ["ok", "unreachable_AC"]
    assert table.loc[1, list(ANGLE_COLUMNS)].isna().all()
    assert len(read_motions(tmp_path / "out" / "motions.csv").posture) == 1


def test_centimetres_are_coordinates_too(tmp_path):
    for unit, cells in (("mm", "45,80,55"), ("cm", "4.5,8.0,5.5")):
        header = ",".join(f"{name}_{unit}" for name in ("AC_y", "AC_z", "TS_x"))
        path = written(tmp_path, [header, cells], f"{unit}.csv")
        assert girdle("drive", path, "--out", tmp_path / unit).status == 0
    mm, cm = (pd.read_csv(tmp_path / unit / "driven.csv") for unit in ("mm", "cm"))
    np.testing.assert_allclose(cm[list(ANGLE_COLUMNS)], mm[list(ANGLE_COLUMNS)], atol=ROUND_TRIP_DEG)


def test_measured_angles_that_do_not_close_say_by_how_much(tmp_path):
    motions = read_motions(written(tmp_path, shipped_lines(1)))
    found = coordinates_of_postures(motions, load_model("R2"))
    assert (np.abs(found.residual_mm).max(axis=0) > 0.01).all()  # with noise of degrees no posture is closed to 0.01 mm
    assert set(found.status) == {"ok"}


@pytest.mark.parametrize(
    ("lines", "where", "cause", "remedy"),
    [
        (["AC_y_mm,AC_z_mm", "1,2"], ", line 1", "TS_x_mm are needed", "--inverse"),
        (["AC_y_mm,AC_z_mm,TS_x_mm", "1,,3"], ", line 2", "a coordinate is empty", "Give all three"),
        (["AC_y_mm,AC_z_mm,TS_x_mm", "1,a,3"], ", line 2", "'a' is not a number", "decimal point"),
        (["AC_y_mm,AC_z_mm,TS_x_mm,posture", "1,2,3,1", "1,2,3,1"], ", line 3", "posture 1", "another number"),
        (["AC_y_mm,AC_z_mm,TS_x_mm,posture", "1,2,3,x"], ", line 2", "posture is 'x'", "Number the postures"),
        (["AC_y_mm,AC_z_mm,TS_x_mm,humerus_elevation_deg", "1,2,3,-9"], ", line 2", "is -9", "0 to 180"),
    ],
)
def test_what_no_coordinates_are_is_refused_by_line(tmp_path, lines, where, cause, remedy):
    path = written(tmp_path, lines)
    refused(girdle("drive", path, "--out", tmp_path / "out"), f"{path}{where}", cause, remedy)
    assert not (tmp_path / "out").exists()
