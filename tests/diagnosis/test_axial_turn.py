"""How far the clavicle turns about its own axis, as one more residual."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.diagnosis.fit.linear_evidence import InnerProducts, log_evidence
from adapt.diagnosis.fit.linear_model import shared_prior
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference import axial_turn
from adapt.diagnosis.inference.axial_turn import mean_subject, with_mean_subject
from adapt.diagnosis.inference.departures import departures_per_channel
from models.effects import EFFECTS
from motions.rotations import DEG

LAG, STRAIN, TILT = (EFFECTS[name] for name in ("clavicle_axial_estimate", "conoid_strain", "thorax_tilt"))
SUBJECTS, POSTURES = 4, 6
SAME = 1e-12


def turning(by_full_elevation_deg: float, elevation_deg=(0.0, 75.0, 150.0)) -> Observed:
    """Two motions of three postures each; the second starts 20 degrees farther on."""
    elevation = np.tile(elevation_deg, 2)
    f = elevation / 150.0
    values = np.zeros((6, POSTURES, SUBJECTS))
    values[2] = (by_full_elevation_deg * f + 20.0 * (np.arange(POSTURES) >= 3))[:, None] / DEG
    return Observed(
        values=values,
        measured=np.ones((6, POSTURES, SUBJECTS), bool),
        elevation_deg=np.repeat(elevation[:, None], SUBJECTS, axis=1),
        counted=np.ones((POSTURES, SUBJECTS), bool),
        motion=np.repeat((np.arange(POSTURES) >= 3).astype(int)[:, None], SUBJECTS, axis=1),
        subjects=tuple("abcd"),
        motions=("up", "forward"),
    )


def sd_deg(subjects: int = SUBJECTS) -> float:
    return float(np.sqrt(axial_turn._STUDIES_DEG**2 + axial_turn._PEOPLE_DEG**2 / subjects))


@pytest.mark.parametrize("turn_deg", [0.0, 33.0, 60.0])
def test_what_was_measured_is_compared_with_what_is_published(turn_deg):
    """Motions that start elsewhere have the same slope."""
    found = mean_subject([], turning(turn_deg))
    assert found is not None
    assert found.columns.shape == (0,)
    assert found.measured == pytest.approx((axial_turn._PUBLISHED_DEG - turn_deg) / sd_deg(), abs=SAME)


def test_a_lag_adds_its_own_course_to_what_was_measured():
    """f^2, 4 f (1 - f) and its change of sign at 0, 1/2 and 1 have slopes of 1, 0 and 0; departures that are symmetric
    or in one motion only have their share; nothing else adds to the turn."""
    data = turning(20.0)
    found = mean_subject([STRAIN, LAG, TILT], data)
    assert found is not None
    each = departures_per_channel(data)
    np.testing.assert_allclose(found.columns[:3], 0.0)
    np.testing.assert_allclose(found.columns[3:6] * sd_deg(), [1.0, 0.0, 0.0], atol=SAME)
    assert len(found.columns) == 6 + len(TILT.channels) + 2 * each
    start = 6 + len(TILT.channels) + each
    np.testing.assert_allclose(found.columns[6:start], 0.0)
    first, second = found.columns[start + each - 2 : start + each] * sd_deg()
    assert (first, second) == (pytest.approx(0.0, abs=SAME), pytest.approx(0.0, abs=SAME))


def test_a_lag_as_large_as_what_is_missing_leaves_nothing():
    """13 degrees missing at full elevation: a residual of zero."""
    found = mean_subject([LAG], turning(axial_turn._PUBLISHED_DEG - 13.0))
    assert found is not None
    assert found.columns[0] * 13.0 - found.measured == pytest.approx(0.0, abs=SAME)


def test_without_a_slope_there_is_nothing_to_compare():
    level = turning(0.0, elevation_deg=(90.0, 90.0, 100.0))
    assert mean_subject([LAG], level) is None
    unmeasured = turning(33.0)
    unmeasured = replace(unmeasured, measured=unmeasured.measured & (np.arange(6) != 2)[:, None, None])
    assert mean_subject([LAG], unmeasured) is None


def test_subjects_without_a_slope_do_not_count():
    data = turning(40.0)
    data = replace(data, counted=data.counted & (np.arange(SUBJECTS) > 0))
    found = mean_subject([], data)
    assert found is not None
    assert found.measured == pytest.approx((axial_turn._PUBLISHED_DEG - 40.0) / sd_deg(SUBJECTS - 1), abs=SAME)


def test_one_more_residual_is_that_of_the_dense_gaussian():
    """Evidence of a mean subject alone: seen ~ N(0, 1 + columns (common^2 + between^2) columns')."""
    found, scale = mean_subject([LAG], turning(10.0)), np.array([15.0, 4.5, 3.0])
    assert found is not None
    columns, prior = found.columns[:3], shared_prior(scale)
    nobody = InnerProducts(np.zeros((0, 9, 9)), np.zeros((0, 9)), np.zeros(()), residuals=0)
    variance = 1.0 + (columns**2 * (prior.common**2 + prior.between**2)).sum()
    statistics = with_mean_subject(nobody, found._replace(columns=columns)).at()
    expected = -0.5 * (found.measured**2 / variance + np.log(variance))
    assert float(log_evidence(statistics, prior)) == pytest.approx(expected, abs=1e-10)


def test_without_one_the_products_stay():
    nobody = InnerProducts(np.zeros((0, 9, 9)), np.zeros((0, 9)), np.zeros(()), residuals=0)
    assert with_mean_subject(nobody, None) is nobody
