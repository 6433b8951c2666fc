"""Choices of an adaptation that the thesis leaves open, and the problems that each choice makes."""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.solvers.objective import DEFAULT_OBJECTIVE, WEIGHT
from adapt.solvers.problems import Problems
from adapt.solvers.unmeasured import at_rest
from models.sets.set_geometry import SHORTEST_MM
from motions.landmarks.girdle_angles import CLAVICLE_X
from scripts.completion import POINT_AZIMUTHS_DEG

POINTS = {
    "all": POINT_AZIMUTHS_DEG,
    "under the scapula": POINT_AZIMUTHS_DEG[2:],
    "serratus origins and wrap": POINT_AZIMUTHS_DEG[:2],
}
"""Columns of thorax points that count, by their azimuth from lateral toward backward (scripts.completion)."""

BOUNDS = {"as shipped": 1.0, "half": 0.5, "double": 2.0, "none": None}
"""Factors on the half widths of the bounds; None is ``NO_BOUND_MM``."""

NO_BOUND_MM = 1e6

MEASURED, ESTIMATED, FROM_SET, LEFT_OUT, LEFT_OUT_FROM_SET = AXIAL = (
    "six angles",
    "six, axial estimated",
    "six, axial estimated from the set's own",
    "five angles",
    "five, axial gap of the estimate from the set's own",
)
"""Clavicle's axial rotation in J: as measured; as estimated from two landmarks (6.3), from 0 in the lowest arm posture
or from the value with which the set closes there; or left out of J, with the gap of the measured value or of the second
estimate reported."""

SIDES = {"signed": ((None, None),), "unsigned": ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))}
"""Signs of const1 and const2 of A1 and A2: the set's own, or any (Eq. 6.2 has unsigned lengths). A bone cannot cross
the ellipsoid from one side to the other, so all postures of a subject have the same signs."""


@dataclass(frozen=True)
class Variant:
    """One combination of all choices; the default values are as shipped."""

    objective: str = DEFAULT_OBJECTIVE
    weight: float = WEIGHT
    axial: str = MEASURED
    points: str = "all"
    bounds: str = "as shipped"
    distances: str = "signed"


def variant_problems(
    data: Problems, axial: Float[np.ndarray, " postures problems"], variant: Variant
) -> list[Problems]:
    """Make the problems of a variant, one for each choice of sides. axial: its clavicular axial rotation, rad."""
    data = with_axial(data, axial)
    if variant.axial in (LEFT_OUT, LEFT_OUT_FROM_SET):
        data = without_axial(data)
    data = with_bounds(with_points(data, variant.points), BOUNDS[variant.bounds])
    return [on_sides(data, *signs) for signs in SIDES[variant.distances]]


def with_axial(data: Problems, axial: Float[np.ndarray, " postures problems"]) -> Problems:
    """Replace the axial rotation of the clavicle, rad."""
    angles = np.array(data.angles)
    angles[CLAVICLE_X] = axial
    return replace(data, angles=angles)


def without_axial(data: Problems) -> Problems:
    """Leave the axial rotation out of J."""
    measured = np.array(data.measured)
    measured[CLAVICLE_X] = False
    return replace(data, angles=at_rest(np.asarray(data.angles), measured), measured=measured)


def azimuth_deg(data: Problems) -> Float[np.ndarray, "points problems"]:
    """Compute each point's azimuth (of the parameter) about the ellipsoid's centre, from lateral toward backward."""
    scaled = np.asarray((data.points_mm - data.girdle.centre_mm[:, None]) / data.girdle.semi_axes_mm[:, None])
    return np.degrees(np.arctan2(scaled[2], scaled[0]))


def with_points(data: Problems, name: str) -> Problems:
    """Give equal weights to the named columns of points, and none to the others."""
    columns = np.array(POINT_AZIMUTHS_DEG)
    nearest = columns[np.argmin(np.abs(azimuth_deg(data)[..., None] - columns), axis=-1)]
    counts = np.isin(nearest, POINTS[name]) & (np.asarray(data.point_weights) > 0.0)
    return replace(data, point_weights=counts / counts.sum(axis=0))


def with_bounds(data: Problems, factor: float | None) -> Problems:
    """Scale the distances of the bounds, or remove the bounds; semi-axes and conoid stay at least ``SHORTEST_MM``."""
    own = data.girdle.adapted_mm
    away = data.bounds_mm - own if factor is not None else NO_BOUND_MM * np.array([-1.0, 1.0])[:, None, None]
    bounds = jnp.asarray(own + (1.0 if factor is None else factor) * away)
    return replace(data, bounds_mm=np.asarray(bounds.at[0, 2:].max(SHORTEST_MM)))


def on_sides(data: Problems, ts: float | None, ai: float | None) -> Problems:
    """Put TS and AI outside (1) or inside (-1) the ellipsoid at the same distance; None leaves them."""
    girdle = data.girdle
    distances = [
        own if sign is None else sign * np.abs(own)
        for own, sign in ((girdle.ts_distance_mm, ts), (girdle.ai_distance_mm, ai))
    ]
    return replace(data, girdle=replace(girdle, ts_distance_mm=distances[0], ai_distance_mm=distances[1]))
