"""Realistic files (``../shared/cases``): angles as computed by hand, or the true reason of a refusal."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import girdle

CASES = Path(__file__).parents[3] / "shared" / "cases"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not shipped")

NEAR_DEG = 0.01
"""Tolerance: the files have at least three decimals of a mm."""


def angles(path: Path) -> pd.DataFrame:
    """Return the measured angles, one row per posture."""
    return pd.read_csv(path).drop(columns="clavicle_x_deg")


@pytest.mark.parametrize("name", ["base.trc", "c01_spaces.trc", "c04_singletab.trc", "hdr_dec.trc", "latin1.trc"])
def test_variants_of_a_trc_are_read(tmp_path, name):
    ended = girdle("convert", CASES / name, tmp_path / "out.csv")
    assert ended.status == 0, ended.err
    by_hand = pd.read_csv(CASES / "base_angles.csv").set_index("frame")
    found = angles(tmp_path / "out.csv")[by_hand.columns]
    np.testing.assert_allclose(found, by_hand, rtol=0.0, atol=NEAR_DEG)


def test_the_unit_of_the_mapping_wins_over_that_of_a_c3d(tmp_path):
    source, out = CASES / "e_unit_mm_data_m.c3d", tmp_path / "out.csv"
    ended = girdle("convert", source, out)
    assert ended.status == 2
    assert 'write unit = "m" in a mapping file (--map), which wins' in ended.err
    (tmp_path / "lab.toml").write_text('unit = "m"\n')
    ended = girdle("convert", source, out, "--map", tmp_path / "lab.toml")
    assert "in mm; they are read as m, as the mapping file says" in ended.err
    by_hand = pd.read_csv(CASES / "base_angles.csv").set_index("frame")
    np.testing.assert_allclose(angles(out)[by_hand.columns], by_hand, rtol=0.0, atol=NEAR_DEG)


def test_a_spreadsheets_table_and_vicons_hold_the_same_trial(tmp_path):
    """Twelve frames, once with semicolons and decimal commas, once with the header of Nexus."""
    found = []
    for name in ("lm_semicolon.csv", "vicon_comma.csv"):
        assert girdle("convert", CASES / name, tmp_path / "out.csv").status == 0
        found.append(angles(tmp_path / "out.csv").select_dtypes("number").drop(columns="posture"))
    assert len(found[0]) == 12
    np.testing.assert_allclose(found[0], found[1][found[0].columns], rtol=0.0, atol=1e-9)


def test_degrees_that_are_said_to_be_radians(tmp_path):
    source = CASES / "s_degrees_said_no.sto"
    ended = girdle("convert", source, tmp_path / "out.csv")
    assert ended.status == 2
    assert ended.err.startswith(f"error: {source}, line 5: the header says radians (inDegrees=no), but")
    assert "Write inDegrees=yes" in ended.err
