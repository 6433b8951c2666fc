"""Two effects that a plain girdle can reproduce: TS and AI farther from the thorax, scapula frame turned."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from models.effects import EFFECTS, ActiveEffects
from models.girdle import Girdle

Amplitudes = tuple[tuple[float, float], tuple[float, float, float]]
"""Amplitudes in mm for TS and AI, and in degrees about x, y and z."""


def active_in_all(amplitudes: Amplitudes, batch: tuple[int, ...]) -> ActiveEffects:
    """Return both effects as active, with the same strength in the whole batch."""
    strengths = (np.multiply.outer(one, np.ones(batch)) for one in amplitudes)
    return ActiveEffects(tuple(strengths), (EFFECTS["scapulothoracic_gap"], EFFECTS["scapula_landmark_bias"]))


def without_effects(girdle: Girdle, amplitudes: Amplitudes) -> Girdle:
    """Return a girdle without the effects and with the same constraints: R_measured B' p = R_measured (B' p)."""
    (ts, ai), turned = amplitudes
    back = Rotation.from_rotvec(-np.radians(turned)).as_matrix()
    on_scapula = {name: back @ getattr(girdle, name) for name in ("ts_mm", "ai_mm", "scapula_conoid_mm")}
    longer = {"ts_distance_mm": girdle.ts_distance_mm + ts, "ai_distance_mm": girdle.ai_distance_mm + ai}
    return replace(girdle, **longer, **on_scapula)
