"""Surfaces from files: the same cube in every format, distances worked by hand, and files that hold no surface."""

import numpy as np
import pytest
from meshes import CUBE, FACES, WRITERS, write_stl

from models.person.transfer.mesh import Mesh, read_mesh
from motions import InputError

pytest.importorskip("vtkmodules")

FLOAT32 = 1e-5
"""Relative rounding: STL and PLY hold floats of 4 bytes."""


@pytest.mark.parametrize("ending", WRITERS)
def test_a_cube_is_the_same_from_every_form(tmp_path, ending):
    mesh = read_mesh(WRITERS[ending](tmp_path / f"cube{ending}", 100.0 * CUBE, FACES))
    assert mesh.corners.shape == (3, 8)
    assert len(mesh.triangles) == 12
    assert {tuple(corner) for corner in mesh.corners.T.tolist()} == {tuple(c) for c in (100.0 * CUBE).T.tolist()}


def test_stl_in_text_and_in_other_units(tmp_path):
    mesh = read_mesh(write_stl(tmp_path / "cube.STL", 10.0 * CUBE, FACES, binary=False), 10.0)
    assert np.ptp(mesh.corners) == pytest.approx(100.0, rel=FLOAT32)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((50.0, 50.0, 103.0), 3.0),  # above a face
        ((50.0, 50.0, 90.0), 10.0),  # inside
        ((103.0, 104.0, 50.0), 5.0),  # beside an edge
        ((102.0, 103.0, 106.0), 7.0),  # beside a corner
        ((0.0, 100.0, 30.0), 0.0),  # on an edge
    ],
)
def test_distances_to_a_cube_are_those_worked_by_hand(point, distance):
    found = Mesh(100.0 * CUBE, FACES).distances_mm(np.array(point)[:, None])
    np.testing.assert_allclose(found, [distance], atol=1e-9)


def test_points_are_spread_evenly_over_the_area():
    """Check a box with faces of 1 x 1 and of 1 x 3, where long faces have 12/14 of the area, to 4 SDs of a count."""
    points = Mesh(np.array([[1.0], [3.0], [1.0]]) * CUBE, FACES).spread(7000)
    on_ends = np.isclose(points[1] % 3.0, 0.0).sum()
    assert abs(on_ends - 1000) < 4.0 * np.sqrt(7000 * (1 / 7) * (6 / 7))
    assert Mesh(np.array([[1.0], [3.0], [1.0]]) * CUBE, FACES).distances_mm(points[:, :50]).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "content", "cause"),
    [
        ("a.stl", b"solid but no more", "neither a binary STL"),
        ("a.stl", bytes(200), "neither a binary STL"),
        ("a.stl", bytes(84), "no whole surface"),
        ("a.ply", b"plo", "no PLY file"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999\n", "states 999999 points or faces"),
        ("a.vtp", b"<xml/>", "no VTP file"),
        (
            "a.vtp",
            b'<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="3"',
            "cannot read the file|no whole surface",
        ),
        ("a.obj", b"v 0 0 0", "surfaces that end in '.obj' are not read"),
    ],
)
def test_what_is_no_surface_is_refused(tmp_path, name, content, cause, capfd):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=cause):
        read_mesh(tmp_path / name)
    assert capfd.readouterr().err == ""  # the reader prints no messages of its own


def test_metres_taken_for_millimetres_are_refused(tmp_path):
    path = write_stl(tmp_path / "small.stl", 0.1 * CUBE, FACES)
    with pytest.raises(InputError, match=r"0\.1 mm long.*--surface-unit"):
        read_mesh(path)
