"""Where DAS3 has its clavicle and scapula: its attachments brought to the frames of the thesis (Appendix A).

DAS3 and Table 4.2 of the thesis describe one cadaver in one thorax frame. DAS3 prints GH, but neither AC, TS nor AI in
its scapula frame. What is known of that frame: TS lies on its x-axis, AI in its plane z = 0 (both definitions of the
scapula, through AC and through AA, have that), and GH is printed. These six equations lay the triangle TS-AI-GH of
Table 4.2 into the frame, and the origin follows. It is not AC: AC comes out 42 mm before, above it and in front,
the axes are within 2 degrees of the mean rotation from AA to AC of Kolz et al. (Gait Posture 81, 2020), and the
origin is 209.5 mm from DAS3's SC, where DAS3's own clavicle says 209.6. So DAS3's scapula frame is the one through AA
(Wu et al., J. Biomech. 38:981-992, 2005), and the joint that DAS3 calls ac1 lies in AA.

The clavicle frame has its origin in DAS3's SC and AA where ac1 is printed; AC is brought as near to its x-axis as that
allows (5 mm).
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motions.landmarks.frames import clavicle_frame, frame, scapula_frame, transposed, unit

Vector = Float[np.ndarray, "3"]
Points = Float[np.ndarray, "3 points"]


class Pose(NamedTuple):
    """A frame in another one: p_outer = origin + R p_inner, mm."""

    R: Float[np.ndarray, "3 3"]
    origin_mm: Vector

    def outward(self, points_mm: Points) -> Points:
        """Bring points of the inner frame to the outer one."""
        return self.R @ points_mm + self.origin_mm[:, None]

    def inward(self, points_mm: Points) -> Points:
        """Bring points of the outer frame to the inner one."""
        return transposed(self.R) @ (points_mm - self.origin_mm[:, None])


def das3_scapula_in_thorax(cadaver: dict[str, Any], das3: dict[str, Any]) -> Pose:
    """Find the pose of DAS3's scapula frame when the cadaver was measured.

    With t = |origin - TS| and g the printed GH:  (g_x + t)^2 + g_y^2 + g_z^2 = |GH - TS|^2.  AI = TS + L (cos b, sin b,
    0) with the angle between TS-GH and TS-AI as measured, AI below TS.
    """
    TS, AI, GH = (np.array(cadaver[f"{name}_mm"]) for name in ("ts", "ai", "gh"))
    g = np.array(das3["scapula_gh_mm"])
    along = np.sqrt(np.sum((GH - TS) ** 2) - g[1] ** 2 - g[2] ** 2)
    to_gh, to_ai = GH - TS, AI - TS
    cosine = to_gh @ to_ai / np.linalg.norm(to_ai) / np.hypot(along, g[1])
    b = np.arctan2(g[1], along) - np.arccos(cosine)
    R = _axes(to_ai, to_gh) @ _axes(np.array([np.cos(b), np.sin(b), 0.0]), np.array([along, g[1], g[2]])).T
    return Pose(R, TS + R @ np.array([along - g[0], 0.0, 0.0]))


def das3_clavicle_in_thorax(cadaver: dict[str, Any], das3: dict[str, Any]) -> Pose:
    """Find the pose of DAS3's clavicle frame when the cadaver was measured: SC and AA as printed, AC next to x."""
    SC, AA = np.array(das3["sc_mm"]), das3_scapula_in_thorax(cadaver, das3).origin_mm
    printed = _axes(np.array(das3["clavicle_aa_mm"]), np.array([1.0, 0.0, 0.0]))
    return Pose(_axes(AA - SC, np.array(cadaver["ac_mm"]) - SC) @ printed.T, SC)


def scapula_in_thorax(cadaver: dict[str, Any]) -> Pose:
    """Compute the pose of the thesis's scapula frame, origin AC, when the cadaver was measured."""
    AC, TS, AI = (np.array(cadaver[f"{name}_mm"]) for name in ("ac", "ts", "ai"))
    return Pose(scapula_frame(AC, TS, AI), AC)


def clavicle_in_thorax(cadaver: dict[str, Any]) -> Pose:
    """Compute the pose of the thesis's clavicle frame, origin SC, when the cadaver was measured."""
    SC, AC = np.array(cadaver["sc_mm"]), np.array(cadaver["ac_mm"])
    return Pose(clavicle_frame(SC, AC, np.array([0.0, 1.0, 0.0])), SC)


def _axes(along: Vector, towards: Vector) -> Float[np.ndarray, "3 3"]:
    x = unit(along)
    return frame(x, unit(towards - (towards @ x) * x))
