"""Simulated subjects: the distribution of the draws, and the shipped file equals the function's output."""

import numpy as np
import pytest
from numpy.random import PCG64, Generator

from motions import ANGLES, read_motions, write_motions
from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.rhythm_subjects import (
    DATA_FILE,
    DATA_SUBJECTS,
    NOISE_DEG,
    REST_SD_DEG,
    SLOPE_SD,
    draw_subjects,
    noise_free_subjects,
    shipped_subjects,
    simulate_subjects,
    subject_angles_deg,
)

MANY = 4000
"""Number of subjects that gives a standard deviation to 1.1 % (one standard error)."""


def test_the_shipped_file_is_what_the_function_makes(tmp_path):
    again = tmp_path / "again.csv"
    write_motions(shipped_subjects(), again)
    assert again.read_bytes() == DATA_FILE.read_bytes()


def test_the_shipped_file_can_be_read():
    motions = read_motions(DATA_FILE)
    assert len(motions.subjects) == DATA_SUBJECTS
    assert motions.rejected == ()
    assert set(motions.extra["origin"]) == {"simulated"}


def test_layout_of_the_rows():
    motions = simulate_subjects(2, seed=3)
    assert motions.subjects == ("simulated01", "simulated02")
    assert motions.motion.tolist() == (["abduction"] * 7 + ["forward_flexion"] * 7) * 2
    assert motions.posture.tolist() == [1, 2, 3, 4, 5, 6, 7] * 4
    assert motions.humerus_elevation_deg.tolist() == [0.0, 25.0, 50.0, 75.0, 100.0, 125.0, 150.0] * 4


def test_a_row_is_the_rhythm_of_its_subject():
    generator = Generator(PCG64(5))
    rest_deg, coefficients = draw_subjects(3, generator)
    plane_deg, elevation_deg = np.array([0.0, 90.0]), np.array([50.0, 125.0])
    angles_deg = subject_angles_deg(rest_deg, coefficients, plane_deg, elevation_deg)
    motions = noise_free_subjects(3, Generator(PCG64(5)))
    for subject in range(3):
        for place, row in enumerate((2, 12)):
            arm_deg = np.array(plane_deg[place]), np.array(elevation_deg[place])
            alone = girdle_angles_deg(rest_deg[:, subject], *arm_deg, coefficients[..., subject])
            np.testing.assert_allclose(angles_deg[:, subject, place], alone, rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(motions.angles_deg[14 * subject + row], alone, rtol=0.0, atol=1e-12)


def test_the_seed_decides():
    first, again, other = (simulate_subjects(2, seed).angles_deg for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.any(first == other)


def test_spread_between_subjects():
    rest_deg, coefficients = draw_subjects(MANY, Generator(PCG64(0)))
    np.testing.assert_allclose(rest_deg.mean(axis=1), REST_DEG, rtol=0.0, atol=5 * REST_SD_DEG / np.sqrt(MANY))
    np.testing.assert_allclose(rest_deg.std(axis=1), REST_SD_DEG, rtol=0.06)
    factors = coefficients[:, 1:3] / COEFFICIENTS[:, 1:3, None]
    np.testing.assert_allclose(factors.std(axis=-1), SLOPE_SD, rtol=0.06)
    assert (coefficients[:, [0, 3]] == COEFFICIENTS[:, [0, 3], None]).all()


@pytest.mark.parametrize("noise_deg", [0.0, NOISE_DEG])
def test_noise_has_the_stated_size_on_every_angle(noise_deg):
    noisy = simulate_subjects(300, seed=4, noise_deg=noise_deg).angles_deg
    exact = noise_free_subjects(300, Generator(PCG64(4))).angles_deg
    np.testing.assert_allclose((noisy - exact).std(axis=0), np.full(len(ANGLES), noise_deg), rtol=0.06)
