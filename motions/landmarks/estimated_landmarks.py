"""Estimated landmarks: SC by an offset from IJ, GH by an offset from AC, AC from AA (``acromion``), always stated."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.landmarks.acromion import POSITION_SD_MM, AcromionRotation, ac_position_from_aa
from motions.landmarks.frames import scapula_frame
from motions.motion_csv.cells import Side
from motions.motion_csv.posture_rows import MIRROR_POSITION

Positions = dict[str, Float[np.ndarray, "3 frames"]]


@dataclass(frozen=True)
class SternoclavicularOffset:
    """SC of a right shoulder in the thorax frame, with origin IJ."""

    sc_mm: tuple[float, float, float]
    uncertainty_mm: float
    """SD of one person's SC about this place, along each axis."""
    source: str


KAPTEIN = SternoclavicularOffset(
    (20.7, -7.6, 12.6),
    10.0,
    "mean of MRI and dissection of one cadaver, thesis Table 4.2; uncertainty assumed, as shoulders of other sizes",
)

OFFSETS = {"kaptein1999": KAPTEIN}
"""Offsets of SC by the name that --sc-from-ij takes."""


def with_estimated_landmarks(
    thorax_mm: Positions, aa_to_ac: AcromionRotation | None, sc_from_ij: SternoclavicularOffset | None
) -> tuple[Positions, dict[str, str]]:
    """Add estimates of SC and AC, if not measured and if an offset or rotation is given; return texts that state them.

    ``thorax_mm``: thorax frame, right shoulder. AC is added only beside SC, for the clavicle; the angles of the scapula
    use the rotation itself.
    """
    found, said = dict(thorax_mm), {}
    if "SC" not in found and sc_from_ij is not None:
        count = next(iter(found.values())).shape[1]
        found["SC"] = np.repeat(np.array(sc_from_ij.sc_mm)[:, None], count, axis=1)
        said["SC"] = f"from IJ by a stated offset +- {sc_from_ij.uncertainty_mm:g} mm"
    if "AC" not in found and "AA" in found and aa_to_ac is not None and "SC" in found:
        found["AC"] = ac_position_from_aa(found["AA"], found["TS"], found["AI"], aa_to_ac)
        said["AC"] = f"from AA by a mean rotation +- {POSITION_SD_MM:g} mm"
    return found, said


@dataclass(frozen=True)
class GlenohumeralOffset:
    """GH of a right shoulder in the scapula frame through AC, TS and AI, with origin AC."""

    gh_in_ac_ts: tuple[float, float, float]
    """Place of GH in units of the length AC-TS, so that the offset grows with the scapula."""
    uncertainty_mm: float
    """SD of one person's GH about this place, along each axis."""
    source: str


KAPTEIN_GH = GlenohumeralOffset(
    # GH and length AC-TS: (-4.8, -44.4, -7.8) and 129.1 mm by dissection, (9.4, -53.4, 4.2) and 126.0 mm by MRI
    (0.0186, -0.3838, -0.0136),
    10.0,
    "mean of MRI and dissection of one cadaver, thesis Table 4.2, which are 4-7 mm from it; uncertainty assumed",
)

GH_OFFSETS = {"kaptein1999": KAPTEIN_GH}
"""Offsets of GH by the name that --gh-from-ac takes."""


def place_gh(lab_mm: Positions, offset: GlenohumeralOffset, side: Side) -> Positions:
    """Add an estimate of GH if it was not measured: AC + |AC - TS| R_scapula offset, in any right-handed frame.

    A left scapula is mirrored for the computation. Without AC, TS and AI nothing is added. An error of 10 mm in GH
    gives an error of 2 degrees in the elevation of an arm of 290 mm.
    """
    if "GH" in lab_mm or not {"AC", "TS", "AI"} <= lab_mm.keys():
        return lab_mm
    mirror = MIRROR_POSITION[:, None] if side == "left" else np.ones((3, 1))
    AC, TS, AI = (mirror * lab_mm[name] for name in ("AC", "TS", "AI"))
    along = np.einsum("ijn,j->in", scapula_frame(AC, TS, AI), offset.gh_in_ac_ts)
    return lab_mm | {"GH": mirror * (AC + np.linalg.norm(AC - TS, axis=0) * along)}
