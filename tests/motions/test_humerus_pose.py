"""Pose of the humerus: from landmarks, from columns, from the motion's name, or assumed, in this order of priority."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from motions import InputError, Motions
from motions.errors import InputWarning
from motions.landmarks.frames import humerus_angles, humerus_rotation
from motions.landmarks.humerus_pose import (
    ASSUMED,
    AXIAL,
    COLUMNS,
    LANDMARKS,
    MOTION,
    MOTION_ANGLE,
    PLANE,
    humerus_pose,
    warn_of_radians,
)
from motions.rotations import DEG

NAMES = ["abduction", "forward_flexion", "scapular_elevation", "horizontal_flexion", "axial_rotation", "reaching"]


def motions(extra: dict[str, list[str]] | None = None) -> Motions:
    """Make one posture of each motion, raised by 40 degrees."""
    count = len(NAMES)
    return Motions(
        subject=np.array(["one"] * count),
        motion=np.array(NAMES),
        posture=np.arange(1, count + 1),
        humerus_elevation_deg=np.full(count, 40.0),
        angles_deg=np.zeros((count, 6)),
        landmarks_mm={},
        extra=pd.DataFrame(extra or {}, index=pd.RangeIndex(count)),
    )


def test_the_rotation_is_the_sequence_of_appendix_a_and_back():
    angles = np.array([[0.3, -0.5, 1.4], [0.2, 1.3, 2.6], [-0.7, 0.4, 2.0]])
    R = humerus_rotation(angles)
    expected = Rotation.from_euler("YZY", angles.T).as_matrix()
    np.testing.assert_allclose(np.moveaxis(R, -1, 0), expected, atol=1e-12)
    np.testing.assert_allclose(humerus_angles(R), angles, atol=1e-12)


def test_a_name_says_the_plane_and_the_arm_does_not_turn_about_itself():
    pose = humerus_pose(motions({MOTION_ANGLE: ["", "", "", "75", "-20", ""]}))
    assert pose.known_by.tolist() == [MOTION] * 5 + [ASSUMED]
    p, e, q = pose.angles * DEG
    np.testing.assert_allclose(p, [0.0, 90.0, 30.0, 75.0, 0.0, 30.0])
    np.testing.assert_allclose(e, 40.0)
    np.testing.assert_allclose(p + q, [0.0, 0.0, 0.0, 0.0, -20.0, 0.0])
    turn = Rotation.from_matrix(np.moveaxis(humerus_rotation(pose.angles), -1, 0)).as_rotvec(degrees=True)
    np.testing.assert_allclose(np.delete(turn[:, 1], 4), 0.0, atol=1e-9)  # the axis of a swing is horizontal
    np.testing.assert_allclose(np.linalg.norm(np.delete(turn, 4, axis=0), axis=1), 40.0)


def test_horizontal_flexion_without_its_angle_is_assumed():
    pose = humerus_pose(motions())
    assert pose.known_by[3] == ASSUMED
    assert pose.known_by[4] == ASSUMED


def test_columns_come_before_names_where_both_have_a_number():
    some = {PLANE: ["10", "", "20", " 5.5 ", "nan", "1"], AXIAL: ["-3", "4", "", "7", "8", "-30"]}
    pose = humerus_pose(motions(some))
    assert pose.known_by.tolist() == [COLUMNS, MOTION, MOTION, COLUMNS, ASSUMED, COLUMNS]
    np.testing.assert_allclose(pose.angles[:, 0] * DEG, [10.0, 40.0, -3.0])
    np.testing.assert_allclose(pose.angles[:, 3] * DEG, [5.5, 40.0, 7.0])


def test_landmarks_come_before_columns():
    """Elbow and GH of an arm raised by 60 degrees in the plane 20, rotated by -50; missing in one posture."""
    angles = np.repeat(np.array([[20.0], [60.0], [-50.0]]) / DEG, len(NAMES), axis=1)
    R = humerus_rotation(angles)
    GH = np.repeat([[170.0], [-20.0], [60.0]], len(NAMES), axis=1)
    middle = GH - 290.0 * R[:, 1]
    found = {"GH": GH.T, "EL": (middle + 30.0 * R[:, 0]).T, "EM": (middle - 30.0 * R[:, 0]).T}
    found["EL"][2] = np.nan
    pose = humerus_pose(replace(motions({PLANE: ["10"] * 6, AXIAL: ["0"] * 6}), landmarks_mm=found))
    assert pose.known_by.tolist() == [LANDMARKS, LANDMARKS, COLUMNS, *[LANDMARKS] * 3]
    np.testing.assert_allclose(np.delete(pose.angles, 2, axis=1), np.delete(angles, 2, axis=1), atol=1e-9)


@pytest.mark.parametrize("cell", ["500", "inf", "1_0"])
def test_an_angle_that_no_humerus_has_is_refused(cell):
    with pytest.raises(InputError, match=rf"humerus_plane_deg is '{cell}'. Give degrees between -180 and 180"):
        humerus_pose(motions({PLANE: ["0", "n/a", cell, "0", "0", "0"], AXIAL: ["0"] * 6}))


def test_a_cell_that_is_no_number_is_refused_by_name():
    with pytest.raises(
        InputError, match=r"one, scapular_elevation, posture 3: humerus_axial_deg is 'out'.*leave the cell"
    ):
        humerus_pose(motions({PLANE: ["0"] * 6, AXIAL: ["0", "0", "out", "0", "0", "0"]}))


def test_without_an_elevation_there_is_no_pose():
    unknown = replace(motions(), humerus_elevation_deg=np.array([40.0, np.nan, 40.0, 40.0, 40.0, 40.0]))
    assert np.isnan(humerus_pose(unknown).angles[1]).tolist() == [False, True, False, False, False, False]


def raised(name: str, plane: list[str], axial: list[str] | None = None) -> Motions:
    """Make postures of one motion."""
    rows = motions({PLANE: [*plane, "", "", ""], AXIAL: [*(axial or ["-20"] * 3), "", "", ""]})
    return replace(rows, motion=np.array([name] * len(NAMES)))


@pytest.mark.parametrize(
    "wrong",
    [
        raised("forward_flexion", ["1.57", "1.55", "1.6"]),
        raised("reaching", ["0.5", "0.6", "0.7"], ["-0.3", "-0.4", "-0.6"]),
    ],
)
def test_a_plane_in_radians_is_named(wrong):
    with pytest.warns(InputWarning, match="one: humerus_plane_deg never exceeds 3.14, so it looks like radians"):
        warn_of_radians(wrong)


@pytest.mark.parametrize(
    "right",
    [
        raised("abduction", ["0", "0.5", "-1"]),
        raised("forward_flexion", ["0", "0", "0"]),
        raised("forward_flexion", ["88", "90", "3"]),
        raised("reaching", ["0.5", "1.6", "0.7"]),
        motions(),
    ],
)
def test_a_plane_near_the_frontal_one_is_not_doubted(right):
    warn_of_radians(right)  # a warning would be an error
