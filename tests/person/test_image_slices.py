"""Images by others: every test file of pydicom, and contours in one of them, a measured CT slice."""

import warnings
from pathlib import Path

import numpy as np
import pydicom
import pytest

from models.person.contours.band import Settings
from models.person.contours.closed_contour import drawn_contour
from models.person.contours.edge_path import Line, slopes_of
from models.person.contours.image_slices import read_slices
from motions.errors import InputError

FILES = Path(pydicom.__file__).parent / "data" / "test_files"

VERTEBRA = np.array([[60, 6], [74, 22], [78, 38], [72, 46], [58, 41], [44, 46], [41, 35], [47, 18]], float).T
"""Clicks around the body of the vertebra in CT_small.dcm, by eye."""

OFF_PX = 1.5

SAME_PX = 0.5
"""Largest root mean square distance between two contours of one edge."""

pytestmark = pytest.mark.skipif(not FILES.exists(), reason="this pydicom came without the files of its tests")


def test_every_file_is_read_or_refused_in_one_line():
    read, refused = [], {}
    for path in sorted(path for path in FILES.rglob("*") if path.is_file()):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pydicom warns of files that are broken on purpose
            try:
                read += [(path.name, one) for one in read_slices([path])]
            except InputError as error:
                refused[path] = str(error)
    assert {"CT_small.dcm", "MR_small.dcm", "rtdose_1frame.dcm"} <= {name for name, _ in read}
    assert {"rtdose.dcm", "rtplan.dcm", "README.txt"} <= {path.name for path in refused}
    assert all(said.startswith(str(path)) and "\n" not in said for path, said in refused.items())
    for _, one in read:
        assert one.grey.ndim == 2
        assert np.isfinite(np.concatenate([one.origin_mm, one.x_mm, one.y_mm])).all()


def test_places_of_a_measured_slice_are_those_that_it_says():
    path = FILES / "CT_small.dcm"
    (one,), said = read_slices([path]), pydicom.dcmread(path)
    assert said.ImageOrientationPatient == [1, 0, 0, 0, 1, 0]
    corner = one.to_mm(np.array([[10.0], [20.0]]))[:, 0]
    dy, dx = (float(x) for x in said.PixelSpacing)
    expected = np.array(said.ImagePositionPatient, float) + np.array([10.0 * dx, 20.0 * dy, 0.0])
    np.testing.assert_allclose(corner, expected, rtol=0.0, atol=1e-9)


def apart_px(one: Line, other: Line) -> float:
    nearest = np.linalg.norm(one[:, :, None] - other[:, None, :], axis=0).min(axis=1)
    return float(np.sqrt(np.mean(nearest**2)))


@pytest.mark.parametrize(("half_width_px", "same"), [(5.0, 8), (4.0, 10)])
def test_a_vertebra_has_the_same_contour_whoever_clicks(half_width_px, same):
    """Check clicks moved by up to 1.5 px in each direction. Where the band reaches the lung, part of the contour may
    follow the lung's edge, which is stronger."""
    slopes = slopes_of(read_slices([FILES / "CT_small.dcm"])[0].grey)
    settings = Settings("bright", half_width_px)
    expected = drawn_contour(slopes, VERTEBRA, settings).points_px
    assert 30.0 < np.ptp(expected[0]) < 45.0
    moved = [np.random.default_rng(k).uniform(-OFF_PX, OFF_PX, VERTEBRA.shape) for k in range(1, 11)]
    found = [drawn_contour(slopes, VERTEBRA + away, settings).points_px for away in moved]
    assert sum(apart_px(expected, other) < SAME_PX for other in found) == same
