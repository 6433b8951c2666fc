"""Check for AA, the corner of the acromion, under the name of AC: GH then lies in front of the plane of the scapula."""

import numpy as np
from jaxtyping import Float

from motions.checks.distances import Positions

FARTHEST_BEFORE_MM = 26.0
"""Maximum distance of GH in front of the plane of AC, TS and AI, in mm. In the cadaver of the thesis (Table 4.2) GH is
8 mm before and 4 mm behind this plane, and 44 mm before the plane through AA (taken from the Delft Shoulder and Elbow
Model); the limit is halfway between 8 and 44."""

REMEDY = "If it is, call it AA and take --aa-to-ac kolz2020: the scapula's frame is turned by some 18 degrees else"


def looks_like_corner(positions: Positions) -> str | None:
    """Return a message if AC is likely AA; None if it is not, if AA was measured too, or if GH is not known.

    ``positions`` are in any frame with IJ and C7; without these two, in the thorax frame.
    """
    before_mm = _before_plane_mm(positions)
    if "AA" in positions or before_mm is None or not before_mm > FARTHEST_BEFORE_MM:
        return None
    before = f"GH is {before_mm:.0f} mm before the plane of AC, TS and AI, in people up to {FARTHEST_BEFORE_MM:.0f}"
    return f"{before}: AC looks like AA, the corner of the acromion"


def _before_plane_mm(positions: Positions) -> float | None:
    """Compute the median distance of GH before the plane of AC, TS and AI; None if never measured together."""
    if not {"AC", "TS", "AI", "GH"} <= positions.keys():
        return None
    AC, TS, AI, GH = (positions[name] for name in ("AC", "TS", "AI", "GH"))
    normal = np.cross(AC - TS, AI - TS, axis=0)
    normal = normal / np.where(length := np.linalg.norm(normal, axis=0), length, np.nan)
    before = np.sum(normal * (GH - AC), axis=0) * np.sign(np.sum(normal * _forward(positions), axis=0))
    known = before[np.isfinite(before)]
    return float(np.median(known)) if known.size else None


def _forward(positions: Positions) -> Float[np.ndarray, "3 #frames"]:
    if {"IJ", "C7"} <= positions.keys():
        return positions["IJ"] - positions["C7"]
    return np.array([[0.0], [0.0], [-1.0]])
