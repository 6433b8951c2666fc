"""Where the landmarks of the girdle are, in the thorax frame in which they would be measured, mm.

    SC,    AC = SC + R_C ac,    TS = AC + R_S ts,    AI = AC + R_S ai,    AA = AC + R_S aa

R_C and R_S are the true rotations of the bones: a palpated or pinned point lies on the bone, whatever frame its angles
have, so effects that only turn a measured frame do not move it. An effect that turns the thorax frame itself turns what
is measured in it. aa is a constant of the person, as is how far each of the others lies from where the parameter set
has it (:func:`positions_mm`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import jax
import numpy as np
from jaxtyping import Float

from models.effects.effect import Effect, Rotations
from models.effects.extended_girdle import AnyGirdle
from models.girdle import Girdle, bone_rotations
from motions.arrays import Array, xp
from motions.rotations import compose, rotate

ON_SCAPULA = ("TS", "AI", "AA")
"""Landmarks that the scapula carries, beside AC, its origin."""

POSITIONS = ("SC", "AC", *ON_SCAPULA)
"""Landmarks whose positions a girdle has, AA with a place of the person's own."""

OwnPlaces = Mapping[str, Float[Array, " 3 *batch"]]
"""By landmark, how far a person's lies from where the girdle has it: SC in the thorax, AC in the clavicle, those of the
scapula in the scapula; of AA, which no parameter set has, its place."""

AT_THE_SET: OwnPlaces = MappingProxyType({})


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class BonePoses:
    """Where the bones are, in the thorax frame as it was measured."""

    SC_mm: Float[Array, " 3 *batch"]
    R_thorax_clavicle: Float[Array, " 3 3 *batch"]
    R_thorax_scapula: Float[Array, " 3 3 *batch"]
    AC_mm: Float[Array, " 3 *batch"]
    """In the clavicle."""
    TS_mm: Float[Array, " 3 *batch"]
    """In the scapula."""
    AI_mm: Float[Array, " 3 *batch"]
    """In the scapula."""


def bone_poses(girdle: AnyGirdle, angles: Float[Array, " 6 *batch"]) -> BonePoses:
    """Find SC and the true rotations of the bones at angles as they would be measured, rad, with what is active."""
    if isinstance(girdle, Girdle):
        return _poses(girdle, bone_rotations(angles))
    steps = list(girdle.steps(angles))
    poses = _poses(*steps[-1])
    for effect, (before, after) in reversed(list(zip(girdle.active_effects.effects, pairwise(steps), strict=True))):
        if effect.turns_thorax_about:
            poses = _turned_back(poses, effect, before, after)
    return poses


def _poses(girdle: Girdle, rotations: Rotations) -> BonePoses:
    R_thorax_clavicle, R_thorax_scapula = rotations
    SC = girdle.sc_mm + xp.zeros_like(R_thorax_clavicle[0])
    return BonePoses(SC, R_thorax_clavicle, R_thorax_scapula, girdle.ac_mm, girdle.ts_mm, girdle.ai_mm)


def _turned_back(poses: BonePoses, effect: Effect, before, after) -> BonePoses:
    """Turn everything from the true thorax frame to the measured one: R_true = X R_measured of both bones."""
    (girdle, (_, R_measured)), (_, (_, R_true)) = before, after
    back = compose(R_measured, xp.swapaxes(R_true, 0, 1))
    centre = girdle.centre_mm if effect.turns_thorax_about == "ellipsoid" else xp.zeros_like(girdle.centre_mm)
    return BonePoses(
        centre + rotate(back, poses.SC_mm - centre),
        compose(back, poses.R_thorax_clavicle),
        compose(back, poses.R_thorax_scapula),
        *(poses.AC_mm, poses.TS_mm, poses.AI_mm),
    )


def positions_mm(poses: BonePoses, own: OwnPlaces = AT_THE_SET) -> dict[str, Float[np.ndarray, " 3 *batch"]]:
    """Compute the position of every landmark: of AA only with a place of its own."""
    SC = poses.SC_mm + own.get("SC", 0.0)
    AC = SC + rotate(poses.R_thorax_clavicle, poses.AC_mm + own.get("AC", 0.0))
    in_scapula = {"TS": poses.TS_mm + own.get("TS", 0.0), "AI": poses.AI_mm + own.get("AI", 0.0)}
    if "AA" in own:
        in_scapula["AA"] = own["AA"]
    carried = {name: AC + rotate(poses.R_thorax_scapula, place) for name, place in in_scapula.items()}
    return {name: np.asarray(place) for name, place in {"SC": SC, "AC": AC, **carried}.items()}
