"""Distances of TS and AI to the ellipsoid: the set's in closed postures; courses by hand; spread from noise."""

import jax
import numpy as np
import pytest
from programs import few_runs

from adapt import fit_postures
from adapt.trust.questions.constant_distance import distances_over_elevation, noise_over_elevation, thorax_distances_mm
from models import load_model
from models.girdle import Girdle
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG

CLOSED_MM = 1e-9
"""Tolerance of a posture fit."""

EXACT = 1e-12
"""Rounding of sums of a few numbers of order 10."""

CHANCE = 0.06
"""Relative tolerance, six SDs: the SD of 14 postures times 300 repeats has an error of 1 %."""

NOISE_DEG = 0.05
"""Noise so small that the distances are linear in the errors to a hundredth."""


@pytest.fixture(scope="module")
def closed() -> tuple[Girdle, np.ndarray]:
    """14 closed postures of one simulated subject with R2, and the girdle of each."""
    model, motions = load_model("R2"), read_motions(DATA_FILE)
    fitted = fit_postures(motions.select(motions.subject == "simulated01"), model).by_model["R2"]
    return model.girdle.repeated(fitted.angles.shape[1]), fitted.angles


def test_closed_postures_have_the_distances_of_the_set(closed):
    girdle, angles = closed
    found = thorax_distances_mm(girdle, angles)
    expected = np.stack([girdle.ts_distance_mm, girdle.ai_distance_mm])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=CLOSED_MM)


def test_mean_sd_and_slope_of_distances_made_by_hand():
    """Two motions, with offsets 1 and 5, rise by 0.1 mm per degree; a third at one elevation does not matter."""
    elevation = np.array([0.0, 40.0, 80.0, 10.0, 60.0, 90.0, 90.0, 0.0, 0.0])
    motion = np.array(["a", "a", "a", "b", "b", "c", "c", "d", "d"], object)
    subject = np.array(["one"] * 7 + ["still"] * 2, object)
    offset = np.array([1.0, 1.0, 1.0, 5.0, 5.0, -30.0, 70.0, 2.0, 4.0])
    moving = np.where(elevation == 90.0, 0.0, 0.1 * elevation)
    distances = np.stack([offset + moving, -offset])
    found = distances_over_elevation(distances, subject, motion, elevation)
    np.testing.assert_allclose(found.slope_mm_per_deg[:, 0], [0.1, 0.0], rtol=0.0, atol=EXACT)
    assert np.isnan(found.slope_mm_per_deg[:, 1]).all()
    np.testing.assert_allclose(found.mean_mm[:, 1], [3.0, -3.0], rtol=EXACT)
    np.testing.assert_allclose(found.sd_mm[:, 1], np.sqrt(2.0), rtol=EXACT)
    np.testing.assert_allclose(found.sd_mm[0, 0], np.std(distances[0, :7], ddof=1), rtol=EXACT)


def test_noise_alone_gives_the_spread_of_the_slopes_of_the_constraints(closed):
    """Check the variance of A1 and A2 in a posture, s^2 |dg/dq|^2, and of the slope, as the sum with squared levers."""
    girdle, angles = closed
    subject, motion = np.full(14, "one", object), np.repeat(np.array(["a", "b"], object), 7)
    elevation = np.tile(np.linspace(0.0, 150.0, 7), 2)
    found = noise_over_elevation(girdle, angles, NOISE_DEG, subject, motion, elevation, repeats=300, seed=3)
    units = np.broadcast_to(np.eye(6)[:, :, None], (6, *angles.shape)).copy()
    along = few_runs(lambda unit: jax.jvp(girdle.residuals_mm, (angles,), (unit,))[1][:2])
    G = np.array([along(unit) for unit in units])
    variance = (NOISE_DEG / DEG) ** 2 * (G**2).sum(axis=0)
    np.testing.assert_allclose((found.sd_mm[:, 0] ** 2).mean(axis=-1), variance.mean(axis=-1), rtol=2.0 * CHANCE)
    lever = elevation - elevation.mean()
    expected = np.sqrt((variance * lever**2).sum(axis=-1)) / (lever @ lever)
    np.testing.assert_allclose(found.slope_mm_per_deg[:, 0].std(axis=-1), expected, rtol=4.0 * CHANCE)
