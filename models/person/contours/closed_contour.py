"""A contour in one slice: found from clicks or from that of the slice before, corrected by three points, smoothed.

The line that the band lies around is a closed spline through the clicks, which need not be on the edge, or a contour.
What the path of least cost leaves is filtered as in thesis 2.4: loops are cut off, a polynomial of third order through
13 neighbouring points replaces each point, and Douglas-Peucker keeps the points that are needed to be 0.5 px from it.
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
"""Of the smoothing polynomial (thesis 2.5)."""

_NARROW_PX = 2.0
"""Half width of the second band, around what the first one gave: there the normals are those of the edge."""

_KEPT = 4
"""Every so many points of a contour hold the spline of a correction."""


@dataclass(frozen=True)
class Contour:
    """A closed contour, without its first point repeated."""

    points_px: Line
    weakest: float
    """Mean of e (``models.person.contours.edge_path``) over the 13 neighbouring points where it is least, grey levels a
    pixel: low where the contour left the edge."""


Correction = Float[np.ndarray, "2 3"]
"""From, to and via: two places on a contour, and one where the contour between them should be."""


def drawn_contour(slopes: Slopes, clicks: Float[np.ndarray, "2 clicks"], settings: Settings) -> Contour:
    """Find the contour near a closed spline through at least three clicks. ValueError where there is none."""
    return found_contour(slopes, smooth_line(clicks), settings)


def found_contour(slopes: Slopes, line: Line, settings: Settings) -> Contour:
    """Find the contour in a band around a line, and smooth it. ValueError where what is found has no area."""
    for half_width_px in (settings.half_width_px, min(_NARROW_PX, settings.half_width_px)):
        line = smoothed(detect(slopes, line, half_width_px, settings.inside))
    e = edge(slopes, line, normals(line), settings.inside)
    return Contour(line, float(uniform_filter1d(e, _SMOOTHED_POINTS, mode="wrap").min()))


def corrected_line(contour: Line, correction: Correction) -> Line:
    """Replace the part of a contour between two of its places by a line via a third point.

    The part is the one nearer to that point. ValueError where nothing would be left.
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
    """Cut loops off, space the points evenly and smooth them. ValueError where no area is left."""
    whole = evenly(_without_loops(line))
    points = min(_SMOOTHED_POINTS, whole.shape[1] - (1 - whole.shape[1] % 2))
    return np.asarray(savgol_filter(whole, points, min(_ORDER, points - 1), axis=1, mode="wrap"))


def _without_loops(line: Line) -> Float[np.ndarray, "2 n"]:
    """The outline of the largest area that a line encloses, its last point its first, area positive."""
    import shapely  # an extra of the package

    whole = shapely.make_valid(shapely.Polygon(line.T))
    parts = [one for one in shapely.get_parts(whole) if one.geom_type == "Polygon" and one.area > 0.0]
    if not parts:
        raise ValueError("the contour has no area")
    outline = np.asarray(max(parts, key=lambda one: one.area).exterior.coords).T
    return outline if area_px2(outline[:, :-1]) > 0.0 else outline[:, ::-1]


def vectorised(line: Line, tolerance_px: float = VECTOR_PX) -> Line:
    """Keep the points that a polygon needs to be within the tolerance of the line (Douglas and Peucker 1973)."""
    import shapely  # an extra of the package

    ring = shapely.LinearRing(line.T).simplify(tolerance_px, preserve_topology=True)
    return np.asarray(ring.coords)[:-1].T


def corrected_contour(
    slopes: Slopes, contour: Contour, corrections: Sequence[Correction], settings: Settings
) -> Contour:
    """Find the contour anew near the corrected one, one correction after the other."""
    for one in corrections:
        contour = found_contour(slopes, corrected_line(contour.points_px, one), settings)
    return contour
