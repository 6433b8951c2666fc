"""A marker on the skin lags behind the scapula by a share of how far the scapula has turned: a third course of the lag.

Whatever the elevation: from the subject's lowest posture on, about each axis of the scapula with a share of its own.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from models.effects.course import Varying
from models.effects.measurement import skin_artefact, skin_artefact_any_way
from motions.rotations import DEG, compose, rotation_from_cardan, vector_from_rotation
from motions.table import BONES, Motions


def turned_deg(motions: Motions) -> Float[np.ndarray, "3 postures"]:
    """Compute log(R_0' R) in degrees, scapula frame, R_0 the subject's lowest posture; 0 where it was not measured."""
    scapula = motions.angles_deg[:, BONES["scapula"]].T
    lowest, _ = skin_artefact.lowest_and_high(motions)
    R = rotation_from_cardan(np.nan_to_num(scapula) / DEG)
    R_lowest = R[..., lowest[motions.subject_number]]
    turned = vector_from_rotation(compose(np.swapaxes(R_lowest, 0, 1), R)) * DEG
    return np.where(np.isfinite(scapula).all(axis=0), turned, 0.0)


@dataclass(frozen=True)
class OwnRotation(Varying):
    """An amplitude an axis of the scapula, the share of its measured rotation about it."""

    word: str = "rotation of the scapula"
    least_rms: float = 1.5
    """Of a rotation in degrees that moves by 5 degrees."""

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Give the rotation about each axis in the channel of that axis."""
        return np.einsum("kc,cp->kcp", np.eye(directions), turned_deg(motions))


EFFECT = replace(
    skin_artefact_any_way.EFFECT,
    name=f"{skin_artefact.EFFECT.name}:rotation",
    what="a skin marker lags the scapula by a share of its rotation from the lowest posture",
    unit="of the rotation",
    strength_unit="deg",
    course=OwnRotation(),
)
