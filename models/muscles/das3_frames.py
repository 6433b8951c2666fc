"""Poses of DAS3's clavicle and scapula frames, which bring DAS3's attachments to the frames of the thesis (Appendix A).

DAS3 and Table 4.2 of the thesis describe the same cadaver in the same thorax frame. DAS3's bone frames are not those of
Appendix A (docs/research/completion.md): the scapula frame has its origin in AA and goes through TS, AI and AA (Wu et
al., J. Biomech. 38:981-992, 2005); the x-axis of the clavicle frame is parallel to SC-AC, without axial rotation. The
landmarks that define these frames bring the attachments into the thorax frame, in the posture in which the cadaver was
measured. As a check: GH, which defines no frame, comes out within 1.4 mm of Table 4.2, and the end of DAS3's clavicle
at AA.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motions.landmarks.frames import clavicle_frame, scapula_frame, transposed

Points = Float[np.ndarray, "3 points"]

_Y_THORAX = np.array([0.0, 1.0, 0.0])


class Pose(NamedTuple):
    """Pose of an inner frame in an outer one: p_outer = origin + R p_inner, mm."""

    R: Float[np.ndarray, "3 3"]
    origin_mm: Float[np.ndarray, "3"]

    def outward(self, points_mm: Points) -> Points:
        """Transform points of the inner frame to the outer one."""
        return self.R @ points_mm + self.origin_mm[:, None]

    def inward(self, points_mm: Points) -> Points:
        """Transform points of the outer frame to the inner one."""
        return transposed(self.R) @ (points_mm - self.origin_mm[:, None])


def scapula_in_thorax(cadaver: dict[str, Any], acromion: str = "ac") -> Pose:
    """Compute the pose of the scapula frame in the measured cadaver: the thesis's through AC, or DAS3's with ``aa``."""
    origin, TS, AI = (np.array(cadaver[f"{name}_mm"]) for name in (acromion, "ts", "ai"))
    return Pose(scapula_frame(origin, TS, AI), origin)


def clavicle_in_thorax(cadaver: dict[str, Any], origin: str = "sc") -> Pose:
    """Compute the pose of the clavicle frame in the measured cadaver: the thesis's from SC, or DAS3's with
    ``joint_sc``."""
    SC, AC, start = (np.array(cadaver[f"{name}_mm"]) for name in ("sc", "ac", origin))
    return Pose(clavicle_frame(SC, AC, _Y_THORAX), start)
