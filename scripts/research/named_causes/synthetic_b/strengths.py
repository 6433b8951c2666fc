"""Strength of an effect in one posture, in the directions and units that `girdle effects` lists for it.

Only for effects that have the same form there. The effects that change the size of a bone or the shape of the rib cage
have another form here.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from scripts.research.named_causes.synthetic_b.chain import Array, Girdle
from scripts.research.named_causes.synthetic_b.effects import Effect, bend_frames, bend_geometry


def strengths(person: Girdle, effect: Effect, elevation: float, breath: float, motion: int) -> dict[str, float]:
    """Compute the strength in each direction, mm or deg; empty where the effect has another form."""
    bent = bend_geometry(person, effect, elevation, breath)
    clavicle, scapula, frame = bend_frames(np.eye(3), np.eye(3), np.eye(3), effect, elevation, motion)
    match effect.name:
        case "scapulothoracic_gap":
            return {"TS": bent.ts_distance - person.ts_distance, "AI": bent.ai_distance - person.ai_distance}
        case "conoid_strain":
            return {"length": bent.conoid_length - person.conoid_length}
        case "ac_translation":
            return _along(("along", "up", "back"), bent.ac_shift - person.ac_shift)
        case "sc_translation":
            return _along(("lateral", "up", "back"), bent.sc - person.sc)
        case "thorax_asymmetry":
            return {"M_x": float(bent.centre[0] - person.centre[0])}
        case "thorax_tilt":
            return _about(bent.tilt)
        case "scapula_landmark_bias":
            return _about(scapula)
        case "skin_artefact":  # the true bone has turned further by the strength
            return _about(scapula.T)
        case "thorax_extension":
            return _about(frame)
        case "clavicle_axial_estimate":  # the true bone has turned further by the strength
            return {"axial": -_about(clavicle)["about x"]}
    return {}


def _along(directions: Sequence[str], vector: Array) -> dict[str, float]:
    return dict(zip(directions, vector.tolist(), strict=True))


def _about(R: Array) -> dict[str, float]:
    """Return the components of a rotation vector, deg."""
    return _along(("about x", "about y", "about z"), Rotation.from_matrix(R).as_rotvec(degrees=True))
