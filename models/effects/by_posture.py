"""The second basis of an effect: over the posture of the bones in place of the elevation of the arm.

strength_k = sum_j a_kj (q_j - q_j^0) / 30 deg, where q are the Cardan angles of the bones inside the chain and q^0 is
their published mean with the arm hanging. This basis needs no humerus for simulation, and it carries over to held-out
motions. The angles are the model's, because with measured angles the derivative of the constraints would lack the
dependence of the strength on the posture.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from models.effects.basis import Varying
from models.effects.effect import Adjust, Effect, Rotations
from models.girdle import Girdle
from motions.arrays import Array, xp
from motions.rhythm import REST_DEG
from motions.rotations import DEG, cardan_angle
from motions.table import ANGLES, Motions

UNIT_DEG = 30.0
"""Deviation of a bone angle from the published mean at rest at which the strength equals the amplitude."""

SUFFIX = ":posture"


@dataclass(frozen=True)
class ByPosture(Varying):
    """Basis with one constant amplitude per direction and bone angle; the chain turns amplitudes into strengths."""

    angles: tuple[str, ...] = ()
    word: str = "posture of the bones"
    least_rms: float = 0.05
    """Lower limit of ``rms``: that of an angle that moves by 5 degrees."""

    def strengths(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Compute the strength of amplitudes of 1 in each direction of the effect, at the measured angles. Angles that
        were not measured contribute 0."""
        away = (motions.angles_deg.T - REST_DEG[:, None]) / UNIT_DEG
        followed = np.nan_to_num(away[[ANGLES.index(angle) for angle in self.angles]])
        components = directions // len(followed)
        every = np.einsum("kc,jp->kjcp", np.eye(components), followed)
        return every.reshape(directions, components, -1)


def by_posture(effect: Effect) -> Effect:
    """Return the effect with a basis over the bone angles that it may follow: one direction per pair of direction and
    angle, with the amplitude in the effect's unit per 30 degrees."""
    angles = effect.may_follow
    strengths = _strengths(len(effect.directions), angles)
    return replace(
        effect,
        name=effect.name + SUFFIX,
        what=effect.what.replace("with elevation", "with the posture of the bones"),
        unit=f"{effect.unit} per {UNIT_DEG:g} deg",
        strength_unit=effect.size_unit,
        directions=tuple(f"{one} by {angle}" for one in effect.directions for angle in angles),
        adjust=_adjust_followed(effect.adjust, strengths),
        prior=replace(effect.prior, scale=_shared_out(effect.prior.scale, len(angles)), sign=()),
        basis=ByPosture(angles=angles),
        may_follow=(),
    )


def _shared_out(scale: tuple[float, ...], angles: int) -> tuple[float, ...]:
    """Divide the prior's scale between the angles: an effect of several angles is no larger than an effect of one."""
    return tuple(float(one / np.sqrt(angles)) for one in scale for _ in range(angles))


Strengths = Callable[[Rotations, Float[Array, " channels *batch"]], Float[Array, " directions *batch"]]


def _strengths(directions: int, angles: tuple[str, ...]) -> Strengths:
    chosen = [ANGLES.index(angle) for angle in angles]

    def strengths(
        rotations: Rotations, amplitudes: Float[Array, " channels *batch"]
    ) -> Float[Array, " directions *batch"]:
        away = [angle_from_rest(rotations, angle) for angle in chosen]
        each = [sum(amplitudes[k * len(chosen) + j] * one for j, one in enumerate(away)) for k in range(directions)]
        return xp.stack(each)

    return strengths


def _adjust_followed(adjust: Adjust, strengths: Strengths) -> Adjust:
    def adjusted(girdle: Girdle, rotations: Rotations, amplitudes) -> tuple[Girdle, Rotations]:
        return adjust(girdle, rotations, strengths(rotations, amplitudes))

    return adjusted


def angle_from_rest(rotations: Rotations, angle: int) -> Float[Array, " *batch"]:
    """Compute (q - q^0) / 30 deg for one of the Cardan angles q of the bones, by its number in ``ANGLES``."""
    bone, number = divmod(angle, 3)
    return (cardan_angle(rotations[bone], number) - REST_DEG[angle] / DEG) * (float(DEG) / UNIT_DEG)
