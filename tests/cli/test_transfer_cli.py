"""``girdle transfer`` on bones with a known answer: by landmarks, by surfaces, against measured attachments."""

import numpy as np
import pandas as pd
import pytest
from meshes import write_ply, write_stl
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from models.person.transfer.attachment_types import LARGE, SMALL
from tests.helpers.command import girdle, refused, written

XYZ = ["x_mm", "y_mm", "z_mm"]

R, T = Rotation.from_euler("xyz", [30.0, -20.0, 110.0], degrees=True).as_matrix(), np.array([[400.0], [-70.0], [20.0]])

LANDMARKS = {"AC": (0.0, 0.0, 0.0), "TS": (-119.0, 0.0, 0.0), "AI": (-139.0, -110.0, 0.0)}


def to_target(points: np.ndarray) -> np.ndarray:
    """Map the source to the target: a tenth larger, in another frame."""
    return 1.1 * R @ points + T


def table(name: str, points: dict[str, np.ndarray], shapes: dict[str, str] | None = None) -> list[str]:
    head = f"{name},{','.join(XYZ)}" + (",shape" if shapes else "")
    rows = [
        f"{key},{','.join(map(repr, row))}" + (f",{shapes[key]}" if shapes else "")
        for key, values in points.items()
        for row in values.T.tolist()
    ]
    return [head, *rows]


@pytest.fixture
def bones(tmp_path):
    """Write files of both bones: three landmarks and three attachments."""
    own = {"deltoid": np.array([[-10.0, -40.0, -80.0], [5.0, 10.0, 12.0], [3.0, 4.0, 6.0]])}
    own |= {"biceps": np.array([[-20.0], [-15.0], [-25.0]]), "subscapularis": -np.eye(3) * 60.0}
    shapes = {"deltoid": "line", "biceps": "point", "subscapularis": "plane"}
    landmarks = {name: np.array([place]).T for name, place in LANDMARKS.items()}
    written(tmp_path, table("attachment", own, shapes), "own.csv")
    written(tmp_path, table("attachment", {k: to_target(v) for k, v in own.items()}, shapes), "same.csv")
    written(tmp_path, table("landmark", landmarks), "from.csv")
    written(tmp_path, table("landmark", {k: to_target(v) for k, v in landmarks.items()}), "to.csv")
    return tmp_path, own


def by_landmarks(home, *more):
    files = "--from-landmarks", home / "from.csv", "--to-landmarks", home / "to.csv"
    return girdle("transfer", home / "own.csv", *files, *more, "--out", home / "out")


def test_a_bone_of_the_same_shape_is_carried_exactly_and_compares_as_itself(bones):
    home, own = bones
    ended = by_landmarks(home, "--measured", home / "same.csv")
    assert ended.status == 0, ended.err
    assert "by the landmarks AC, TS, AI (in a plane" in ended.out
    found = pd.read_csv(home / "out" / "attachments.csv")
    np.testing.assert_allclose(found[XYZ].to_numpy(float).T, np.hstack([to_target(v) for v in own.values()]), atol=1e-9)
    distances = pd.read_csv(home / "out" / "distances.csv").set_index("attachment")
    assert set(distances["type"]) == {SMALL}
    assert distances[["least_mm", "mean_mm", "most_mm"]].to_numpy(float).max() < 1e-9
    assert distances["mdp_mm"].notna().to_dict() == {"deltoid": False, "biceps": False, "subscapularis": True}
    assert distances["md_mm"].notna().to_dict() == {"deltoid": True, "biceps": False, "subscapularis": False}
    assert (home / "out" / "run.json").exists()


def test_attachments_are_not_carried_onto_themselves(bones):
    home, _ = bones
    assert by_landmarks(home).status == 0
    files = "--from-landmarks", home / "to.csv", "--to-landmarks", home / "from.csv"
    onto = girdle("transfer", home / "out" / "attachments.csv", *files, "--out", home / "out")
    refused(
        onto, str(home / "out"), "this run reads attachments.csv in this folder and would replace", "another folder"
    )
    alone = girdle("transfer", home / "own.csv", *files, "--surface-unit", "cm", "--out", home / "out")
    refused(alone, "--surface-unit", "there is no surface that could have this unit", "leave it out")


