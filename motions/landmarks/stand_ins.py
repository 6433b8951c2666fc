"""SC that nobody marked, by a stated offset from IJ; GH by one from AC; AC from AA (``acromion``). Never silent."""

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
    """SC of a right shoulder in the thorax frame, whose origin is IJ."""

    sc_mm: tuple[float, float, float]
    uncertainty_mm: float
    """How far one person's SC may be from it along each axis (SD)."""
    source: str


KAPTEIN = SternoclavicularOffset(
    (20.7, -7.6, 12.6),
    10.0,
    "mean of MRI and dissection of one cadaver, thesis Table 4.2; uncertainty assumed, as shoulders of other sizes",
)

OFFSETS = {"kaptein1999": KAPTEIN}
"""By the name that --sc-from-ij takes."""


def with_stand_ins(
    thorax_mm: Positions, aa_to_ac: AcromionRotation | None, sc_from_ij: SternoclavicularOffset | None
) -> tuple[Positions, dict[str, str]]:
    """Add AC and SC where they were not measured and what replaces them is stated; and say of each where it is from.

    thorax_mm: thorax frame, right shoulder. AC is needed with SC alone: the scapula has a rotation of its own.
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
    """GH of a right shoulder in the scapula frame through AC, TS and AI, whose origin is AC."""

    gh_in_ac_ts: tuple[float, float, float]
    """In lengths of AC-TS: a larger scapula has a larger offset."""
    uncertainty_mm: float
    """How far one person's GH may be from it along each axis (SD)."""
    source: str


KAPTEIN_GH = GlenohumeralOffset(
    # (-4.8, -44.4, -7.8) of 129.1 mm by dissection, (9.4, -53.4, 4.2) of 126.0 mm by MRI
    (0.0186, -0.3838, -0.0136),
    10.0,
    "mean of MRI and dissection of one cadaver, thesis Table 4.2, which are 4-7 mm from it; uncertainty assumed",
)

GH_OFFSETS = {"kaptein1999": KAPTEIN_GH}
"""By the name that --gh-from-ac takes."""


def place_gh(lab_mm: Positions, offset: GlenohumeralOffset, side: Side) -> Positions:
    """Add GH where it was not measured: AC + |AC - TS| R_scapula offset, in any right-handed frame.

    A left scapula is computed in a mirror. Without AC, TS and AI nothing is added. With GH 10 mm off, the elevation of
    an arm of 290 mm is 2 degrees off.
    """
    if "GH" in lab_mm or not {"AC", "TS", "AI"} <= lab_mm.keys():
        return lab_mm
    mirror = MIRROR_POSITION[:, None] if side == "left" else np.ones((3, 1))
    AC, TS, AI = (mirror * lab_mm[name] for name in ("AC", "TS", "AI"))
    along = np.einsum("ijn,j->in", scapula_frame(AC, TS, AI), offset.gh_in_ac_ts)
    return lab_mm | {"GH": mirror * (AC + np.linalg.norm(AC - TS, axis=0) * along)}
