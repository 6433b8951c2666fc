"""The angles of the girdle and of the arm in each frame of a trial, from positions of landmarks."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from motions.checks.misfits import misfit
from motions.errors import InputError
from motions.landmarks.acromion import AcromionRotation, ac_from_aa_deg
from motions.landmarks.frames import (
    clavicle_frame,
    humerus_angles,
    humerus_frame,
    scapula_frame,
    thorax_angles,
    thorax_frame,
    transposed,
)
from motions.landmarks.mapping import THORAX
from motions.landmarks.stand_ins import SternoclavicularOffset, with_stand_ins
from motions.motion_csv.cells import Side
from motions.motion_csv.posture_rows import MIRROR_POSITION
from motions.rhythm import clavicle_axial_rotation
from motions.rotations import DEG, cardan_from_rotation, compose, rotate, rotation_from_cardan
from motions.table import LANDMARKS

CLAVICLE_X = 2
"""Its place in ANGLES."""


@dataclass(frozen=True, eq=False)
class FrameAngles:
    """One row a frame, right shoulder, degrees and mm; NaN where a landmark has a gap.

    angles_deg: ANGLES; the clavicle's axial rotation is NaN, as two landmarks do not give it.
    humerus_deg: plane of elevation, elevation, axial rotation (Y-Z'-Y''). landmarks_mm: thorax frame.
    """

    angles_deg: Float[np.ndarray, "frames 6"]
    humerus_deg: Float[np.ndarray, "frames 3"]
    landmarks_mm: dict[str, Float[np.ndarray, "frames 3"]]
    """Those that were measured: what stands in for one has no position of its own."""
    stand_ins: dict[str, str]
    """Landmarks that were not measured, and what the clavicle's angles take in their place."""
    thorax_deg: Float[np.ndarray, "frames 3"]
    """Of the thorax in the global frame (``frames.thorax_angles``), as it was measured; NaN where that is not known."""
    global_axial_deg: Float[np.ndarray, " frames"]
    """Axial rotation of the clavicle's frame whose z is normal to the global y (Appendix A); NaN where not known."""


def frame_angles(
    lab_mm: dict[str, Float[np.ndarray, "3 frames"]],
    side: Side,
    file: str,
    aa_to_ac: AcromionRotation | None = None,
    sc_from_ij: SternoclavicularOffset | None = None,
    R_lab_global: Float[np.ndarray, "3 3"] | None = None,
) -> FrameAngles:
    """Compute the angles of every frame (thesis, Appendix A).

    A left shoulder is mirrored in the sagittal plane of its thorax.
    lab_mm: landmarks in any right-handed frame. aa_to_ac: what brings a scapula through AA to the thesis's frame, where
    AC was not measured; sc_from_ij: what places SC, where it was not; R_lab_global: the global frame, if it is known.
    InputError if the first of these is wanting, or if the landmarks are those of the other shoulder.
    """
    thorax_mm = in_thorax(lab_mm, side, file)
    placed_mm, stand_ins = with_stand_ins(thorax_mm, aa_to_ac, sc_from_ij)
    count = thorax_mm["TS"].shape[1]
    angles = np.full((6, count), np.nan)
    R_lab_thorax = thorax_frame(*(lab_mm[name] for name in THORAX))
    thorax, axial = np.full((3, count), np.nan), np.full(count, np.nan)
    if R_lab_global is not None:
        thorax = thorax_angles(compose(R_lab_global.T[..., None], R_lab_thorax)) * float(DEG)
    if "SC" in placed_mm and "AC" in placed_mm:
        if R_lab_global is not None:
            y_global = _of_side(side) * rotate(transposed(R_lab_thorax), R_lab_global[:, 1:2])
            axial = _cardan_deg(clavicle_frame(placed_mm["SC"], placed_mm["AC"], y_global))[CLAVICLE_X]
        y_thorax = np.array([0.0, 1.0, 0.0])[:, None]
        angles[:CLAVICLE_X] = _cardan_deg(clavicle_frame(placed_mm["SC"], placed_mm["AC"], y_thorax))[:CLAVICLE_X]
    else:
        stand_ins = {}
    angles[3:] = _scapula_deg(thorax_mm, file, aa_to_ac)
    humerus = np.full((3, count), np.nan)
    if all(name in thorax_mm for name in ("GH", "EM", "EL")):
        humerus = humerus_angles(humerus_frame(*(thorax_mm[name] for name in ("GH", "EM", "EL")))) * float(DEG)
    kept = {name: thorax_mm[name].T for name in LANDMARKS if name in thorax_mm}
    return FrameAngles(angles.T, humerus.T, kept, stand_ins, thorax.T, axial)


def estimated_axial_deg(
    angles_deg: Float[np.ndarray, "postures 6"], rest_deg: Float[np.ndarray, "6"], at_rest_deg: float = 0.0
) -> Float[np.ndarray, " postures"]:
    """Estimate the clavicle's axial rotation: the one that turns SC and AC joint least from rest, where it is known.

    Angles in degrees; ``at_rest_deg``: that at rest, 0 by convention. Section 6.3 of the thesis minimises the rotation
    in both joints, note 1 of its Appendix A (Pronk) in the AC joint alone. On six bone-pin shoulders the former is 1-5
    degrees (rms) off the measured rotation, the latter 5-11: here it is the former, `clavicle_axial_rotation`.
    """
    rest = np.where(np.arange(6) == CLAVICLE_X, at_rest_deg, rest_deg) / float(DEG)
    postures = angles_deg.T / float(DEG)
    R_clavicle, R_scapula = (
        np.repeat(rotation_from_cardan(part)[..., None], len(angles_deg), axis=2) for part in (rest[:3], rest[3:])
    )
    return clavicle_axial_rotation(postures[:2], postures[3:], R_clavicle, R_scapula) * float(DEG)


def in_thorax(
    lab_mm: dict[str, Float[np.ndarray, "3 frames"]], side: Side, file: str
) -> dict[str, Float[np.ndarray, "3 frames"]]:
    """Bring landmarks into the thorax frame of their own frame of the trial, as those of a right shoulder.

    InputError if the landmarks are those of the other shoulder, or in a left-handed frame.
    """
    thorax_mm = _in_thorax(lab_mm, side)
    if _is_on_other_side(thorax_mm, file):
        raise _other_side(lab_mm, side, file)
    return thorax_mm


def _in_thorax(
    lab_mm: dict[str, Float[np.ndarray, "3 frames"]], side: Side
) -> dict[str, Float[np.ndarray, "3 frames"]]:
    R_lab_thorax = thorax_frame(*(lab_mm[name] for name in THORAX))
    return {
        name: _of_side(side) * rotate(transposed(R_lab_thorax), position - lab_mm["IJ"])
        for name, position in lab_mm.items()
    }


def _of_side(side: Side) -> Float[np.ndarray, "3 1"]:
    """What a vector of the thorax frame is times, to be a right shoulder's."""
    return MIRROR_POSITION[:, None] if side == "left" else np.ones((3, 1))


def _swapped_in_thorax(lab_mm: dict[str, Float[np.ndarray, "3 frames"]], side: Side) -> list[str]:
    """The pairs of landmarks of the thorax whose exchange puts the shoulder on its side: TS behind IJ and above AI."""
    found = []
    for a, b in combinations(THORAX, 2):
        other = _in_thorax({**lab_mm, a: lab_mm[b], b: lab_mm[a]}, side)
        TS, AI = (np.nanmedian(other[name], axis=1) for name in ("TS", "AI"))
        if TS[0] > 0.0 and TS[2] > 0.0 and TS[1] > AI[1] and misfit({**lab_mm, a: lab_mm[b], b: lab_mm[a]}) is None:
            found.append(f"{a} and {b}")
    return found


def _is_on_other_side(thorax_mm: dict[str, np.ndarray], file: str) -> bool:
    """Whether the acromion is on the other side of the thorax than it should be."""
    acromion = thorax_mm["AC"] if "AC" in thorax_mm else thorax_mm["AA"]
    measured = np.isfinite(acromion[0])
    if not measured.any():
        raise InputError(
            file, None, "in no frame were the acromion and the thorax measured together", "Use another trial"
        )
    return bool(np.median(acromion[0][measured]) < 0.0)


def _other_side(lab_mm: dict[str, np.ndarray], side: Side, file: str) -> InputError:
    """The error of a shoulder on the other side: two landmarks of the thorax are swapped, or the side or axes wrong."""
    other = "left" if side == "right" else "right"
    cause = f"the acromion lies on the {other} of IJ, PX, C7 and T8, but the side is {side}"
    swaps = _swapped_in_thorax(lab_mm, side)
    swapped = f"Are {', or '.join(swaps)} swapped? With them exchanged it is on its side. If not: " if swaps else ""
    remedy = swapped + (
        f"Say --side {other} if it is a {other} shoulder; if it is not, the file's axes are left-handed: "
        'turn one round with axes = ["x", "y", "-z"] in a mapping file (--map)'
    )
    return InputError(file, None, cause, remedy)


def _scapula_deg(
    thorax_mm: dict[str, np.ndarray], file: str, aa_to_ac: AcromionRotation | None
) -> Float[np.ndarray, "3 frames"]:
    """Cardan angles of the scapula frame through AC."""
    if "AC" in thorax_mm:
        return _cardan_deg(scapula_frame(thorax_mm["AC"], thorax_mm["TS"], thorax_mm["AI"]))
    if aa_to_ac is None:
        cause = "the scapula has AA but not AC, and the frames through them are some 18 degrees apart"
        remedy = "Measure AC, or accept a mean rotation with --aa-to-ac kolz2020"
        raise InputError(file, None, cause, remedy)
    through_aa = _cardan_deg(scapula_frame(thorax_mm["AA"], thorax_mm["TS"], thorax_mm["AI"]))
    return ac_from_aa_deg(through_aa.T, aa_to_ac).T


def _cardan_deg(R) -> Float[np.ndarray, "3 frames"]:
    return cardan_from_rotation(R) * float(DEG)