def test_an_attachment_elsewhere_is_large(bones):
    """An error of 30 mm along each axis is sqrt(3) 30 = 52 mm, which Table 5.3 calls LARGE."""
    home, own = bones
    moved = {"biceps": to_target(own["biceps"]) + 30.0}
    written(home, table("attachment", moved), "moved.csv")
    assert by_landmarks(home, "--measured", home / "moved.csv").status == 0
    row = pd.read_csv(home / "out" / "distances.csv").set_index("attachment").loc["biceps"]
    assert row["type"] == LARGE
    assert row["mean_mm"] == pytest.approx(30.0 * np.sqrt(3.0))


def test_without_measured_ones_the_assumed_error_is_said(bones):
    home, _ = bones
    assert "assumed to be 8 mm (SD a coordinate) off" in by_landmarks(home).out


def test_surfaces_carry_and_the_carried_points_lie_on_the_target(tmp_path):
    """Two deformed spheres, one the other rotated and a tenth larger; landmarks fix the correspondence."""
    pytest.importorskip("vtkmodules")
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(3, 3000))
    bumpy = ball / np.linalg.norm(ball, axis=0) * np.array([[70.0], [40.0], [15.0]])
    bumpy[:, bumpy[0] > 40.0] *= np.array([[1.3], [1.0], [1.5]])
    faces = ConvexHull((ball / np.linalg.norm(ball, axis=0)).T).simplices
    write_stl(tmp_path / "from.stl", bumpy, faces)
    write_ply(tmp_path / "to.ply", to_target(bumpy) / 10.0, faces)
    chosen = np.argsort(rng.random(3000))[:5]
    written(tmp_path, table("attachment", {"a": bumpy[:, chosen]}), "own.csv")
    files = ["--from-surface", tmp_path / "from.stl", "--to-surface", tmp_path / "to.ply"]
    ended = girdle("transfer", tmp_path / "own.csv", *files, "--out", tmp_path / "out")
    assert ended.status == 2
    assert "--surface-unit" in ended.err  # the file is in centimetres, for a bone of 15 cm
    write_ply(tmp_path / "to.ply", to_target(bumpy), faces)
    ended = girdle("transfer", tmp_path / "own.csv", *files, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    found = pd.read_csv(tmp_path / "out" / "attachments.csv")[XYZ].to_numpy(float).T
    off = np.linalg.norm(found - to_target(bumpy[:, chosen]), axis=0)
    assert np.median(off) < 2.0
    assert pd.read_csv(tmp_path / "out" / "distances.csv").loc[0, "surface_mm"] < 2.0


def test_what_cannot_be_carried_is_refused(bones):
    home, _ = bones
    path = home / "own.csv"
    refused(girdle("transfer", path, "--out", home / "none"), str(path), "a map needs three", "--from-landmarks")
    one = ("--from-surface", home / "from.stl")
    refused(girdle("transfer", path, *one, "--out", home / "none"), str(home / "from.stl"), "", "")
    written(home, table("attachment", {"x": np.zeros((3, 1))}), "others.csv")
    refused(by_landmarks(home, "--measured", home / "others.csv"), str(home / "others.csv"), "none of", "deltoid")
    written(home, ["landmark,x_mm,y_mm,z_mm", "AC,0,0,0", "AC,1,0,0"], "to.csv")
    refused(by_landmarks(home), f"{home / 'to.csv'}, line 2", "'AC' stands there 2 times", "each landmark once")
    written(home, ["landmark,x_mm,y_mm,z_mm", "AC,0,,0"], "to.csv")
    refused(by_landmarks(home), f"{home / 'to.csv'}, line 2", "a coordinate of the point is empty", "x, y and z")
    written(home, ["attachment,x_mm,y_mm,z_mm,shape", "a,0,1,0,blob"], "own.csv")
    refused(by_landmarks(home), f"{path}, line 2", "'a' has the shape 'blob'", "point, line, plane")
    assert not (home / "none").exists()
