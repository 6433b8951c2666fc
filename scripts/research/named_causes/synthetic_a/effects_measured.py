"""The listed effects that change the measurement."""

import numpy as np

from scripts.research.named_causes.synthetic_a.conventions import DEG, Array
from scripts.research.named_causes.synthetic_a.courses import Change, Draw
from scripts.research.named_causes.synthetic_a.rotations import (
    cardan_from_rotation,
    rotation_from_cardan,
    rotation_from_vector,
    vector_from_rotation,
)


def turned(q: Array, bone: int, vector: Array, left: bool = False) -> Array:
    """Turn bone 0 (clavicle) or 1 (scapula) of the angles q (n, 6) by a rotation vector (n, 3), in rad.

    The vector is in the bone's own frame or, with ``left``, in the thorax frame.
    """
    part = slice(3 * bone, 3 * bone + 3)
    R, E = rotation_from_cardan(q[:, part]), rotation_from_vector(vector)
    out = q.copy()
    out[:, part] = cardan_from_rotation(E @ R if left else R @ E)
    return out


def scapula_landmark_bias(w: Draw) -> Change:
    """The scapula's frame is turned in the scapula by a constant rotation about any axis, deg."""
    vector = w.constant()[:, None] * DEG * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(angles=lambda q: turned(q, 1, vector))


def clavicle_axial_estimate(w: Draw) -> Change:
    """The measured axial rotation of the clavicle stays behind the true one by the amplitude at full elevation, deg."""
    lag = w.level("saturating", "sigmoid", "power")[:, None] * DEG * np.eye(6)[2]
    return Change(angles=lambda q: q - lag)


def skin_artefact(w: Draw) -> Change:
    """The measured scapula stays behind on the way it really turns from its lowest posture, mostly above 90 deg, deg.

    Internal rotation takes a small part in it, lateral rotation and tipping the most.
    """
    level = w.level("late", "hinge")
    n = w.postures
    weight = np.array([1.0, 0.3, 1.0]) * np.exp(0.2 * w.rng.standard_normal((n.subjects, 3)))
    w.notes["weight_by_subject"] = weight
    group = n.subject * len(n.motions) + n.motion
    low = np.array([min(np.flatnonzero(group == g), key=lambda i: n.elevation_deg[i]) for g in group])
    top = np.array([max(np.flatnonzero(group == g), key=lambda i: n.elevation_deg[i]) for g in group])

    def lagging(q: Array) -> Array:
        R = rotation_from_cardan(q[:, 3:])
        way = vector_from_rotation(np.swapaxes(R[low], 1, 2) @ R[top]) * weight[n.subject]
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        return turned(q, 1, -DEG * level[:, None] * way)

    return Change(angles=lagging, moves_landmarks="scapula")


def thorax_extension(w: Draw) -> Change:
    """The trunk leans back by the amplitude at full elevation, mostly about x, and takes both bones along, deg."""
    vector = w.level("cosine", "late", "power")[:, None] * DEG * w.direction((1.0, 0.0, 0.0), 0.2, 0.1)
    return Change(
        angles=lambda q: turned(turned(q, 0, vector, left=True), 1, vector, left=True),
        moves_landmarks="all",
        turn=vector,
    )
