"""A trial at chosen elevations of the arm: a value there, the spread about it and the frames that it rests on."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

WINDOW_DEG = 5.0
"""Frames within this much of a chosen elevation count. The rhythm bends by less than 0.2 degrees over it."""

FEWEST_FRAMES = 4
"""A line has two unknowns; with fewer frames there is nothing to judge the spread by."""

REACH_DEG = 1.0
"""A chosen elevation this far beyond the highest or lowest frame is still reached."""


class Sampled(NamedTuple):
    """At each chosen elevation that the trial reached, and for each column of values."""

    at_deg: Float[np.ndarray, " postures"]
    values: Float[np.ndarray, "postures columns"]
    spread: Float[np.ndarray, "postures columns"]
    """SD of single frames about the local line: noise, and how raising and lowering differ."""
    frames: Int[np.ndarray, " postures"]


def resample(
    elevation_deg: Float[np.ndarray, " frames"],
    values: Float[np.ndarray, "frames columns"],
    at_deg: Float[np.ndarray, " chosen"],
) -> Sampled:
    """Compute the values on the least-squares line through the frames within WINDOW_DEG of each chosen elevation.

    Frames with a gap in a column do not count there; raising and lowering count alike. Chosen elevations that the
    trial did not reach, or at which no column has FEWEST_FRAMES, are left out.
    """
    known = elevation_deg[np.isfinite(elevation_deg)]
    rows = []
    for at in at_deg:
        near = np.abs(elevation_deg - at) <= WINDOW_DEG
        reached = known.size > 0 and known.min() - REACH_DEG <= at <= known.max() + REACH_DEG
        columns = [_at(elevation_deg[near] - at, column[near]) for column in values.T] if reached else []
        if any(count >= FEWEST_FRAMES for _, _, count in columns):
            value, spread, count = map(np.array, zip(*columns, strict=True))
            rows.append((at, value, spread, int(count.max())))
    empty = np.zeros((0, values.shape[1]))
    return Sampled(
        np.array([row[0] for row in rows]),
        np.stack([row[1] for row in rows]) if rows else empty,
        np.stack([row[2] for row in rows]) if rows else empty,
        np.array([row[3] for row in rows], dtype=np.int64),
    )


def _at(from_chosen_deg: Float[np.ndarray, " near"], values: Float[np.ndarray, " near"]) -> tuple[float, float, int]:
    """The line's value at the chosen elevation, the SD about the line (n - 2), and the number of frames."""
    measured = np.isfinite(values)
    x, y = from_chosen_deg[measured], values[measured]
    count = len(x)
    if count < FEWEST_FRAMES:
        return np.nan, np.nan, count
    x_mean, y_mean = x.mean(), y.mean()
    square = float(np.sum((x - x_mean) ** 2))
    slope = float(np.sum((x - x_mean) * (y - y_mean))) / square if square > 0.0 else 0.0
    rest = y - y_mean - slope * (x - x_mean)
    return float(y_mean - slope * x_mean), float(np.sqrt(np.sum(rest**2) / (count - 2))), count
