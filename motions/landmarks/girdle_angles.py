"""Angles of the girdle and the arm in each frame of a trial, from landmark positions."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from motions.checks.misfits import misfit
from motions.errors import InputError
from motions.landmarks.acromion import AcromionRotation, ac_from_aa_deg
from motions.landmarks.estimated_landmarks import SternoclavicularOffset, with_estimated_landmarks
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
from motions.motion_csv.cells import Side
from motions.motion_csv.posture_rows import MIRROR_POSITION
from motions.rhythm import clavicle_axial_rotation
from motions.rotations import DEG, cardan_from_rotation, compose, rotate, rotation_from_cardan
from motions.table import LANDMARKS

CLAVICLE_X = 2
"""Index of the clavicle's axial rotation in ANGLES."""


@dataclass(frozen=True, eq=False)
class FrameAngles:
    """Angles and positions, one row per frame, of a right shoulder; NaN where a landmark has a gap."""

    angles_deg: Float[np.ndarray, "frames 6"]
    """Angles in the order of ANGLES. The clavicle's axial rotation is NaN, as two landmarks do not determine it."""
    humerus_deg: Float[np.ndarray, "frames 3"]
    """Plane of elevation, elevation and axial rotation of the humerus (Y-Z'-Y'')."""
    landmarks_mm: dict[str, Float[np.ndarray, "frames 3"]]
    """Positions of the measured landmarks, thorax frame. Estimated landmarks are left out."""
    estimated_landmarks: dict[str, str]
    """Estimated landmarks for the clavicle's angles, each with the text that says how it was estimated."""
    thorax_deg: Float[np.ndarray, "frames 3"]
    """Angles of the thorax in the global frame (``frames.thorax_angles``), as measured, so not mirrored for a left
    shoulder; NaN if the global frame is not known."""
    global_axial_deg: Float[np.ndarray, " frames"]
    """Axial rotation of the clavicle's frame with z normal to the global y (Appendix A); NaN where not known."""


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
    ``lab_mm``: landmarks in any right-handed frame. ``aa_to_ac``: mean rotation from the scapula frame through AA to
    the thesis's frame, if AC was not measured. ``sc_from_ij``: offset that places SC, if SC was not measured.
    ``R_lab_global``: the global frame, if known.
    InputError if AC was not measured and ``aa_to_ac`` is missing, or if the landmarks are of the other shoulder.
    """
    thorax_mm = in_thorax(lab_mm, side, file)
    placed_mm, estimated_landmarks = with_estimated_landmarks(thorax_mm, aa_to_ac, sc_from_ij)
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
        estimated_landmarks = {}
    angles[3:] = _scapula_deg(thorax_mm, file, aa_to_ac)
    humerus = np.full((3, count), np.nan)
    if all(name in thorax_mm for name in ("GH", "EM", "EL")):
        humerus = humerus_angles(humerus_frame(*(thorax_mm[name] for name in ("GH", "EM", "EL")))) * float(DEG)
    kept = {name: thorax_mm[name].T for name in LANDMARKS if name in thorax_mm}
    return FrameAngles(angles.T, humerus.T, kept, estimated_landmarks, thorax.T, axial)


def estimated_axial_deg(
    angles_deg: Float[np.ndarray, "postures 6"], rest_deg: Float[np.ndarray, "6"], at_rest_deg: float = 0.0
) -> Float[np.ndarray, " postures"]:
    """Estimate the clavicle's axial rotation as the one that turns SC and AC joint least from their rotations at rest.

    Angles are in degrees; ``at_rest_deg`` is the axial rotation at rest, 0 by convention. Section 6.3 of the thesis
    minimises the rotation in both joints, note 1 of its Appendix A (Pronk) only in the AC joint. On six bone-pin
    shoulders, minimising in both joints is 1-5 degrees (rms) off the measured rotation, in the AC joint alone 5-11.
    This function minimises in both joints, by ``clavicle_axial_rotation``.
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
    """Transform the landmarks of each frame of a trial into the thorax frame; mirror a left shoulder to a right one.

    InputError if the landmarks are of the other shoulder, or in a left-handed frame.
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
    """Return the factors that make a vector of the thorax frame a right shoulder's."""
    return MIRROR_POSITION[:, None] if side == "left" else np.ones((3, 1))


def _swapped_in_thorax(lab_mm: dict[str, Float[np.ndarray, "3 frames"]], side: Side) -> list[str]:
    """List the pairs of thorax landmarks whose exchange puts the shoulder on its side, TS behind IJ and above AI."""
    found = []
    for a, b in combinations(THORAX, 2):
        other = _in_thorax({**lab_mm, a: lab_mm[b], b: lab_mm[a]}, side)
        TS, AI = (np.nanmedian(other[name], axis=1) for name in ("TS", "AI"))
        if TS[0] > 0.0 and TS[2] > 0.0 and TS[1] > AI[1] and misfit({**lab_mm, a: lab_mm[b], b: lab_mm[a]}) is None:
            found.append(f"{a} and {b}")
    return found


def _is_on_other_side(thorax_mm: dict[str, np.ndarray], file: str) -> bool:
    """Check whether the acromion is on the wrong side of the thorax. InputError if it was never measured."""
    acromion = thorax_mm["AC"] if "AC" in thorax_mm else thorax_mm["AA"]
    measured = np.isfinite(acromion[0])
    if not measured.any():
        raise InputError(
            file, None, "in no frame were the acromion and the thorax measured together", "Use another trial"
        )
    return bool(np.median(acromion[0][measured]) < 0.0)


def _other_side(lab_mm: dict[str, np.ndarray], side: Side, file: str) -> InputError:
    """Return the error for a shoulder on the wrong side: thorax landmarks swapped, or wrong side or wrong axes."""
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
    """Compute the Cardan angles of the scapula frame through AC. InputError without AC and ``aa_to_ac``."""
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
