"""Simulated subjects: the published rhythm, variation between subjects, and measurement noise.

``python -m motions.rhythm_subjects`` writes the motion file that the project ships.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.random import PCG64, Generator

from motions.motion_csv.writing import write_motions
from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.table import Motions

REST_SD_DEG = 5.0
"""SD between subjects of each angle at rest, in degrees. The factors 0.41-0.90 of the regression reduce it to 2.1-4.5,
which agrees with 2.8-4.5: a quarter of the width, 11-18, of the regression's 95 % interval (thesis, section 6.1)."""

SLOPE_SD = 0.15
"""SD between subjects of the factor on the slopes of an angle. Assumed: at 150 degrees of elevation lateral rotation
then varies by 9 degrees and the other angles by 1-5, much as the curves of Figure 6.4 diverge."""

NOISE_DEG = 1.5
"""SD of the error of one measured angle, in degrees: palpation of the landmarks of a standing subject. Assumed."""

MOTION_PLANES_DEG = {"abduction": 0.0, "forward_flexion": 90.0}
"""Planes of elevation of the two motions of the thesis (section 6.2.2), in degrees."""

ELEVATIONS_DEG = np.arange(0.0, 151.0, 25.0)
"""Elevations of the seven postures of each motion, in degrees."""

DATA_FILE = Path(__file__).parent / "data" / "simulated_subjects.csv"
DATA_SUBJECTS, DATA_SEED, DATA_DECIMALS = 10, 1999, 2
"""Number of subjects, as in the thesis; seed, the year of the thesis; and decimals of the angles in degrees."""


def simulate_subjects(n: int, seed: int, noise_deg: float = NOISE_DEG) -> Motions:
    """Simulate n subjects with two motions each and measurement noise; equal seeds give equal subjects."""
    generator = Generator(PCG64(seed))
    return add_noise(noise_free_subjects(n, generator), noise_deg, generator)


def noise_free_subjects(n: int, generator: Generator) -> Motions:
    """Simulate n subjects ``simulated01``, ... with noise-free angles in degrees."""
    plane_deg = np.repeat(list(MOTION_PLANES_DEG.values()), len(ELEVATIONS_DEG))
    elevation_deg = np.tile(ELEVATIONS_DEG, len(MOTION_PLANES_DEG))
    rest_deg, coefficients = draw_subjects(n, generator)
    angles_deg = subject_angles_deg(rest_deg, coefficients, plane_deg, elevation_deg)
    rows = n * len(elevation_deg)
    return Motions(
        subject=np.repeat([f"simulated{number:02d}" for number in range(1, n + 1)], len(elevation_deg)),
        motion=np.tile(np.repeat(list(MOTION_PLANES_DEG), len(ELEVATIONS_DEG)), n),
        posture=np.tile(np.arange(1, len(ELEVATIONS_DEG) + 1), n * len(MOTION_PLANES_DEG)),
        humerus_elevation_deg=np.tile(elevation_deg, n),
        angles_deg=angles_deg.reshape(6, rows).T.copy(),
        landmarks_mm={},
        extra=pd.DataFrame({"origin": ["simulated"] * rows}, dtype=str),
    )


def draw_subjects(
    n: int, generator: Generator
) -> tuple[Float[np.ndarray, "6 subjects"], Float[np.ndarray, "5 4 subjects"]]:
    """Draw the angles at rest in degrees and the coefficients of the rhythm of n individuals.

    rest = REST_DEG + REST_SD_DEG N(0, 1) for each angle. The two slopes of an angle (plane, elevation) are the
    published ones times 1 + SLOPE_SD N(0, 1), with a separate factor for each slope.
    """
    rest_deg = REST_DEG[:, None] + REST_SD_DEG * generator.standard_normal((6, n))
    coefficients = np.repeat(COEFFICIENTS[:, :, None], n, axis=2)
    coefficients[:, 1:3] *= 1.0 + SLOPE_SD * generator.standard_normal((5, 2, n))
    return rest_deg, coefficients


def subject_angles_deg(
    rest_deg: Float[np.ndarray, "6 subjects"],
    coefficients: Float[np.ndarray, "5 4 subjects"],
    plane_deg: Float[np.ndarray, " postures"],
    elevation_deg: Float[np.ndarray, " postures"],
) -> Float[np.ndarray, "6 subjects postures"]:
    """Predict the noise-free ANGLES in degrees of every subject in every posture: see ``girdle_angles_deg``."""
    shape = (rest_deg.shape[1], len(elevation_deg))
    return girdle_angles_deg(
        np.broadcast_to(rest_deg[..., None], (6, *shape)),
        np.broadcast_to(plane_deg, shape),
        np.broadcast_to(elevation_deg, shape),
        np.broadcast_to(coefficients[..., None], (5, 4, *shape)),
    )


def add_noise(motions: Motions, noise_deg: float, generator: Generator) -> Motions:
    """Add an independent Gaussian error of SD ``noise_deg`` degrees to every angle."""
    noise = generator.standard_normal(motions.angles_deg.shape)
    return replace(motions, angles_deg=motions.angles_deg + noise_deg * noise)


def shipped_subjects() -> Motions:
    """Simulate the subjects of the motion file that the project ships."""
    motions = simulate_subjects(DATA_SUBJECTS, DATA_SEED)
    return replace(motions, angles_deg=np.round(motions.angles_deg, DATA_DECIMALS))


if __name__ == "__main__":
    write_motions(shipped_subjects(), DATA_FILE)
