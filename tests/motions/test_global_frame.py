"""The thorax relative to the global frame, the clavicle by the global y axis: rotated by hand, both sides, refusals."""

import numpy as np
import pandas as pd
import pytest
from laboratory import simulated_trial, trc_lines
from scipy.spatial.transform import Rotation

from adapt.tables.thorax_table import thorax_table
from motions import read_motions
from motions.landmarks.frames import clavicle_frame, thorax_angles
from motions.landmarks.sampled_postures import THORAX_COLUMNS
from motions.rotations import DEG
from tests.helpers.command import girdle, refused

EXACT_DEG = 1e-6

TILTED_DEG = (12.0, -25.0, 6.0)
"""Backward tilt, torsion and lateral flexion."""

R_GLOBAL_THORAX = Rotation.from_euler("XYZ", TILTED_DEG, degrees=True).as_matrix()

R_LAB_GLOBAL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""A laboratory with x to the right, y forward and z up: global = ["x", "z", "-y"]."""

MAP = 'unit = "mm"\nglobal = ["x", "z", "-y"]\n'


def laboratory(tmp_path, mirrored=False, R=R_GLOBAL_THORAX):
    """Write a trial of a person whose thorax is rotated in the laboratory; a mirrored one is a left shoulder."""
    trial = simulated_trial(np.linspace(5.0, 130.0, 200))
    mirror = np.array([[-1.0], [1.0], [1.0]]) if mirrored else 1.0
    lab = {name: R_LAB_GLOBAL @ R @ (mirror * mm) + 500.0 for name, mm in trial.thorax_mm.items()}
    path = tmp_path / "trial.trc"
    path.write_text("\n".join(trc_lines(lab)) + "\n")
    (tmp_path / "lab.toml").write_text(MAP)
    return path, trial


def test_angles_are_those_of_rotations_by_scipy():
    angles = np.array([[10.0, -170.0, 33.0], [20.0, -80.0, 5.0], [-30.0, 4.0, 1.0]]) / float(DEG)
    R = np.moveaxis(Rotation.from_euler("XYZ", angles.T).as_matrix(), 0, -1)
    np.testing.assert_allclose(thorax_angles(R), angles, atol=1e-12)


@pytest.mark.parametrize("at", [[], ["--at", "20,60,100"]])
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_turned_thorax_comes_out_in_every_posture(tmp_path, side, at):
    path, _ = laboratory(tmp_path, side == "left")
    ended = girdle("convert", path, tmp_path / "m.csv", "--map", tmp_path / "lab.toml", "--side", side, *at)
    assert ended.status == 0, ended.err
    motions = read_motions(tmp_path / "m.csv")
    found = motions.extra[list(THORAX_COLUMNS)].to_numpy(float)
    np.testing.assert_allclose(found, np.broadcast_to(TILTED_DEG, found.shape), atol=1e-3)
    assert "12.0 (12.0 to 12.0)" in ended.out
    table = thorax_table(motions).set_index("angle")
    assert table.loc["thorax_y_deg", "median_deg"] == pytest.approx(-25.0, abs=1e-3)
    assert len(table) == 3


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_clavicle_by_the_global_y_begins_where_its_frame_has_it(tmp_path, side):
    """Against the library: by hand, the rotation between the two clavicle frames with the lowest arm."""
    path, trial = laboratory(tmp_path, side == "left")
    options = ("--map", tmp_path / "lab.toml", "--side", side)
    for word in ("thorax", "global"):
        ended = girdle("convert", path, tmp_path / f"{word}.csv", *options, "--clavicle-z", word)
        assert ended.status == 0, ended.err
    by_thorax, by_global = (read_motions(tmp_path / f"{word}.csv") for word in ("thorax", "global"))
    lowest = trial.elevation_deg <= trial.elevation_deg.min() + 2.0
    mirror = np.array([-1.0, 1.0, 1.0]) if side == "left" else np.ones(3)
    y_global = mirror * R_GLOBAL_THORAX[1]
    apart = []
    for SC, AC in zip(trial.thorax_mm["SC"].T[lowest], trial.thorax_mm["AC"].T[lowest], strict=True):
        frames = [clavicle_frame(SC, AC, y) for y in (np.array([0.0, 1.0, 0.0]), y_global)]
        turn = Rotation.from_matrix(frames[0].T @ frames[1]).as_rotvec(degrees=True)
        np.testing.assert_allclose(turn[1:], 0.0, atol=1e-9)  # the rotation is about the clavicle's own axis alone
        apart.append(turn[0])
    begins = float(np.median(apart))
    assert abs(begins) > 5.0
    first = by_global.angles_deg[0, 2] - by_thorax.angles_deg[0, 2]
    assert first == pytest.approx(begins, abs=0.5)
    others = np.delete(by_global.angles_deg - by_thorax.angles_deg, 2, axis=1)
    np.testing.assert_allclose(others, 0.0, atol=EXACT_DEG)
    assert f"global y: axial rotation begins at {begins:.1f} deg" in ended.out


def test_an_upright_thorax_makes_no_difference(tmp_path):
    path, _ = laboratory(tmp_path, R=np.eye(3))
    ended = girdle("convert", path, tmp_path / "m.csv", "--map", tmp_path / "lab.toml", "--clavicle-z", "global")
    assert "begins at 0.0 deg" in ended.out or "begins at -0.0 deg" in ended.out


def test_without_a_global_frame_nothing_is_said_or_asked(tmp_path):
    path, _ = laboratory(tmp_path)
    ended = girdle("convert", path, tmp_path / "m.csv")
    assert ended.status == 0, ended.err
    assert "Thorax" not in ended.out
    assert not set(THORAX_COLUMNS) & set(pd.read_csv(tmp_path / "m.csv").columns)
    refused(
        girdle("convert", path, tmp_path / "n.csv", "--clavicle-z", "global"),
        str(path),
        "needs the global frame, and the file does not say it",
        'global = ["x", "z", "-y"]',
    )


@pytest.mark.parametrize(
    ("line", "cause"),
    [('global = ["x", "y"]', "global is"), ('global = ["x", "z", "y"]', "left-handed"), ("global = 3", "global is 3")],
)
def test_axes_that_are_no_frame_are_refused(tmp_path, line, cause):
    path, _ = laboratory(tmp_path)
    (tmp_path / "lab.toml").write_text(f"{line}\n")
    ended = girdle("convert", path, tmp_path / "m.csv", "--map", tmp_path / "lab.toml")
    refused(ended, str(tmp_path / "lab.toml"), cause, "right, up and backward")


@pytest.mark.parametrize("axes", [["-x", "z", "y"], ["x", "y", "z"], ["-y", "z", "-x"]], ids=["back", "up", "side"])
def test_a_person_who_does_not_stand_in_the_global_frame_is_named(tmp_path, axes):
    path, _ = laboratory(tmp_path)
    (tmp_path / "lab.toml").write_text(f'unit = "mm"\nglobal = {axes}\n')
    ended = girdle("convert", path, tmp_path / "m.csv", "--map", tmp_path / "lab.toml")
    assert "against the global frame of the mapping the thorax is turned" in ended.err
    R_global_lab = np.array([np.eye(3)["xyz".index(one[-1])] * (-1.0 if one[0] == "-" else 1.0) for one in axes])
    away = np.degrees(np.arccos(np.diag(R_global_lab @ R_LAB_GLOBAL @ R_GLOBAL_THORAX)))
    for word, angle in zip(("right", "up", "back"), away, strict=True):
        assert (f"{word} by {angle:.0f}" in ended.err) == (angle > 60.0)
    assert "global names the axes of the file that point right, up and backward of the person" in ended.err
