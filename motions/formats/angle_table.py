"""Conversion of tables of angles (.mot and .sto) to postures, and back."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
from jaxtyping import Float

from motions.errors import InputError, listed, warn_input
from motions.formats.isb import ISB_ANGLES, isb_from_thesis, thesis_from_isb
from motions.formats.mot import AngleTable
from motions.landmarks.acromion import ac_from_aa_deg
from motions.landmarks.mapping import Mapping
from motions.landmarks.resampling import resample_trial
from motions.landmarks.sampled_postures import ESTIMATED, FRAMES, SCAPULA_ROTATED, Labels, is_yes, spread_column
from motions.motion_csv.cells import ANGLE_REMEDY, ELEVATION_REMEDY, LARGEST_ANGLE_DEG
from motions.motion_csv.columns import SIDE_MEASURED
from motions.motion_csv.posture_rows import MIRROR_ANGLES
from motions.motion_csv.unit_and_side import LEAST_VALUES
from motions.rotations import DEG, cardan_from_rotation, compose, rotation_from_cardan
from motions.table import ANGLES, FEWEST_ANGLES, Motions

ELEVATION = "humerus_elevation"
SCAPULA_THROUGH = "scapula_through"
"""Header key for the landmark of the scapula, AC or AA, which ISB's names of the angles do not tell."""
ORIGIN = "origin"
"""Header key, and extra column, that marks simulated motions."""


_MOST_NAMED = 40
"""Maximum number of columns in a message."""

_OF_JOINT = re.compile(r"(.*/)?(ac|acromioclavicular)_?(joint_?)?[xyz]{1,2}(/value)?$", re.IGNORECASE)
"""Coordinate of the AC joint, as DAS3 calls it (AC_y, AC_z, AC_x)."""

_OF_OUR_OSIM = re.compile(r"scapula_(abduction|elevation|upward_rot|winging)\b")

_WIDE = ("clavicle_y", ISB_ANGLES[0], "scapula_y", ISB_ANGLES[3])
"""Protraction of clavicle and scapula, under both names."""

_LEAST_SPAN = 0.5
"""Minimum range of elevations below pi that are taken for radians: an arm that moves by 30 degrees. An arm that hangs
below 3 degrees moves by tenths."""

_SAY_RELATIVE = 'write scapula_relative_to = "clavicle", or "thorax", above [columns] in a mapping file (--map)'


