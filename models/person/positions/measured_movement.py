"""Movements of SC and AC as landmark positions measure them, without a fitted amplitude.

    sc_translation: SC_p - mean(SC)                              thorax frame
    ac_translation: R_C' (AC_p - SC_p) - mean                    clavicle frame, where AC was measured
                    R_C' (AA_p - SC_p - R_S a) - mean            clavicle frame, where AA was measured instead

over the postures p of a subject, with R_C and R_S at the measured angles. The place a of AA in the scapula and the
place ac of AC in the clavicle are the constants for which AA = SC + R_C ac + R_S a fits best over all postures
(:func:`_place_of_aa_mm`).
"""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Bool, Float

from models.girdle import bone_rotations
from motions.errors import InputError, warn_input
from motions.landmarks.sampled_postures import measured_places_mm
from motions.rotations import DEG, rotate
from motions.table import Motions

MEASURED = "measured"
"""Word that stands in place of amplitudes and selects the movement measured by landmark positions."""

_LANDMARKS: Mapping[str, str] = {"sc_translation": "SC", "ac_translation": "SC, and AC or AA"}
"""Landmarks whose positions show an effect, by effect."""

_AC_MM, _AC_SD_MM = np.array([155.0, 0.0, 0.0]), np.array([15.0, 12.0, 12.0])
"""Prior mean and SD of AC in the clavicle frame. The shipped sets have lengths of 145-182 mm; the axis of the clavicle
may be 4 deg off, and the joint 3 mm off this axis (``models.person.own_bones``)."""

AA_SD_MM = 30.0
"""Prior SD of the coordinates of AA relative to AC; AA lies some 40 mm behind and beside AC. The prior determines the
solution where rotations differ too little to do so."""

POSITION_SD_MM = 3.0
"""SD of a measured AA about the best chain. It only sets the weight of the positions against the two priors above."""

Places = Mapping[str, Float[np.ndarray, "3 postures"]]


def measurable(name: str) -> bool:
    """Check whether landmark positions can measure the strength of this effect."""
    return name in _LANDMARKS


def measured_movement_mm(name: str, motions: Motions) -> Float[np.ndarray, "3 postures"]:
    """Compute the strength of an effect at every posture from measured positions, mm; 0 where positions or angles are
    missing. InputError where no posture has them."""
    found = _movement_mm(name, motions)
    if not np.isfinite(found).any():
        cause = f"{name}={MEASURED} needs positions of {_LANDMARKS[name]}, and the motions have none"
        remedy = "Add the columns SC_x_mm, SC_y_mm, SC_z_mm, ... (docs/your_data.md), or give amplitudes"
        raise InputError("--effect", None, cause, remedy)
    return np.nan_to_num(found)


def warn_of_unmeasured(names: list[str], motions: Motions) -> None:
    """Warn of postures that lack the positions of an effect whose movement is taken as measured."""
    for name in names:
        missing = int((~_known(_movement_mm(name, motions))).sum())
        if missing:
            cause = f"{name}: {_LANDMARKS[name]} not measured in {missing} of {len(motions.posture)} postures"
            warn_input(InputError("the motions", None, cause, "The joint does not move there; measure them too"))


def _movement_mm(name: str, motions: Motions) -> Float[np.ndarray, "3 postures"]:
    """Compute the movement at every posture, mm; NaN where it was not measured."""
    places, of_subject = measured_places_mm(motions), _MOVEMENTS[name]
    nowhere = np.full((3, len(motions.posture)), np.nan)
    at = {landmark: places.get(landmark, nowhere) for landmark in ("SC", "AC", "AA")}
    rotations = bone_rotations(motions.angles_deg.T / DEG)
    found = nowhere.copy()
    for rows in motions.rows_by_subject():
        own = of_subject({k: place[:, rows] for k, place in at.items()}, *(R[..., rows] for R in rotations))
        known = _known(own)
        if known.any():
            found[:, rows[known]] = own[:, known] - own[:, known].mean(axis=1, keepdims=True)
    return found


def _known(places: Float[np.ndarray, "3 postures"]) -> Bool[np.ndarray, " postures"]:
    return np.all(np.isfinite(places), axis=0)


def _sc_mm(at: Places, *_) -> Float[np.ndarray, "3 postures"]:
    return at["SC"]


def _ac_mm(at: Places, R_thorax_clavicle, R_thorax_scapula) -> Float[np.ndarray, "3 postures"]:
    """Compute AC in the clavicle frame, from AA where no posture has AC."""
    AC = at["AC"]
    if not _known(AC - at["SC"]).any():
        a = _place_of_aa_mm(at, R_thorax_clavicle, R_thorax_scapula)
        AC = at["AA"] - rotate(R_thorax_scapula, a[:, None])
    return rotate(np.swapaxes(R_thorax_clavicle, 0, 1), AC - at["SC"])


_MOVEMENTS: Mapping[str, Callable[..., Float[np.ndarray, "3 postures"]]] = {
    "sc_translation": _sc_mm,
    "ac_translation": _ac_mm,
}


def _place_of_aa_mm(at: Places, R_thorax_clavicle, R_thorax_scapula) -> Float[np.ndarray, "3"]:
    """Find the place of AA in the scapula by least squares over AA - SC = R_C ac + R_S a, with priors on ac and a."""
    rotations = np.concatenate([R_thorax_clavicle, R_thorax_scapula], axis=1)
    away = at["AA"] - at["SC"] - rotate(R_thorax_clavicle, _AC_MM[:, None])
    known = _known(away) & np.isfinite(rotations).all(axis=(0, 1))
    rows = np.moveaxis(rotations[..., known], -1, 0).reshape(-1, 6) / POSITION_SD_MM
    held = np.diag(1.0 / np.concatenate([_AC_SD_MM, np.full(3, AA_SD_MM)]))
    wanted = np.concatenate([away[:, known].T.ravel() / POSITION_SD_MM, np.zeros(6)])
    return np.linalg.lstsq(np.concatenate([rows, held]), wanted, rcond=None)[0][3:]
