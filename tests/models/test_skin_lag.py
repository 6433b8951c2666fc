"""The skin's lag: its size and its direction, against SciPy."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from models.effects import EFFECTS
from models.effects.measurement.skin_artefact import measured_lag_deg, own_way
from motions import Motions
from motions.rhythm_subjects import simulate_subjects

ROUNDING = 1e-12
"""Rounding of interpolated lags of some 10 degrees is 1e-14."""

UNIT = 1e-9
"""Tolerance for a unit vector that is normalised twice."""


def close(found, expected, tolerance: float) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance)


def raised(elevation_deg, angles_deg, motion="flexion", subject="one") -> Motions:
    """Make postures of one motion from elevations and (postures, 6) angles."""
    count = len(elevation_deg)
    return Motions(
        subject=np.array([subject] * count),
        motion=np.array([motion] * count),
        posture=np.arange(count),
        humerus_elevation_deg=np.asarray(elevation_deg, float),
        angles_deg=np.asarray(angles_deg, float),
        landmarks_mm={},
        extra=pd.DataFrame(index=range(count)),
    )


@pytest.mark.parametrize(
    ("motion", "elevation_deg", "lag_deg"),
    [
        ("abduction", [0, 20, 60, 100, 140], [0.0, 2.8, 7.9, 13.8, 13.8]),
        ("Elevation, frontal plane", [90, np.nan], [12.25, 0.0]),
        ("flexion", [0, 20, 80, 120, 140, 160], [0.0, 6.0, 14.0, 17.0, 20.0, 20.0]),
        ("scaption", [130, 30], [18.5, 8.0]),
    ],
)
def test_the_skin_lags_as_measured(motion, elevation_deg, lag_deg):
    close(measured_lag_deg(raised(elevation_deg, np.zeros((len(elevation_deg), 6)), motion)), lag_deg, ROUNDING)


ELEVATIONS_DEG = np.linspace(0.0, 140.0, 15)
AXIS = np.array([0.3, -0.4, 0.8]) / np.linalg.norm([0.3, -0.4, 0.8])


def about_one_axis(axis, subject="one") -> Motions:
    """Make measured angles of a scapula that turns about one axis in its own frame."""
    first = Rotation.from_euler("YZX", [35.0, 5.0, -12.0], degrees=True)
    turned = first * Rotation.from_rotvec(np.outer(ELEVATIONS_DEG / 5.0, axis), degrees=True)
    angles = np.hstack([np.zeros((15, 3)), turned.as_euler("YZX", degrees=True)])
    return raised(ELEVATIONS_DEG, angles, subject=subject)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_skin_stays_behind_on_the_way_that_the_scapula_turns(sign):
    """Check that the direction is that of lateral rotation, and R_true = R_measured exp(lag along this axis)."""
    motions = about_one_axis(sign * AXIS)
    lag = measured_lag_deg(motions)
    close(own_way(motions, lag), np.repeat(AXIS[:, None], 15, axis=1), 1e-8)
    close(EFFECTS["skin_artefact"].strengths(np.array([0.5]), motions), 0.5 * lag * AXIS[:, None], 1e-6)


REPORTED = {
    "proportional": lambda e: e,
    "as Cereatti 2017": lambda e: np.interp(e, [0, 20, 40, 60, 80, 100, 120, 140], [0, 6, 10, 12, 14, 16, 17, 20]),
    "accelerating above 90": lambda e: np.maximum(0.0, e - 90.0),
    "with the square": lambda e: e**2,
}


@pytest.mark.parametrize("name", REPORTED)
def test_a_lag_of_every_reported_course_is_nearly_one_of_any_way(name):
    """Check reported courses of 12 deg at the end: the terms explain nine tenths, with plausible amplitudes."""
    motions = about_one_axis(AXIS)
    lag = 12.0 * REPORTED[name](ELEVATIONS_DEG) / REPORTED[name](140.0)
    effect = EFFECTS["skin_artefact:elevation"]
    columns = effect.columns(motions)[:3, 0].T
    _, sd = effect.amplitude_prior(motions)
    sd = sd[6:]  # about z
    A = np.vstack([columns, np.diag(0.5 / sd)])  # rows to half a degree, and the prior
    amplitude = np.linalg.lstsq(A, np.append(lag, np.zeros(3)))[0]
    assert np.mean((lag - columns @ amplitude) ** 2) < 0.1 * lag.var()
    assert np.sum((amplitude / sd) ** 2) < 11.3  # chi-square of 3, 1 %


def test_the_way_is_a_fixed_point_and_every_subjects_own():
    """Check by SciPy that u is parallel to the mean of log(R_0' R exp(lag u)) over the high postures."""
    published = simulate_subjects(3, seed=11)
    motions = Motions.concatenate([published, about_one_axis(AXIS, "other")])
    lag = measured_lag_deg(motions)
    way = own_way(motions, lag)
    close(np.linalg.norm(way, axis=0), np.ones(len(lag)), UNIT)
    assert (way[2] > 0.0).all()
    for subject in motions.subjects:
        rows = np.flatnonzero(motions.subject == subject)
        close(way[:, rows], np.repeat(way[:, rows[:1]], len(rows), axis=1), 0.0)
        elevation, u = motions.humerus_elevation_deg[rows], way[:, rows[0]]
        true = Rotation.from_euler("YZX", motions.angles_deg[rows, 3:], degrees=True) * Rotation.from_rotvec(
            np.outer(lag[rows], u), degrees=True
        )
        turned = (true[int(np.argmin(elevation))].inv() * true).as_rotvec()
        mean = turned[elevation >= 0.8 * elevation.max()].mean(axis=0)
        close(mean / np.linalg.norm(mean), u, 1e-3)


def test_where_no_way_was_measured_the_direction_is_lateral_rotation():
    unknown = raised([0.0, 90.0], np.full((2, 6), np.nan))
    close(own_way(unknown, np.array([0.0, 5.0])), [[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]], 0.0)
    assert np.isfinite(EFFECTS["skin_artefact"].columns(unknown)).all()