def motions_from_table(table: AngleTable, mapping: Mapping, labels: Labels) -> Motions:
    """Take the postures from the rows of a file, or at ``labels.at_deg``, and mirror a left shoulder.

    The columns are humerus_elevation and ANGLES, or ISB_ANGLES in ISB's sequence, under these names or the mapping's.
    ISB's scapula goes through AA, unless the header says AC. Raise InputError if no bone has a column, if no rotation
    from AA to AC was chosen for a scapula through AA, if the values are in another unit than the header says, or if it
    is not clear what the scapula's angles are relative to. Issue an InputWarning that names a bone without any column.
    """
    isb = any(_column(table, mapping, name) is not None for name in ISB_ANGLES)
    names = ISB_ANGLES if isb else ANGLES
    found = {name: _column(table, mapping, name) for name in (*names, ELEVATION)}
    *angles, elevation_deg = _measured(table, mapping, found)
    angles_deg = _within_half_a_turn(table, np.stack(angles, axis=1))
    if isb:
        angles_deg = thesis_from_isb(angles_deg)
    if mapping.scapula_relative_to == "clavicle":
        angles_deg = _relative_to_thorax(angles_deg)
    if labels.side == "left":
        angles_deg = angles_deg * MIRROR_ANGLES
    through = table.header.get(SCAPULA_THROUGH) or ("AA" if isb else "AC")
    if through != "AC":
        angles_deg = _brought_to_ac(table, angles_deg, labels)
    if (elevation_deg < 0.0).any():  # NaN compares false
        cause = f"{mapping.column(ELEVATION)} is {np.nanmin(elevation_deg):g}, below 0"
        raise InputError(table.file, None, cause, ELEVATION_REMEDY)
    if (elevation_deg > LARGEST_ANGLE_DEG).any():
        cause = f"{mapping.column(ELEVATION)} is {np.nanmax(elevation_deg):g}, more than {LARGEST_ANGLE_DEG:g} degrees"
        raise InputError(table.file, None, cause, ELEVATION_REMEDY)
    numbers, extra = _numbers(table), {}
    if labels.at_deg:
        whose = mapping.column(ELEVATION)
        sampled = resample_trial(elevation_deg, angles_deg, np.array(labels.at_deg), table.file, whose)
        angles_deg, elevation_deg = sampled.values, sampled.at_deg
        numbers = np.arange(1, len(elevation_deg) + 1)
        extra = {spread_column(angle): [f"{x:.4g}" for x in sampled.spread[:, k]] for k, angle in enumerate(ANGLES)}
        extra[FRAMES] = [str(count) for count in sampled.frames.tolist()]
    measured = np.sum(np.isfinite(angles_deg), axis=1) >= FEWEST_ANGLES
    if not measured.any():
        cause = f"no posture has {FEWEST_ANGLES} angles; of columns there are {', '.join(_there(mapping, found))}"
        raise InputError(table.file, None, cause, f"Name the others in a mapping file (--map); it has {_listed(table)}")
    _warn_of_bones(table, mapping, found)
    count = len(elevation_deg)
    marks = {
        SCAPULA_ROTATED: labels.scapula_rotated if through != "AC" else "",
        ORIGIN: table.header.get(ORIGIN, ""),
        ESTIMATED: "yes" if table.header.get(ESTIMATED) == "yes" else "",
        SIDE_MEASURED: "left" if labels.side == "left" else "",
    }
    extra |= {column: [mark] * count for column, mark in marks.items() if mark}
    motions = Motions(
        subject=np.array([labels.subject or table.header.get("subject", "")] * count),
        motion=np.array([labels.motion or table.header.get("motion", "")] * count),
        posture=numbers,
        humerus_elevation_deg=elevation_deg,
        angles_deg=angles_deg,
        landmarks_mm={},
        extra=pd.DataFrame(extra, index=pd.RangeIndex(count), dtype=str),
    )
    return motions.select(measured)


def _column(table: AngleTable, mapping: Mapping, name: str) -> np.ndarray | None:
    """Return the column of this name, in any case and with or without _deg; None if there is none.

    In a file of OpenSim's states, it is the coordinate of this name (``/jointset/sternoclavicular/clavicle_y/value``).
    """
    wanted = mapping.column(name)
    if wanted in table.columns:
        return table.columns[wanted]
    state = re.compile(rf"(.*/)?{re.escape(wanted)}(_deg)?(/value)?", re.IGNORECASE)
    matches = [column for column in table.columns if state.fullmatch(column)]
    if len(matches) > 1:
        cause = f"columns {' and '.join(matches)} may both be {name}"
        raise InputError(table.file, None, cause, "Say in a mapping file (--map), under [columns], which it is")
    return table.columns[matches[0]] if matches else None


def _measured(table: AngleTable, mapping: Mapping, found: dict[str, np.ndarray | None]) -> list[np.ndarray]:
    """Return the angles and the elevation, NaN without a column. Raise InputError if their joint or unit is wrong."""
    missing = np.full(table.count, np.nan)
    columns = {name: missing if column is None else column for name, column in found.items()}
    _check_there(table, mapping, found)
    _check_unit(table, mapping, columns)
    return list(columns.values())


def _within_half_a_turn(table: AngleTable, angles_deg: Float[np.ndarray, "rows 6"]) -> Float[np.ndarray, "rows 6"]:
    """Take a turn off angles from 0 to 360, and off those that a program made continuous. Raise InputError where a turn
    is not enough: the angles have another unit."""
    turned = np.where(np.abs(angles_deg) > LARGEST_ANGLE_DEG, angles_deg - np.sign(angles_deg) * 360.0, angles_deg)
    if (np.abs(turned) > LARGEST_ANGLE_DEG).any():  # NaN compares false
        cause = f"an angle is {angles_deg.ravel()[np.nanargmax(np.abs(angles_deg))]:g} degrees"
        raise InputError(table.file, None, cause, ANGLE_REMEDY)
    return turned


