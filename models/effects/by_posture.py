"""The second course of an effect: over the posture of the bones in place of the elevation of the arm.

strength_k = sum_j a_kj (q_j - q_j^0) / 30 deg of the bones' own Cardan angles q inside the chain, q^0 the published
mean with the arm hanging. It can be simulated without a humerus, and carries over to motions that nobody saw. The
angles are those of the model's bones: measured ones in their place would leave out how the constraint turns with the
posture.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from models.effects.course import Varying
from models.effects.effect import Adjust, Effect, Rotations
from models.girdle import Girdle
from motions.arrays import Array, xp
from motions.rhythm import REST_DEG
from motions.rotations import DEG, cardan_from_rotation
from motions.table import ANGLES, Motions

UNIT_DEG = 30.0
"""A bone angle this far from the published mean at rest has the strength of the amplitude."""

SUFFIX = ":posture"


@dataclass(frozen=True)
class ByPosture(Varying):
    """Constant amplitudes a bone angle; the chain turns them into strengths."""

    angles: tuple[str, ...] = ()
    word: str = "posture of the bones"
    least_rms: float = 0.05
    """Of an angle that moves by 5 degrees."""

    def strengths(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes components postures"]:
        """Give the strength of amplitudes of 1 in each direction of the effect, at the measured angles; 0 by one that
        was not measured."""
        away = (motions.angles_deg.T - REST_DEG[:, None]) / UNIT_DEG
        followed = np.nan_to_num(away[[ANGLES.index(angle) for angle in self.angles]])
        components = directions // len(followed)
        every = np.einsum("kc,jp->kjcp", np.eye(components), followed)
        return every.reshape(directions, components, -1)


def by_posture(effect: Effect) -> Effect:
    """Give the effect its course over the bone angles that it may follow: one direction for each pair of a direction
    and an angle, in the unit a 30 degrees."""
    angles = effect.may_follow
    strengths = _strengths(len(effect.directions), angles)
    return replace(
        effect,
        name=effect.name + SUFFIX,
        what=effect.what.replace("with elevation", "with the posture of the bones"),
        unit=f"{effect.unit} a {UNIT_DEG:g} deg",
        strength_unit=effect.size_unit,
        directions=tuple(f"{one} by {angle}" for one in effect.directions for angle in angles),
        adjust=_adjust_followed(effect.adjust, strengths),
        prior=replace(effect.prior, scale=_shared_out(effect.prior.scale, len(angles)), sign=()),
        course=ByPosture(angles=angles),
        may_follow=(),
    )


def _shared_out(scale: tuple[float, ...], angles: int) -> tuple[float, ...]:
    """Give each angle its part of the size: what follows several is not larger than what follows one."""
    return tuple(float(one / np.sqrt(angles)) for one in scale for _ in range(angles))


Strengths = Callable[[Rotations, Float[Array, " channels *batch"]], Float[Array, " directions *batch"]]


def _strengths(directions: int, angles: tuple[str, ...]) -> Strengths:
    chosen = [ANGLES.index(angle) for angle in angles]

    def strengths(
        rotations: Rotations, amplitudes: Float[Array, " channels *batch"]
    ) -> Float[Array, " directions *batch"]:
        away = bone_angles_from_rest(rotations)
        each = [sum(amplitudes[k * len(chosen) + j] * away[i] for j, i in enumerate(chosen)) for k in range(directions)]
        return xp.stack(each)

    return strengths


def _adjust_followed(adjust: Adjust, strengths: Strengths) -> Adjust:
    def adjusted(girdle: Girdle, rotations: Rotations, amplitudes) -> tuple[Girdle, Rotations]:
        return adjust(girdle, rotations, strengths(rotations, amplitudes))

    return adjusted


def bone_angles_from_rest(rotations: Rotations) -> Float[Array, " 6 *batch"]:
    """Compute (q - q^0) / 30 deg of the bones' Cardan angles."""
    angles = xp.concatenate([cardan_from_rotation(R) for R in rotations])
    rest = (REST_DEG / DEG).reshape(-1, *(1,) * (angles.ndim - 1))
    return (angles - rest) * (float(DEG) / UNIT_DEG)
