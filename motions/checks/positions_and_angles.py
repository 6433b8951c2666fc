"""Checks of landmark positions against the angles of the same rows: another frame, other rows, exchanged columns."""

import numpy as np
from jaxtyping import Float

from motions.checks.distances import RANGES
from motions.checks.misfits import BEYOND_MM, SC_BEYOND_MM, SHOULDER
from motions.checks.motion_table import FEWEST_STILL, Doubt, arm_moves, in_order, posture_of, some_of
from motions.checks.never_seen import runs_at_one_place
from motions.checks.rigidity import SCAPULA
from motions.rotations import rotation_from_cardan
from motions.table import BONES, Motions

ALONG_BONE_DEG, ALONG_BORDER_DEG = 30.0, 45.0
"""Maximum angles in degrees between the axis of a bone by its landmarks and by its angles: along the bone, and along
the medial border TS-AI. Measured: 9-13 between SC-AA and the clavicle. TS-AI and the scapula's y axis differ by some 15
in every set, and by more with the angles of AA."""

THORAX_FRAME = "Positions are in mm in the thorax frame: origin IJ, x lateral, y up, z backward (docs/frames.md)"


def in_another_frame(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find positions in another frame: lines between landmarks across the bones, landmarks on the other side of the
    thorax, or another origin than IJ."""
    if likelier := _likelier(mine, places):
        return likelier
    said = [text for text in (_across(mine, places), _beyond(places), _not_about_origin(places)) if text]
    return (said[0], THORAX_FRAME) if said else None


def _beyond(places: dict[str, Float[np.ndarray, "3 n"]]) -> str:
    for name in SHOULDER:
        x = places[name][0][np.isfinite(places[name][0])] if name in places else np.empty(0)
        if len(x) and np.median(x) < -(SC_BEYOND_MM if name == "SC" else BEYOND_MM):
            return f"{name} is at x = {np.median(x):.0f} mm, on the other side of the thorax"
    return ""


def _not_about_origin(places: dict[str, Float[np.ndarray, "3 n"]]) -> str:
    """Write a message if the distance of SC from the origin, IJ, is no person's; empty otherwise."""
    mm = np.linalg.norm(places["SC"], axis=0) if "SC" in places else np.empty(0)
    mm, usual = mm[np.isfinite(mm)], RANGES["SC", "IJ"]
    if not len(mm) or usual.low_mm <= np.median(mm) <= usual.high_mm:
        return ""
    return f"SC is {np.median(mm):.3g} mm from IJ, in people {usual.low_mm:.0f} to {usual.high_mm:.0f}"


LIKELIER_FROM_DEG = 8.0
"""Angle in degrees between a bone by landmarks on its axis and by its angles, which are equal by definition. Above it,
other columns are suggested if they leave less than it, and less than half of the present angle."""


def _likelier(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find exchanged columns, or 90 degrees minus the angle, by the line from SC or TS to AC."""
    for begin, bone in (("SC", "clavicle"), ("TS", "scapula")):
        if not {begin, "AC"} <= places.keys():
            continue
        y, z, x = mine.angles_deg.T[BONES[bone]]
        way = places["AC"] - places[begin]
        is_away, by_x, by_90 = (_away_deg(way, _x_axis(*one)) for one in ((y, z), (y, x), (90.0 - y, z)))
        for away, what in ((by_x, f"{bone}_z_deg and {bone}_x_deg exchanged"), (by_90, f"90 minus {bone}_y_deg")):
            if is_away > LIKELIER_FROM_DEG and away < min(is_away / 2.0, LIKELIER_FROM_DEG):
                line = f"the line from {begin} to AC is {is_away:.0f} degrees away from the {bone} by its angles"
                remedy = "Are the columns what their names say (docs/frames.md), and AC not AA?"
                return f"{line}, and {away:.0f} with {what}", remedy
    return None


def _across(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> str:
    """Write a message about the first bone whose landmarks lie across it; empty if there is none."""
    clavicle, scapula = _x_axis(*mine.angles_deg.T[:2]), rotation_from_cardan(np.radians(mine.angles_deg.T[3:]))
    for begin, end, bone, axis, most in (
        *(("SC", end, "clavicle", clavicle, ALONG_BONE_DEG) for end in ("AC", "AA")),
        *(("TS", end, "scapula", scapula[:, 0], ALONG_BONE_DEG) for end in ("AC", "AA")),
        ("TS", "AI", "scapula", -scapula[:, 1], ALONG_BORDER_DEG),
    ):
        if begin in places and end in places and (away := _away_deg(places[end] - places[begin], axis)) > most:
            return f"the line from {begin} to {end} is {away:.0f} degrees away from where the angles put the {bone}"
    return ""


def _x_axis(y_deg: Float[np.ndarray, " n"], z_deg: Float[np.ndarray, " n"]) -> Float[np.ndarray, "3 n"]:
    """Compute the x axis of a bone, which does not depend on its third angle."""
    return rotation_from_cardan(np.radians(np.stack([y_deg, z_deg, np.zeros_like(y_deg)])))[:, 0]


def _away_deg(way: Float[np.ndarray, "3 n"], axis: Float[np.ndarray, "3 n"]) -> float:
    """Compute the angle in degrees between lines and unit vectors, from its median cosine; NaN if none is known."""
    along = np.sum(way * axis, axis=0) / np.maximum(np.linalg.norm(way, axis=0), 1.0)
    known = along[np.isfinite(along)]
    return float(np.degrees(np.arccos(np.clip(np.median(known), -1.0, 1.0)))) if len(known) else np.nan


APART_MM, MOST_APART_MM, TIMES_MEDIAN = 12.0, 35.0, 5.0
"""Limits in mm of the distance of a landmark from its place on rigid bones at the measured angles: ``TIMES_MEDIAN``
times the median of the file, but at least ``APART_MM`` and at most ``MOST_APART_MM``. Measured with bone pins: at most
6, with medians of 1 to 2. With SDs of 5 mm per coordinate and 1.5 degrees per angle, one simulated person in 300
exceeds them."""

_FEWEST_POSTURES = 8
"""Minimum number of postures: three coordinates each, for the six constants of a landmark in the two bones."""

_MOST_OFF = 8
"""Number of postures among which one may be an outlier."""


TURNS_DEG = 5.0
"""Minimum change in degrees of an angle of the clavicle that moves its end, by 13 mm."""


def still_places(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find landmarks of the scapula that stay at one place while the arm moves, or the clavicle in part of a motion."""
    known = {name: xyz[:, np.isfinite(xyz).all(axis=0)] for name, xyz in places.items() if name in SCAPULA}
    still = [name for name, xyz in known.items() if xyz.shape[1] >= FEWEST_STILL and not np.ptp(xyz, axis=1).any()]
    if still and arm_moves(mine):
        cause = f"{' and '.join(still)} is at one place in every posture while the arm moves"
        return cause, _COPIED_DOWN
    found = []
    for name in known:
        for motion, rows in in_order(mine):
            for first, last in runs_at_one_place(places[name][:, rows], FEWEST_STILL):
                turns = float(np.ptp(mine.angles_deg[rows[first : last + 1], :2], axis=0).max())
                if turns >= TURNS_DEG:  # NaN compares false
                    span = f"postures {mine.posture[rows[first]]} to {mine.posture[rows[last]]} of {motion!r}"
                    found.append(f"{name} is at one place in {span} while the clavicle turns by {turns:.0f}")
    return (some_of(found), _COPIED_DOWN) if found else None


_COPIED_DOWN = "Were cells copied down? Empty them if it was not measured"


def at_origin(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find landmarks at exactly (0, 0, 0) in some postures, where IJ is and no other landmark."""
    for name, place in places.items():
        rows = np.flatnonzero((place == 0.0).all(axis=0))
        if len(rows):
            postures = f"{len(rows)} posture{'s' if len(rows) > 1 else ''}"
            cause = f"{name} is at (0, 0, 0) in {postures}, first {posture_of(mine, rows[0])}"
            return cause, "IJ is the origin: empty its cells if it was not measured"
    return None


LEAST_OFF_CLAVICLE_DEG = 20.0
"""Minimum angle in degrees between the clavicle and the line from SC to TS or AI. To AA, at the end of the clavicle, 9
to 13 were measured; to TS it is 40 or more, and 25 with a long clavicle and a small scapula."""


def along_clavicle(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find TS or AI where the acromion is."""
    axis = _x_axis(*mine.angles_deg.T[:2])
    for name in ("TS", "AI") if "SC" in places else ():
        away = _away_deg(places[name] - places["SC"], axis) if name in places else np.nan
        if away < LEAST_OFF_CLAVICLE_DEG:
            return f"{name} lies along the clavicle, {away:.0f} degrees off it from SC", "Is it AC or AA?"
    return None


def apart_from_angles(mine: Motions, places: dict[str, Float[np.ndarray, "3 n"]]) -> Doubt | None:
    """Find positions that rigid bones at the angles of the same rows cannot have.

    With R_C and R_S from the angles, and c and s constant in clavicle and scapula, a landmark of the scapula is at
    SC + R_C c + R_S s in every posture. Least squares give c and s. The posture with the largest residual is left out,
    and the fit repeated, for up to one posture in eight. If more are off, positions and angles are of different rows.
    """
    R = [rotation_from_cardan(np.radians(mine.angles_deg.T[part])) for part in BONES.values()]
    bones = np.concatenate(R, axis=1).transpose(2, 0, 1)
    for name in ("AC", "AA", "TS", "AI") if "SC" in places else ():
        way = (places[name] - places["SC"]).T if name in places else np.full((1, 3), np.nan)
        known = np.flatnonzero(np.isfinite(way).all(axis=1) & np.isfinite(bones).all(axis=(1, 2)))
        if len(known) < _FEWEST_POSTURES:
            continue
        kept, off, mm = known, [], _apart_mm(way[known], bones[known])
        most = min(max(APART_MM, TIMES_MEDIAN * float(np.median(mm))), MOST_APART_MM)
        while mm.max() > most and len(off) < len(known) // _MOST_OFF:
            off.append((int(kept[mm.argmax()]), float(mm.max())))
            kept = np.delete(kept, mm.argmax())
            mm = _apart_mm(way[kept], bones[kept])
        if off and mm.max() > most:
            cause = f"{name} and SC are up to {off[0][1]:.0f} mm from where the angles of their rows put them"
            return cause, "Are the rows of positions in another order, or of another trial?"
        if off:
            said = [f"{posture_of(mine, row)} {name} or SC is {one:.0f} mm off the angles" for row, one in sorted(off)]
            return some_of(said), "Was a marker lost there, or are rows in another order? Empty what is wrong"
    return None


def _apart_mm(way: Float[np.ndarray, "n 3"], bones: Float[np.ndarray, "n 3 6"]) -> Float[np.ndarray, " n"]:
    """Compute the distances (mm) of the vectors ``way`` from ``bones`` c, with c by least squares."""
    c = np.linalg.lstsq(bones.reshape(-1, 6), way.reshape(-1), rcond=None)[0]
    return np.linalg.norm(way - bones @ c, axis=1)
