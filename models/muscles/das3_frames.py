"""Where DAS3 has its clavicle and scapula: its attachments brought to the frames of the thesis (Appendix A).

DAS3 and Table 4.2 of the thesis describe one cadaver in one thorax frame. DAS3's frames are not those of Appendix A
(docs/research/completion.md): its scapula frame has its origin in AA and goes through TS, AI and AA (Wu et al., J.
Biomech. 38:981-992, 2005); the x-axis of its clavicle frame is parallel to SC-AC, without axial rotation. The landmarks
that these frames are made of lie the attachments into the thorax frame, in the posture the cadaver was measured in.
There GH, which no frame is made from, comes out within 3 mm of Table 4.2, and where DAS3's clavicle ends, AA.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motions.landmarks.frames import clavicle_frame, scapula_frame, transposed

Points = Float[np.ndarray, "3 points"]

_Y_THORAX = np.array([0.0, 1.0, 0.0])


class Pose(NamedTuple):
    """A frame in another one: p_outer = origin + R p_inner, mm."""

    R: Float[np.ndarray, "3 3"]
    origin_mm: Float[np.ndarray, "3"]

    def outward(self, points_mm: Points) -> Points:
        """Bring points of the inner frame to the outer one."""
        return self.R @ points_mm + self.origin_mm[:, None]

    def inward(self, points_mm: Points) -> Points:
        """Bring points of the outer frame to the inner one."""
        return transposed(self.R) @ (points_mm - self.origin_mm[:, None])


def scapula_in_thorax(cadaver: dict[str, Any], acromion: str = "ac") -> Pose:
    """Compute the pose of the scapula frame when the cadaver was measured: the thesis's through AC, DAS3's ``aa``."""
    origin, TS, AI = (np.array(cadaver[f"{name}_mm"]) for name in (acromion, "ts", "ai"))
    return Pose(scapula_frame(origin, TS, AI), origin)


def clavicle_in_thorax(cadaver: dict[str, Any], origin: str = "sc") -> Pose:
    """Compute the pose of the clavicle frame when the cadaver was measured: the thesis's from SC, DAS3's from its
    ``joint_sc``."""
    SC, AC, start = (np.array(cadaver[f"{name}_mm"]) for name in ("sc", "ac", origin))
    return Pose(clavicle_frame(SC, AC, _Y_THORAX), start)
