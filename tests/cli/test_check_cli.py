# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportAssignmentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""``girdle check``: printed matrices of two measurements, rigid motions with two bad landmarks, a rotated trial."""

import numpy as np
import pandas as pd
import pytest
from laboratory import simulated_trial
from scipy.spatial.transform import Rotation

from motions.landmarks.two_measurements import rigid_motion
from tests.helpers.command import girdle, refused, written
from tests.helpers.thesis_tables import DISSECTION, MISPRINTED, MRI, TABLE_4_1

PRINTED_MM = 0.15
"""Rounding of printed distances, explained in tests/motions/test_distance_matrices.py."""

ALIASES = {"SC-J": "SC", "GH-J": "GH"}


def points_file(folder, name, points):
    rows = [f"{key},{','.join(map(repr, map(float, place)))}" for key, place in points.items()]
    return written(folder, ["landmark,x_mm,y_mm,z_mm", *rows], name)


def test_table_4_1_comes_out_of_the_coordinates_of_table_4_2(tmp_path):
    files = []
    for name, table in (("mri.csv", MRI), ("dissection.csv", DISSECTION)):
        files.append(points_file(tmp_path, name, {ALIASES.get(key, key): place for key, place in table.items()}))
    ended = girdle("check", *files, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    found = pd.read_csv(tmp_path / "out" / "distances.csv")
    names = [ALIASES.get(name, name) for name in MRI]
    misprinted = {frozenset(ALIASES.get(name, name) for name in pair) for pair in MISPRINTED}
    compared = 0
    for row in found.itertuples():
        printed = TABLE_4_1[names.index(row.one), names.index(row.other)]
        if frozenset((row.one, row.other)) not in misprinted:
            assert row.difference_mm == pytest.approx(printed, abs=PRINTED_MM)
            compared += 1
    assert compared == 6 + 1 + 3 + 3  # distances of thorax, clavicle, scapula, humerus
    moved = pd.read_csv(tmp_path / "out" / "rigid_motions.csv").set_index("bone")
    assert moved.loc["humerus", "residual_mm"] < 3.0  # the same bone in both measurements
    assert moved.loc["thorax", "residual_mm"] > 20.0  # PX and T8 were palpated at other places


R = Rotation.from_euler("XYZ", [20.0, -70.0, 35.0], degrees=True)
SHIFT = np.array([30.0, -400.0, 7.0])


def test_screws_of_which_two_were_wrong_are_named_and_left_out_of_the_motion(tmp_path):
    rng = np.random.default_rng(8)
    screws = rng.normal(0.0, 60.0, (6, 3))
    palpated = R.apply(screws) + SHIFT + rng.normal(0.0, 0.5, (6, 3))
    palpated[[0, 4]] += [[9.0, 9.0, 0.0], [0.0, -12.0, 5.0]]
    names = [f"S{k}" for k in range(1, 7)]
    files = [
        points_file(tmp_path, name, dict(zip(names, places, strict=True)))
        for name, places in (("ct.csv", screws), ("palpated.csv", palpated))
    ]
    ended = girdle("check", *files, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    moved = pd.read_csv(tmp_path / "out" / "rigid_motions.csv").iloc[0]
    assert moved["points"] == "S2 S3 S4 S6"
    assert moved["angle_deg"] == pytest.approx(np.degrees(R.magnitude()), abs=1.0)
    kept = [1, 2, 3, 5]
    by_scipy, rssd = Rotation.align_vectors(
        palpated[kept] - palpated[kept].mean(axis=0), screws[kept] - screws[kept].mean(axis=0)
    )
    axis = by_scipy.as_rotvec() / by_scipy.magnitude()
    np.testing.assert_allclose(moved[["axis_x", "axis_y", "axis_z"]].to_numpy(float), axis, atol=1e-9)
    squares = moved["residual_mm"] ** 2 + moved["residual_sd_mm"] ** 2 * 3 / 4
    assert np.sqrt(4.0 * squares) == pytest.approx(rssd)


def test_a_scapula_turned_about_a_known_axis(tmp_path):
    """AC, TS and AI are rotated by 40 degrees about z, with a thorax at rest."""
    turned = rigid_motion(np.eye(3) * 50.0, Rotation.from_euler("Z", 40.0, degrees=True).as_matrix() * 50.0)
    assert turned.angle_deg == pytest.approx(40.0)
    np.testing.assert_allclose(turned.axis, [0.0, 0.0, 1.0], atol=1e-12)
    with pytest.raises(ValueError, match="on a line"):
        rigid_motion(np.outer([1.0, 0.0, 0.0], [0.0, 50.0, 90.0]), np.eye(3))


def trial_file(folder, thorax_mm, **changes):
    """Write a table of markers, one row per posture."""
    columns = {f"{n}_{a}_mm": place[k] for n, place in (thorax_mm | changes).items() for k, a in enumerate("xyz")}
    pd.DataFrame(columns).to_csv(folder / "trial.csv", index=False)
    return folder / "trial.csv"


@pytest.fixture(scope="module")
def trial():
    return simulated_trial(np.linspace(10.0, 120.0, 12))


def test_a_trial_keeps_its_bones_and_says_how_they_turn(trial, tmp_path):
    path = trial_file(tmp_path, trial.thorax_mm)
    (tmp_path / "lab.toml").write_text('global = ["x", "y", "z"]\n')
    ended = girdle("check", path, "--map", tmp_path / "lab.toml", "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    distances = pd.read_csv(tmp_path / "out" / "distances.csv")
    within = distances[distances["bone"].notna()]
    assert within["sd_mm"].max() < 1e-9
    assert distances.loc[(distances["one"] == "IJ") & (distances["other"] == "AC"), "sd_mm"].iloc[0] > 1.0
    assert (within["mean_mm"] >= within["person_low_mm"]).all()
    moved = pd.read_csv(tmp_path / "out" / "rigid_motions.csv")
    last = moved[moved["bone"] == "scapula"].iloc[-1]
    first, end = (Rotation.from_euler("YZX", trial.angles_deg[k, 3:], degrees=True) for k in (0, -1))
    assert last["angle_deg"] == pytest.approx(np.degrees((end * first.inv()).magnitude()), abs=1e-6)
    assert moved[moved["bone"] == "thorax"]["angle_deg"].max() < 1e-6
    thorax = pd.read_csv(tmp_path / "out" / "thorax.csv")
    assert thorax[["thorax_x_deg", "thorax_y_deg", "thorax_z_deg"]].abs().to_numpy().max() < 1e-9


def test_a_thorax_across_the_global_frame_is_named(trial, tmp_path):
    (tmp_path / "lab.toml").write_text('global = ["x", "z", "-y"]\n')
    path = trial_file(tmp_path, trial.thorax_mm)
    ended = girdle("check", path, "--map", tmp_path / "lab.toml", "--out", tmp_path / "out")
    assert "the thorax is turned: its up by 90 and back by 90 degrees" in ended.err


def test_a_landmark_that_slipped_is_named(trial, tmp_path):
    TS = trial.thorax_mm["TS"].copy()
    TS[:, 5] += [12.0, 9.0, 0.0]
    ended = girdle("check", trial_file(tmp_path, trial.thorax_mm, TS=TS), "--out", tmp_path / "out")
    assert "wrong: " in ended.err
    assert "TS" in ended.err
    assert ended.status == 3
    moved = pd.read_csv(tmp_path / "out" / "rigid_motions.csv")
    scapula = moved[moved["bone"] == "scapula"]
    assert scapula["residual_most_mm"].idxmax() == scapula.index[4]  # rows are postures 2, 3, ... relative to the first


def test_a_landmark_that_jumps_or_stands_still_ends_with_the_status_of_a_slip(trial, tmp_path):
    for name, wrong in (("TS", [80.0, 90.0, 0.0]), ("GH", [0.0, 500.0, 0.0])):
        jumping = trial.thorax_mm[name].copy()
        jumping[:, 5] += wrong
        path = trial_file(tmp_path, trial.thorax_mm, **{name: jumping})
        ended = girdle("check", path, "--out", tmp_path / name)
        assert f"{name} is not in its place" in " ".join(ended.err.split())
        assert ended.status == 3


def test_what_cannot_be_checked_is_refused(trial, tmp_path):
    path = trial_file(tmp_path, trial.thorax_mm)
    two = points_file(tmp_path, "two.csv", {"A": (0, 0, 0), "B": (1, 0, 0)})
    refused(girdle("check", path, two, "--out", tmp_path / "o"), str(path), "it has 12 postures", "one posture")
    one = points_file(tmp_path, "one.csv", {"C": (0, 0, 0)})
    refused(girdle("check", two, one, "--out", tmp_path / "o"), str(one), "share no two points", "Name its points")
    written(tmp_path, ["landmark,x_mm,y_mm,z_mm", "A,0,x,0"], "bad.csv")
    bad = tmp_path / "bad.csv"
    refused(girdle("check", bad, "--out", tmp_path / "o"), f"{bad}, line 2", "'x' is not a number", "decimal point")
    assert not (tmp_path / "o").exists()
