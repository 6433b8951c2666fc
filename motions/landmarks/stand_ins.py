"""SC that nobody marked, by a stated offset from IJ; AC from AA (``motions.landmarks.acromion``). Never silent."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.landmarks.acromion import POSITION_SD_MM, AcromionRotation, ac_position_from_aa

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