def _check_there(table: AngleTable, mapping: Mapping, found: dict[str, np.ndarray | None]) -> None:
    """Raise InputError if no bone has a column, or if the columns of the scapula may belong to a joint."""
    names = [mapping.column(name) for name in found if name != ELEVATION]
    of_joint = [column for column in table.columns if _OF_JOINT.match(column)]
    angles = [column for name, column in found.items() if name != ELEVATION and column is not None]
    if np.isnan(angles).all():
        remedy = f"Name them in a mapping file (--map), under [columns]; the file has {_listed(table)}"
        if of_joint:
            remedy += f". {of_joint[0]} looks like the AC joint's, relative to the clavicle: {_SAY_RELATIVE}"
        raise InputError(table.file, None, f"none of the columns {', '.join(names)} is there", remedy)
    joint = [name for name in names[3:] if _OF_JOINT.match(name)]
    if joint and not mapping.scapula_relative_to:
        cause = f"{joint[0]} looks like an angle of the AC joint: relative to the clavicle and not to the thorax"
        raise InputError(table.file, None, cause, f"Say what it is relative to: {_SAY_RELATIVE}")


def _warn_of_bones(table: AngleTable, mapping: Mapping, found: dict[str, np.ndarray | None]) -> None:
    """Issue an InputWarning that names the bones without any column, and says what their columns could be."""
    names = list(found)
    bones = {"clavicle": names[:3], "scapula": names[3:6], "humerus": names[6:]}
    absent = {bone: own for bone, own in bones.items() if all(found[name] is None for name in own)}
    if not absent:
        return
    wanted = "; ".join(f"{bone} ({', '.join(map(mapping.column, own))})" for bone, own in absent.items())
    remedy = f"Name them in a mapping file (--map), under [columns], if they are there; the file has {_listed(table)}"
    if "scapula" in absent and any(_OF_JOINT.match(column) for column in table.columns):
        remedy += f". If its angles are those of the AC joint, {_SAY_RELATIVE}"
    elif "scapula" in absent and any(_OF_OUR_OSIM.search(column) for column in table.columns):
        remedy += ". Coordinates of OpenSim's scapulothoracic joint are no angles of a bone: export those of the body"
    warn_input(InputError(table.file, None, f"there is no column of {wanted}, and its angles stay empty", remedy))


def _there(mapping: Mapping, found: dict[str, np.ndarray | None]) -> list[str]:
    return [mapping.column(name) for name, column in found.items() if column is not None]


def _listed(table: AngleTable) -> str:
    return listed(list(table.columns), _MOST_NAMED)


def _check_unit(table: AngleTable, mapping: Mapping, columns: dict[str, np.ndarray]) -> None:
    """Raise InputError if the values show another unit than the header says, or two units.

    Protraction of clavicle and scapula exceeds 30 degrees in every published motion
    (``motions.motion_csv.unit_and_side``); protraction of the scapula relative to the clavicle need not. If both bones
    were measured, one row is enough.
    """
    said = table.header.get("indegrees", "").lower()
    in_file = columns if said == "yes" else {name: np.deg2rad(column) for name, column in columns.items()}
    largest = {name: float(np.nanmax(np.abs(column), initial=0.0)) for name, column in in_file.items()}
    wide = _WIDE[: 2 if mapping.scapula_relative_to == "clavicle" else 4]
    known = [name for name in wide if np.isfinite(columns.get(name, np.nan)).any()]
    least = 1 if len(known) > 1 and all(largest[name] <= np.pi for name in known) else LEAST_VALUES
    radians = [
        name for name, column in in_file.items() if name in (*wide, ELEVATION) and _in_radians(name, column, least)
    ]
    degrees = [name for name, value in largest.items() if value > np.pi]
    most = max(degrees, key=lambda name: largest[name], default="")
    if radians and degrees:
        cause = (
            f"{mapping.column(most)} goes to {largest[most]:.4g}: degrees; {mapping.column(radians[0])} never exceeds "
        )
        cause += f"{largest[radians[0]]:.3g}: radians"
        raise InputError(table.file, table.unit_line, cause, "Bring all angles to one unit, and say it (inDegrees)")
    if said == "no" and degrees:
        goes = f"{mapping.column(most)} goes to {largest[most]:.4g}"
        cause = f"the header says radians (inDegrees=no), but {goes}: degrees"
        raise InputError(table.file, table.unit_line, cause, "Write inDegrees=yes")
    if said == "yes" and radians:
        never = f"{mapping.column(radians[0])} never exceeds {largest[radians[0]]:.3g}"
        cause = f"the header says degrees (inDegrees=yes), but {never}: radians"
        raise InputError(table.file, table.unit_line, cause, "Write inDegrees=no if all angles are in radians")


