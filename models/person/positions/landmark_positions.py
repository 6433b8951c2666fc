"""Positions of the landmarks of the girdle, in the thorax frame in which they would be measured, mm.

    SC,    AC = SC + R_C ac,    TS = AC + R_S ts,    AI = AC + R_S ai,    AA = AC + R_S aa

R_C and R_S are the true rotations of the bones. A palpated or pinned point lies on the bone, so an effect that only
turns the measured frame of a bone does not move the point. An effect that turns the thorax frame turns all positions
measured in this frame. The place aa is a constant of the person, as are the offsets of the other landmarks from their
places in the parameter set (:func:`positions_mm`).
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
"""Landmarks on the scapula, apart from its origin AC."""

POSITIONS = ("SC", "AC", *ON_SCAPULA)
"""Landmarks with a position in a girdle; AA only with the person's own place of it."""

OwnPlaces = Mapping[str, Float[Array, " 3 *batch"]]
"""Offset of a person's landmark from its place in the girdle, by landmark: SC in the thorax frame, AC in the clavicle
frame, TS and AI in the scapula frame. For AA, which no parameter set has, the place itself, in the scapula frame."""

AT_THE_SET: OwnPlaces = MappingProxyType({})


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class BonePoses:
    """Poses of the bones in the measured thorax frame, and places of the landmarks in the bones."""

    SC_mm: Float[Array, " 3 *batch"]
    R_thorax_clavicle: Float[Array, " 3 3 *batch"]
    R_thorax_scapula: Float[Array, " 3 3 *batch"]
    AC_mm: Float[Array, " 3 *batch"]
    """Clavicle frame."""
    TS_mm: Float[Array, " 3 *batch"]
    """Scapula frame."""
    AI_mm: Float[Array, " 3 *batch"]
    """Scapula frame."""


def bone_poses(girdle: AnyGirdle, angles: Float[Array, " 6 *batch"]) -> BonePoses:
    """Compute SC and the true rotations of the bones from measured angles (rad), with the active effects."""
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
    """Turn the poses from the true to the measured thorax frame, by X' of R_true = X R_measured (both bones)."""
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
    """Compute the position of every landmark; AA only where ``own`` has its place."""
    SC = poses.SC_mm + own.get("SC", 0.0)
    AC = SC + rotate(poses.R_thorax_clavicle, poses.AC_mm + own.get("AC", 0.0))
    in_scapula = {"TS": poses.TS_mm + own.get("TS", 0.0), "AI": poses.AI_mm + own.get("AI", 0.0)}
    if "AA" in own:
        in_scapula["AA"] = own["AA"]
    carried = {name: AC + rotate(poses.R_thorax_scapula, place) for name, place in in_scapula.items()}
    return {name: np.asarray(place) for name, place in {"SC": SC, "AC": AC, **carried}.items()}
