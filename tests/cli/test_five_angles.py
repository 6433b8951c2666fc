"""``--angles five``: the same results as with an empty column of the axial rotation, and what the option refuses."""

import numpy as np
import pandas as pd
import pytest

from motions import read_motions, write_motions
from tests.helpers.command import girdle, refused, shipped_lines, written


@pytest.fixture
def six(tmp_path):
    return written(tmp_path, shipped_lines(1))


@pytest.fixture
def blank(six, tmp_path):
    """Write the motions with empty cells for the axial rotation of the clavicle."""
    motions = read_motions(six)
    motions.angles_deg[:, 2] = np.nan
    write_motions(motions, tmp_path / "blank.csv")
    return tmp_path / "blank.csv"


TABLES = {"adapt": "parameters", "fit": "fits", "compare": "comparison", "trust": "trust", "muscles": "balance"}
"""Table to compare for each command; test_diagnose_cli.py tests `girdle diagnose`."""


@pytest.mark.parametrize(("command", "table"), TABLES.items())
def test_five_angles_are_an_empty_column(six, blank, tmp_path, command, table):
    ran = girdle(command, six, "--angles", "five", "--out", tmp_path / "five")
    alike = girdle(command, blank, "--out", tmp_path / "blank")
    assert ran.status == alike.status
    names = ("five", "blank")
    five, other = (pd.read_csv(tmp_path / name / f"{table}.csv") for name in names)
    pd.testing.assert_frame_equal(five, other)
    assert five.select_dtypes("number").abs().sum().sum() > 0.0
    again = girdle(command, "--repeat", tmp_path / "five" / "run.json", "--out", tmp_path / "again")
    assert again.status == ran.status
    assert (tmp_path / f"again/{table}.csv").read_bytes() == (tmp_path / f"five/{table}.csv").read_bytes()


def test_postures_with_too_few_other_angles_are_left_out(six, tmp_path):
    motions = read_motions(six)
    motions.angles_deg[0, 3:] = np.nan  # three angles are left, one of them the axial rotation
    write_motions(motions, tmp_path / "few.csv")
    ended = girdle("fit", tmp_path / "few.csv", "--angles", "five", "--out", tmp_path / "out")
    assert ended.status == 0
    assert "warning: --angles five: 1 postures have fewer than 3 angles without clavicle_x_deg" in ended.err
    assert len(pd.read_csv(tmp_path / "out" / "fits.csv")) == len(motions.posture) - 1
    motions.angles_deg[:, 3:] = np.nan
    write_motions(motions, tmp_path / "none.csv")
    ended = girdle("fit", tmp_path / "none.csv", "--angles", "five", "--out", tmp_path / "none")
    assert ended.status == 2
    assert ended.err.splitlines()[-1].startswith("error: --angles five: no posture has 3 angles without clavicle_x_deg")
    assert not (tmp_path / "none").exists()


def test_another_word_is_refused(six, tmp_path):
    ended = girdle("adapt", six, "--angles", "seven", "--out", tmp_path / "out")
    refused(ended, "--angles", "there is no 'seven'", "six, five")