def _in_radians(name: str, column: Float[np.ndarray, " rows"], least: int) -> bool:
    """Check whether an angle that exceeds 30 degrees in people is at most pi; an elevation only if the arm moves."""
    known = column[np.isfinite(column)]
    if len(known) < least or np.abs(known).max() > np.pi:
        return False
    return name != ELEVATION or float(np.ptp(known)) > _LEAST_SPAN


def _relative_to_thorax(angles_deg: Float[np.ndarray, "postures 6"]) -> Float[np.ndarray, "postures 6"]:
    """Compute the scapula's angles relative to the thorax, R_thorax_scapula = R_thorax_clavicle R_clavicle_scapula."""
    R_clavicle, R_joint = (rotation_from_cardan(part.T / DEG) for part in (angles_deg[:, :3], angles_deg[:, 3:]))
    scapula_deg = cardan_from_rotation(compose(R_clavicle, R_joint)).T * float(DEG)
    return np.concatenate([angles_deg[:, :3], scapula_deg], axis=1)


def table_from_motions(motions: Motions, isb: bool, file: str) -> AngleTable:
    """Arrange the postures of one motion of one subject as columns, in degrees; time is the number of the posture.

    The columns are elevation and the six ANGLES, or ISB_ANGLES: the same rotations under ISB's names, with the scapula
    still through AC.
    """
    subject, motion = str(motions.subject[0]), str(motions.motion[0])
    for name in (subject, motion):
        if "\n" in name or "\r" in name:
            raise InputError(file, None, f"the name {name!r} has a line break", "Give it a name on one line")
    angles_deg = isb_from_thesis(motions.angles_deg) if isb else motions.angles_deg
    header = {"subject": subject, "motion": motion, SCAPULA_THROUGH: "AC"}
    if is_yes(motions, ESTIMATED).any():
        header[ESTIMATED] = "yes"
    if ORIGIN in motions.extra and len(set(motions.extra[ORIGIN])) == 1:
        header[ORIGIN] = " ".join(str(motions.extra[ORIGIN].iloc[0]).split())
    columns = {"time": motions.posture.astype(float), ELEVATION: motions.humerus_elevation_deg}
    columns |= dict(zip(ISB_ANGLES if isb else ANGLES, angles_deg.T, strict=True))
    return AngleTable(file, header, columns)


def _brought_to_ac(table: AngleTable, angles_deg: np.ndarray, labels: Labels) -> np.ndarray:
    """Convert the scapula's angles from AA to AC. Raise InputError if no rotation was chosen."""
    if labels.aa_to_ac is None:
        cause = "ISB's scapula frame goes through AA, the thesis's through AC, some 18 degrees apart"
        remedy = (
            f"Accept a mean rotation with --aa-to-ac kolz2020; if these angles are of a frame through AC, write "
            f"{SCAPULA_THROUGH}=AC in the header"
        )
        raise InputError(table.file, None, cause, remedy)
    scapula = ac_from_aa_deg(angles_deg[:, 3:], labels.aa_to_ac)
    return np.concatenate([angles_deg[:, :3], scapula], axis=1)


def _numbers(table: AngleTable) -> np.ndarray:
    """Return the numbers of the postures: from ``time`` in this project's own files, else 1, 2, 3, ..."""
    time = table.columns.get("time")
    if "motion" in table.header and time is not None and (time == np.round(time)).all():
        return time.astype(np.int64)
    return np.arange(1, table.count + 1)


def split(motions: Motions) -> list[Motions]:
    """Split the postures into one table for each motion of each subject, in the order of their first postures."""
    pairs = list(zip(motions.subject.tolist(), motions.motion.tolist(), strict=True))
    return [
        replace(motions.select(np.array([pair == one for pair in pairs])), rejected=()) for one in dict.fromkeys(pairs)
    ]
