"""Prediction of measured motions by the rhythm: worked by hand, with planes read or mapped, and rest left unscored."""

import numpy as np
import pandas as pd

from adapt.trust.questions.rhythm_prediction import (
    PLANE_OF_ELEVATION,
    planes_of_elevation_deg,
    predict_from_lowest,
)
from motions.rhythm import COEFFICIENTS, REST_DEG
from motions.table import Motions

EXACT_DEG = 1e-10
"""Rounding of the same arithmetic on arrays of other shapes."""


def table(names, elevation, angles, **extra) -> Motions:
    count = len(names)
    return Motions(
        subject=np.repeat(np.array("one", dtype=object), count),
        motion=np.array(names, dtype=object),
        posture=np.arange(1, count + 1),
        humerus_elevation_deg=np.array(elevation, float),
        angles_deg=np.array(angles, float),
        landmarks_mm={},
        extra=pd.DataFrame(extra, index=range(count), dtype=str),
    )


def test_scapular_angles_of_a_posture_worked_by_hand():
    """Lateral rotation at 100 deg of flexion: 3.095 - 0.079 90 + 0.396 100 + 0.414 20 = 43.865, and so on."""
    rest = [-30.0, 10.0, 5.0, 40.0, 20.0, -8.0]
    motions = table(["sagittal_elevation"] * 2, [0.0, 100.0], [rest, np.zeros(6)])
    found = predict_from_lowest(motions)
    np.testing.assert_array_equal(found.scored, [False, True])
    expected = [
        -4.983 + 0.120 * 90 - 0.242 * 100 + 0.851 * -30,
        3.917 - 0.046 * 90 + 0.123 * 100 + 0.493 * 10,
        -1.203 + 0.140 * 90 - 0.049 * 100 + 0.901 * 40,
        43.865,
        0.659 - 0.028 * 90 + 0.184 * 100 + 0.886 * -8,
    ]
    np.testing.assert_allclose(found.angles_deg[1, [0, 1, 3, 4, 5]], expected, rtol=0.0, atol=EXACT_DEG)


def test_rest_is_the_average_of_all_lowest_postures_and_what_is_missing_there_the_published_mean():
    rest = np.array([[-30.0, 10.0, np.nan, 40.0, 20.0, -8.0], [-32.0, 14.0, np.nan, 42.0, np.nan, -6.0]])
    motions = table(["axial_rotation"] * 2 + ["abduction"], [0.0, 0.0, 60.0], [*rest, np.zeros(6)])
    found = predict_from_lowest(motions)
    np.testing.assert_array_equal(found.scored, [False, False, True])
    at_rest = table(["abduction"] * 2, [0.0, 60.0], [[-31.0, 12.0, REST_DEG[2], 41.0, 20.0, -7.0], np.zeros(6)])
    np.testing.assert_allclose(found.angles_deg[2], predict_from_lowest(at_rest).angles_deg[1], atol=EXACT_DEG)


def test_without_a_measured_rest_everybody_is_predicted_alike():
    motions = table(["abduction"] * 3, [0.0, 30.0, 90.0], np.random.default_rng(1).normal(size=(3, 6)))
    published = predict_from_lowest(motions, measured_rest=False)
    np.testing.assert_array_equal(published.scored, [False, True, True])
    slopes = (published.angles_deg[2] - published.angles_deg[1])[[0, 1, 3, 4, 5]] / 60.0
    np.testing.assert_allclose(slopes, COEFFICIENTS[:, 2], rtol=0.0, atol=EXACT_DEG)
    own = predict_from_lowest(motions)
    assert np.abs(own.angles_deg - published.angles_deg).max() > 1.0


def test_the_plane_is_read_or_mapped_and_unknown_is_not_predicted():
    names = ["frontal_elevation", "scapular_elevation", "forward_flexion", "horizontal_flexion", "circles", "abduction"]
    motions = table(
        [*names, "horizontal_flexion"],
        [30.0, 50.0, 60.0, 90.0, 70.0, 80.0, 90.0],
        np.zeros((7, 6)),
        motion_angle_deg=["30", "50", "60", "-70", "1", "80", ""],
        **{PLANE_OF_ELEVATION: ["", "35", "", "", "", "nonsense", ""]},
    )
    planes = planes_of_elevation_deg(motions)
    np.testing.assert_array_equal(planes, [0.0, 35.0, 90.0, 70.0, np.nan, 0.0, np.nan])
    found = predict_from_lowest(motions)
    np.testing.assert_array_equal(found.scored, [False, True, True, True, False, True, False])
    np.testing.assert_array_equal(np.isnan(found.angles_deg).all(axis=1), np.isnan(planes))


def test_a_subject_without_elevations_is_not_scored():
    motions = table(["abduction"] * 2, [np.nan, np.nan], np.zeros((2, 6)))
    assert not predict_from_lowest(motions).scored.any()
