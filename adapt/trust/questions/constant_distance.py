"""Do TS and AI keep a constant distance to the thorax (thesis, chapter 7)? Their distance in measured postures.

The bones are placed by the measured angles, whether the chain closes or not: the distances that A1 and A2 of Eq. 6.2
hold constant are computed, not enforced. Noise of the angles alone also makes the distances vary, even in postures that
the chain can take: :func:`noise_over_elevation` simulates this variation.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Shaped

from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle, landmarks
from motions.rotations import DEG

POINTS = ("TS", "AI")


@dataclass(frozen=True)
class DistanceOverElevation:
    """Statistics of the distances of ``POINTS`` to the ellipsoid per subject; the axis ``repeats`` is optional."""

    mean_mm: Float[np.ndarray, "2 subjects *repeats"]
    sd_mm: Float[np.ndarray, "2 subjects *repeats"]
    """SD over postures."""
    slope_mm_per_deg: Float[np.ndarray, "2 subjects *repeats"]
    """Slope over the elevation of the arm within motions; each motion has its own offset. NaN if the elevation varies
    in no motion."""


def thorax_distances_mm(girdle: Girdle, angles: Float[np.ndarray, " 6 *batch"]) -> Float[np.ndarray, " 2 *batch"]:
    """Compute the distances of TS and AI to the ellipsoid in postures (rad), mm, positive outside."""
    at = landmarks(girdle, angles)
    points = (signed_distance_mm(point, girdle.centre_mm, girdle.semi_axes_mm) for point in (at.TS, at.AI))
    return np.stack([np.asarray(one) for one in points])


def distances_over_elevation(
    distances_mm: Float[np.ndarray, "2 postures *repeats"],
    subject: Shaped[np.ndarray, " postures"],
    motion: Shaped[np.ndarray, " postures"],
    elevation_deg: Float[np.ndarray, " postures"],
) -> DistanceOverElevation:
    """Compute mean, SD and slope of each subject, in the order of first appearance."""
    parts = []
    for name in dict.fromkeys(subject.tolist()):
        mine = distances_mm[:, subject == name]
        slope = _slope_within(mine, motion[subject == name], elevation_deg[subject == name])
        parts.append((mine.mean(axis=1), mine.std(axis=1, ddof=1), slope))
    return DistanceOverElevation(*(np.stack(one, axis=1) for one in zip(*parts, strict=True)))


def _slope_within(values, motion, elevation_deg) -> Float[np.ndarray, " 2 *repeats"]:
    """Fit value = offset of the motion + slope * elevation by least squares; return the slope."""
    same = motion[:, None] == motion[None]
    lever = elevation_deg - same @ elevation_deg / same.sum(axis=1)
    squares = float(lever @ lever)
    if not squares > 0.0:
        return np.full((2, *values.shape[2:]), np.nan)
    return np.tensordot(values, lever, axes=([1], [0])) / squares


def noise_over_elevation(
    girdle: Girdle,
    closed: Float[np.ndarray, "6 postures"],
    noise_deg: float,
    subject: Shaped[np.ndarray, " postures"],
    motion: Shaped[np.ndarray, " postures"],
    elevation_deg: Float[np.ndarray, " postures"],
    repeats: int,
    seed: int,
) -> DistanceOverElevation:
    """Compute the statistics that noise alone gives, from simulated measurements of closed postures (rad).

    Every angle has an independent Gaussian error of SD ``noise_deg``. ``girdle`` has one element per posture.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    errors = noise_deg / DEG * generator.standard_normal((repeats, *closed.shape))
    found = [thorax_distances_mm(girdle, closed + one) for one in errors]
    return distances_over_elevation(np.stack(found, axis=-1), subject, motion, elevation_deg)
