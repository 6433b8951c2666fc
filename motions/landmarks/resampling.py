"""Sampling of a trial at chosen elevations of the arm: value, spread and number of frames at each."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from motions.errors import InputError, warn_input

WINDOW_DEG = 5.0
"""Half width of the window of frames about a chosen elevation. Over it, the rhythm bends by less than 0.2 degrees."""

FEWEST_FRAMES = 4
"""Minimum number of frames per posture: a line has two unknowns, and fewer frames do not show the spread."""

REACH_DEG = 1.0
"""Distance beyond the highest or lowest frame at which a chosen elevation is still reached."""


class Sampled(NamedTuple):
    """Samples at each chosen elevation that the trial reached, for each column of values."""

    at_deg: Float[np.ndarray, " postures"]
    values: Float[np.ndarray, "postures columns"]
    spread: Float[np.ndarray, "postures columns"]
    """SD of single frames about the local line, from noise and from the difference between raising and lowering."""
    frames: Int[np.ndarray, " postures"]


def resample(
    elevation_deg: Float[np.ndarray, " frames"],
    values: Float[np.ndarray, "frames columns"],
    at_deg: Float[np.ndarray, " chosen"],
) -> Sampled:
    """Compute the values on the least-squares line through the frames within WINDOW_DEG of each chosen elevation.

    If the trial ends within the window, and the window has fewer than FEWEST_FRAMES, the window extends farther into
    the trial, to at most 2 WINDOW_DEG.
    Frames with a gap in a column do not count in this column; raising and lowering count alike. Chosen elevations that
    the trial did not reach, or at which no column has FEWEST_FRAMES, are left out.
    """
    known = elevation_deg[np.isfinite(elevation_deg)]
    rows = []
    for at in at_deg:
        if not known.size or not known.min() - REACH_DEG <= at <= known.max() + REACH_DEG:
            continue
        near = _near(elevation_deg, at)
        columns = [_at(elevation_deg[near] - at, column[near]) for column in values.T]
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


def resample_trial(
    elevation_deg: Float[np.ndarray, " frames"],
    values: Float[np.ndarray, "frames columns"],
    at_deg: Float[np.ndarray, " chosen"],
    file: str,
    whose: str,
) -> Sampled:
    """Sample a trial as ``resample`` does. InputWarning with the elevations left out, InputError if all are."""
    sampled = resample(elevation_deg, values, at_deg)
    left_out = [f"{at:g}" for at in at_deg if at not in sampled.at_deg]
    if not left_out:
        return sampled
    known = elevation_deg[np.isfinite(elevation_deg)]
    goes = f"the arm goes from {known.min():.0f} to {known.max():.0f} degrees" if known.size else "it has no elevations"
    cause = (
        f"{whose}: no posture at {', '.join(left_out)} degrees of --at: {goes}, and a posture needs {FEWEST_FRAMES} "
        f"frames within {WINDOW_DEG:g} degrees, or within {2 * WINDOW_DEG:g} of an end"
    )
    error = InputError(file, None, cause, "Choose elevations that the trial passes through, away from gaps")
    if not len(sampled.at_deg):
        raise error
    warn_input(error)
    return sampled


def _near(elevation_deg: Float[np.ndarray, " frames"], at: float) -> Bool[np.ndarray, " frames"]:
    """Find the frames within WINDOW_DEG of an elevation; at an end of the trial, as many more as make FEWEST_FRAMES."""
    away = np.abs(elevation_deg - at)
    near = away <= WINDOW_DEG
    beyond = np.nanmin(elevation_deg) > at - WINDOW_DEG or np.nanmax(elevation_deg) < at + WINDOW_DEG
    if not beyond or np.sum(near) >= FEWEST_FRAMES or len(away) < FEWEST_FRAMES:
        return near
    return away <= min(np.sort(away)[FEWEST_FRAMES - 1], 2.0 * WINDOW_DEG)


def _at(from_chosen_deg: Float[np.ndarray, " near"], values: Float[np.ndarray, " near"]) -> tuple[float, float, int]:
    """Compute the line's value at the chosen elevation, the SD about the line (n - 2), and the number of frames."""
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
