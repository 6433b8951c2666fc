"""Directions and arms of the forces that close the chain: TS and AI on the thorax, the conoid between the bones.

The ellipsoid presses TS and AI along its outward normals there (thesis 6.1, 6.4); the conoid pulls the scapula toward
its attachment on the clavicle. Thorax frame; the postures are those of the model.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from models.ellipsoid import distance_and_normal
from models.girdle import Girdle, landmarks

FORCES = ("TS", "AI", "conoid")


class ContactForces(NamedTuple):
    """Unit forces of FORCES on the scapula and their arms."""

    direction: Float[np.ndarray, " 3 3 *batch"]
    """First axis the components, second FORCES."""
    about_sc_mm: Float[np.ndarray, " 3 3 *batch"]
    """(X - SC) x n, of clavicle and scapula together: 0 of the conoid, which pulls at both."""
    about_ac_mm: Float[np.ndarray, " 3 3 *batch"]
    """(X - AC) x n, of the scapula."""


def contact_forces(girdle: Girdle, angles: Float[np.ndarray, " 6 *batch"]) -> ContactForces:
    """Compute directions and arms in postures (rad); ``girdle`` has the same batch (numpy)."""
    at = landmarks(girdle, angles)
    normals = [distance_and_normal(point, girdle.centre_mm, girdle.semi_axes_mm)[1] for point in (at.TS, at.AI)]
    conoid = at.clavicle_conoid - at.scapula_conoid
    direction = np.stack([*normals, conoid / np.linalg.norm(conoid, axis=0)], axis=1)
    X = np.stack([at.TS, at.AI, at.scapula_conoid], axis=1)
    about_sc = np.cross(X - girdle.sc_mm[:, None], direction, axis=0)
    about_sc[:, FORCES.index("conoid")] = 0.0
    return ContactForces(direction, about_sc, np.cross(X - at.AC[:, None], direction, axis=0))


def angle_deg(one: Float[np.ndarray, " 3 *batch"], other: Float[np.ndarray, " 3 *batch"]) -> np.ndarray:
    """Compute the angle between unit vectors, degrees, accurate near 0."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other, axis=0), axis=0), (one * other).sum(axis=0)))
