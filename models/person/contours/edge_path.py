"""The closed path of least cost in a band around a line: resampling, direction-sensitive gradient, dynamic programming.

Thesis 2.4. The image is resampled on the normals of the line, with one row per point of the line and one column per
distance from it. A cell costs 1 - e / max e, where e = -dI/dn for a bright object, dI/dn for a dark one and |dI/dn| for
either, n is the outward normal, and I is smoothed by a Gaussian. From row to row the path stays in its column or moves
by one column, and it ends at most one column from its start. Between columns it lies at the maximum of a parabola
through e.

Positions are in pixels, x along the columns of the image and y down its rows, with 0 in the middle of the first pixel.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, map_coordinates, spline_filter

from models.person.contours.band import Inside

Line = Float[np.ndarray, "2 n"]
"""A closed line, without its first point repeated. If y is drawn upward, the inside is on the left: the area is
positive."""

ALONG_PX, ACROSS_PX = 1.0, 0.5
"""Steps of the resampling along and across the line (along as in thesis 2.5). Their ratio limits the angle between path
and line to 27 degrees."""

SMOOTHED_PX = 1.0
"""SD s of the Gaussian. It moves an edge on a circle of radius r inward by about s^2 / (2 r), 0.03 px at r = 20 px."""


_NEARER = 1e-9
"""Cost per pixel of distance from the line: of paths of equal cost, as in an image without edges, the nearest wins."""


class Slopes(NamedTuple):
    """dI/dx and dI/dy of a smoothed image, as coefficients of cubic splines. Linear interpolation between pixels would
    put an edge up to a quarter of a pixel off."""

    x: Float[np.ndarray, "rows columns"]
    y: Float[np.ndarray, "rows columns"]


def slopes_of(image: Float[np.ndarray, "rows columns"]) -> Slopes:
    """Differentiate an image smoothed by a Gaussian of SD ``SMOOTHED_PX``."""
    values = np.asarray(image, float)

    def smoothed(of: np.ndarray, axis: int, order: int) -> np.ndarray:
        return gaussian_filter1d(of, SMOOTHED_PX, axis=axis, order=order, mode="nearest")

    along = (smoothed(smoothed(values, 1 - axis, 0), axis, 1) for axis in (1, 0))
    return Slopes(*(spline_filter(one, mode="nearest") for one in along))


def area_px2(line: Line) -> float:
    """Compute the signed area inside a closed line, sum (x_i y_i+1 - x_i+1 y_i) / 2."""
    x, y = line
    return float(x @ np.roll(y, -1) - np.roll(x, -1) @ y) / 2.0


def smooth_line(points: Line) -> Line:
    """Sample a closed cubic spline through the points (knots by chord length) about every ``ALONG_PX``.

    ValueError for fewer than three different points.
    """
    points = points[:, np.linalg.norm(points - np.roll(points, 1, axis=1), axis=0) > 0.0]
    if points.shape[1] < 3:
        raise ValueError("a closed line needs three different points")
    closed = np.concatenate([points, points[:, :1]], axis=1)
    knots = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=1), axis=0)))
    spline = CubicSpline(knots, closed, axis=1, bc_type="periodic")
    fine = spline(np.linspace(0.0, knots[-1], 20 * points.shape[1] + 4 * int(knots[-1]) + 1))
    line = evenly(fine)
    return line if area_px2(line) > 0.0 else line[:, ::-1]


def evenly(closed: Float[np.ndarray, "2 n"]) -> Line:
    """Place points about ``ALONG_PX`` apart on a polygon whose first point is repeated last."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=1), axis=0)))
    at = np.linspace(0.0, length[-1], max(8, round(length[-1] / ALONG_PX)) + 1)[:-1]
    return np.stack([np.interp(at, length, row) for row in closed])


def normals(line: Line) -> Float[np.ndarray, "2 n"]:
    """Compute the outward unit normals of a closed line, from central differences."""
    tx, ty = np.roll(line, -1, axis=1) - np.roll(line, 1, axis=1)
    return np.stack([ty, -tx]) / np.maximum(np.hypot(tx, ty), 1e-12)


def edge(slopes: Slopes, at: Float[np.ndarray, "2 ..."], n: Float[np.ndarray, "2 ..."], inside: Inside):
    """Compute e at positions with outward normals n; beyond the image's border the gradient keeps its border value."""
    places = at[::-1].reshape(2, -1)
    x, y = (map_coordinates(one, places, mode="nearest", prefilter=False).reshape(at.shape[1:]) for one in slopes)
    outward = x * n[0] + y * n[1]
    return {"bright": -outward, "dark": outward, "either": np.abs(outward)}[inside]


def detect(slopes: Slopes, line: Line, half_width_px: float, inside: Inside) -> Line:
    """Find the closed path of least cost within ``half_width_px`` of a line, with one point per point of the line."""
    n = normals(line)
    steps = max(1, round(half_width_px / ACROSS_PX))
    away = ACROSS_PX * np.arange(-steps, steps + 1)
    at = line[:, :, None] + n[:, :, None] * away
    e = np.maximum(edge(slopes, at, np.broadcast_to(n[:, :, None], at.shape), inside), 0.0)
    highest = e.max()
    cost = 1.0 - e / highest if highest > 0.0 else np.ones_like(e)
    path = closed_path(cost + _NEARER * np.abs(away))
    return line + n * (away[path] + ACROSS_PX * _between(e, path))


def closed_path(cost: Float[np.ndarray, "rows columns"]) -> Int[np.ndarray, " rows"]:
    """Find the columns of the closed path of least total cost through all rows.

    Neighbouring rows, including the last and the first, differ by at most one column.
    """
    rows, columns = cost.shape
    total = np.where(np.eye(columns, dtype=bool), cost[0], np.inf)  # axes: column in the first row, current column
    came = np.zeros((rows, columns, columns), np.int8)
    for row in range(1, rows):
        padded = np.pad(total, ((0, 0), (1, 1)), constant_values=np.inf)
        each = np.stack([padded[:, 1 + k : 1 + k + columns] for k in (-1, 0, 1)])
        best = np.argmin(each, axis=0)
        came[row] = best - 1
        total = np.take_along_axis(each, best[None], axis=0)[0] + cost[row]
    apart = np.abs(np.subtract.outer(np.arange(columns), np.arange(columns)))
    first, column = np.unravel_index(np.argmin(np.where(apart <= 1, total, np.inf)), total.shape)
    path = np.empty(rows, int)
    for row in range(rows - 1, -1, -1):
        path[row] = column
        column = column + came[row, first, column]
    return path


def _between(e: Float[np.ndarray, "rows columns"], path: Int[np.ndarray, " rows"]) -> Float[np.ndarray, " rows"]:
    """Compute the offset, in columns and at most one, of the maximum of the parabola through e at and beside the path.

    The offset is 0 where the parabola has no maximum, or where the path is in an outermost column.
    """
    inner = np.clip(path, 1, e.shape[1] - 2)
    before, here, after = (e[np.arange(len(path)), inner + k] for k in (-1, 0, 1))
    bent = before - 2.0 * here + after
    peak = (before - after) / np.where(bent < 0.0, 2.0 * bent, -np.inf)
    return np.where(inner == path, np.clip(peak, -1.0, 1.0), 0.0)
