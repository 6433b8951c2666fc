"""A contour in one slice: found from clicks or the contour of the slice before, corrected by three points, smoothed.

The band lies around a line: a closed spline through the clicks, which need not be on the edge, or another contour.
The path of least cost in the band is filtered as in thesis 2.4: loops are cut off, a polynomial of third order through
13 neighbouring points smooths each point, and Douglas-Peucker keeps the points that a polygon needs to stay within
0.5 px of the smoothed path.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from models.person.contours.band import VECTOR_PX, Settings
from models.person.contours.edge_path import Line, Slopes, area_px2, detect, edge, evenly, normals, smooth_line

_SMOOTHED_POINTS, _ORDER = 13, 3
"""Number of points and order of the smoothing polynomial (thesis 2.5)."""

_NARROW_PX = 2.0
"""Half width of the second band, around the contour of the first, where normals of the line are normals of the edge."""

_KEPT = 4
"""Step between the points of a contour through which the spline of a correction passes."""


@dataclass(frozen=True)
class Contour:
    """A closed contour, without its first point repeated."""

    points_px: Line
    weakest: float
    """Smallest mean of e (``models.person.contours.edge_path``) over 13 neighbouring points, in grey levels per pixel.
    A low value shows that the contour left the edge."""


Correction = Float[np.ndarray, "2 3"]
"""Points from, to and via: two on a contour, and one through which the contour between them should go."""


def drawn_contour(slopes: Slopes, clicks: Float[np.ndarray, "2 clicks"], settings: Settings) -> Contour:
    """Find the contour near a closed spline through at least three clicks. ValueError where there is no contour."""
    return found_contour(slopes, smooth_line(clicks), settings)


def found_contour(slopes: Slopes, line: Line, settings: Settings) -> Contour:
    """Find the contour in a band around a line, and smooth it. ValueError where the contour has no area."""
    for half_width_px in (settings.half_width_px, min(_NARROW_PX, settings.half_width_px)):
        line = smoothed(detect(slopes, line, half_width_px, settings.inside))
    e = edge(slopes, line, normals(line), settings.inside)
    return Contour(line, float(uniform_filter1d(e, _SMOOTHED_POINTS, mode="wrap").min()))


def corrected_line(contour: Line, correction: Correction) -> Line:
    """Replace the part of a contour between two of its points by a line via a third point.

    The points divide the contour into two parts; the part nearer to the third point is replaced. ValueError where
    nothing of the contour would be left.
    """
    first, last = (int(np.argmin(np.linalg.norm(contour - p[:, None], axis=0))) for p in correction.T[:2])
    via = correction[:, 2]
    count = contour.shape[1]
    arcs = [np.arange(a, a + (b - a) % count + 1) % count for a, b in ((first, last), (last, first))]
    far = [float(np.linalg.norm(contour[:, arc] - via[:, None], axis=0).min()) for arc in arcs]
    kept = arcs[1 - int(np.argmin(far))]
    places = np.unique(np.append(np.arange(0, len(kept), _KEPT), len(kept) - 1))
    if len(places) < 2:
        raise ValueError("a correction would leave nothing of the contour")
    return smooth_line(np.concatenate([contour[:, kept[places]], via[:, None]], axis=1))


def smoothed(line: Line) -> Line:
    """Cut off loops, space the points evenly and smooth them. ValueError where no area is left."""
    whole = evenly(_without_loops(line))
    points = min(_SMOOTHED_POINTS, whole.shape[1] - (1 - whole.shape[1] % 2))
    return np.asarray(savgol_filter(whole, points, min(_ORDER, points - 1), axis=1, mode="wrap"))


def _without_loops(line: Line) -> Float[np.ndarray, "2 n"]:
    """Return the outline of the largest area that a line encloses; positive area, first point repeated last."""
    import shapely  # an extra of the package

    whole = shapely.make_valid(shapely.Polygon(line.T))
    parts = [one for one in shapely.get_parts(whole) if one.geom_type == "Polygon" and one.area > 0.0]
    if not parts:
        raise ValueError("the contour has no area")
    outline = np.asarray(max(parts, key=lambda one: one.area).exterior.coords).T
    return outline if area_px2(outline[:, :-1]) > 0.0 else outline[:, ::-1]


def vectorised(line: Line, tolerance_px: float = VECTOR_PX) -> Line:
    """Keep the points that a polygon needs to stay within the tolerance of the line (Douglas and Peucker 1973)."""
    import shapely  # an extra of the package

    ring = shapely.LinearRing(line.T).simplify(tolerance_px, preserve_topology=True)
    return np.asarray(ring.coords)[:-1].T


def corrected_contour(
    slopes: Slopes, contour: Contour, corrections: Sequence[Correction], settings: Settings
) -> Contour:
    """Apply the corrections one after the other: find the contour anew near each corrected line."""
    for one in corrections:
        contour = found_contour(slopes, corrected_line(contour.points_px, one), settings)
    return contour
