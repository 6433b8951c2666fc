"""The glenoid: directions in which it can bear the force of the humeral head (thesis 3.3.2, Figure 1.3).

Seen from GH, the rim is an ellipse about the glenoid's middle. With axes n from GH into the glenoid, s up along the
glenoid and t forward, all in the scapula, a force F of the humerus is within the rim where

    (F_s / tan a_s)^2 + (F_t / tan a_t)^2 <= F_n^2,   F_n >= 0.

Here a polygon of ``CORNERS`` corners on that ellipse replaces the rim, with r_k . F >= 0 for each side k, so that the
constraints of a balance stay linear. The polygon is nowhere outside the ellipse, and at most 0.5 % inside.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from models.muscles.das3_frames import scapula_in_thorax
from motions.landmarks.frames import cross, transposed, unit
from motions.rotations import DEG, rotate

CORNERS = 32

_WIDER = np.cos(np.pi / CORNERS)
"""Distance of a side of the polygon from the middle, over the distance of a corner."""


def glenoid_axes(document: dict[str, Any]) -> Float[np.ndarray, "3 3"]:
    """Compute the cadaver's n, s and t, as columns, in the scapula frame of the thesis.

    n points from GH to the glenoid's middle; s has the direction of the part of the y-axis of DAS3's scapula that is
    normal to n; t = n x s points forward.
    """
    das3, cadaver = document["das3"], document["cadaver"]
    n = unit(np.subtract(das3["glenoid_mm"], das3["gh_mm"]))
    up = scapula_in_thorax(das3, "aa").R[:, 1]
    s = unit(up - (up @ n) * n)
    in_thorax = np.stack([n, s, cross(n, s)], axis=1)
    return transposed(scapula_in_thorax(cadaver).R) @ in_thorax


def half_angles(document: dict[str, Any]) -> Float[np.ndarray, "2"]:
    """Return the half-angles a_s and a_t of the rim, rad."""
    return np.array([document["glenoid"][f"half_angle_{way}_deg"] for way in ("up", "forward")]) / DEG


def rim_sides(
    axes: Float[np.ndarray, "3 3"], angles: Float[np.ndarray, "2"], R_thorax_scapula: Float[np.ndarray, " 3 3 postures"]
) -> Float[np.ndarray, " sides 3 postures"]:
    """Compute r_k in the thorax frame; a force F of the humerus is within the rim where r_k . F >= 0 for all k."""
    turn = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    s, t = np.cos(turn) / np.tan(angles[0]), np.sin(turn) / np.tan(angles[1])
    sides = axes @ np.stack([np.full(CORNERS, _WIDER), -s, -t])
    return np.moveaxis(rotate(R_thorax_scapula[:, :, None], sides[..., None]), 0, 1)


def off_centre(
    axes: Float[np.ndarray, "3 3"],
    angles: Float[np.ndarray, "2"],
    R_thorax_scapula: Float[np.ndarray, " 3 3 postures"],
    force: Float[np.ndarray, " 3 postures"],
) -> Float[np.ndarray, " postures"]:
    """Compute where a force of the humerus points: 0 at the middle of the glenoid, 1 on the ellipse of the rim."""
    n, s, t = axes.T @ rotate(transposed(R_thorax_scapula), force)
    with np.errstate(divide="ignore", invalid="ignore"):  # a force of 0 gives NaN
        return np.hypot(s / np.tan(angles[0]), t / np.tan(angles[1])) / n
