"""Directions and moment arms of the forces that close the chain: TS and AI on the thorax, the conoid between bones.

The ellipsoid presses on TS and AI along its outward normals there (thesis 6.1, 6.4); the conoid pulls the scapula
toward its attachment on the clavicle. Vectors are in the thorax frame; postures are those of the model.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from models.ellipsoid import distance_and_normal
from models.girdle import Girdle, landmarks

FORCES = ("TS", "AI", "conoid")


class ContactForces(NamedTuple):
    """Unit forces of ``FORCES`` on the scapula, at points X, and their moment arms."""

    direction: Float[np.ndarray, " 3 3 *batch"]
    """Directions n: components on the first axis, ``FORCES`` on the second."""
    about_sc_mm: Float[np.ndarray, " 3 3 *batch"]
    """(X - SC) x n, on clavicle and scapula together; 0 for the conoid, which pulls at both."""
    about_ac_mm: Float[np.ndarray, " 3 3 *batch"]
    """(X - AC) x n, on the scapula."""


def contact_forces(girdle: Girdle, angles: Float[np.ndarray, " 6 *batch"]) -> ContactForces:
    """Compute directions and moment arms in postures (rad); ``girdle`` has the same batch (numpy)."""
    at = landmarks(girdle, angles)
    normals = [distance_and_normal(point, girdle.centre_mm, girdle.semi_axes_mm)[1] for point in (at.TS, at.AI)]
    conoid = at.clavicle_conoid - at.scapula_conoid
    direction = np.stack([*normals, conoid / np.linalg.norm(conoid, axis=0)], axis=1)
    X = np.stack([at.TS, at.AI, at.scapula_conoid], axis=1)
    about_sc = np.cross(X - girdle.sc_mm[:, None], direction, axis=0)
    about_sc[:, FORCES.index("conoid")] = 0.0
    return ContactForces(direction, about_sc, np.cross(X - at.AC[:, None], direction, axis=0))


def angle_deg(one: Float[np.ndarray, " 3 *batch"], other: Float[np.ndarray, " 3 *batch"]) -> np.ndarray:
    """Compute the angle between unit vectors in degrees, accurately even near 0."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other, axis=0), axis=0), (one * other).sum(axis=0)))
