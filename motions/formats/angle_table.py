"""Postures as a table of angles for .mot and .sto, and back."""

from dataclasses import replace

import numpy as np
import pandas as pd

from motions.errors import InputError
from motions.formats.isb import ISB_ANGLES, isb_from_thesis, thesis_from_isb
from motions.formats.mot import AngleTable
from motions.landmarks.acromion import ac_from_aa_deg
from motions.landmarks.mapping import Mapping
from motions.landmarks.resampling import resample_trial
from motions.landmarks.sampled_postures import ESTIMATED, FRAMES, SCAPULA_ROTATED, Labels, is_marked, spread_column
from motions.motion_csv.cells import ELEVATION_REMEDY
from motions.motion_csv.columns import SIDE_MEASURED
from motions.motion_csv.posture_rows import MIRROR_ANGLES
from motions.table import ANGLES, FEWEST_ANGLES, Motions

ELEVATION = "humerus_elevation"
SCAPULA_THROUGH = "scapula_through"
"""The line of the header that names the scapula's landmark, AC or AA, which ISB's names of the angles do not say."""
ORIGIN = "origin"
"""The line of the header, and the extra column, that says of simulated motions that they are."""


def motions_from_table(table: AngleTable, mapping: Mapping, labels: Labels) -> Motions:
    """Take the postures from the rows of a file, or at `labels.at_deg`. A left shoulder is mirrored.

    The columns are ANGLES or, in ISB's sequence, ISB_ANGLES, and humerus_elevation, or what the mapping calls them.
    ISB's scapula goes through AA, if the header does not say AC. InputError if no bone is there or AA stays AA.
    """
    isb = any(mapping.column(name) in table.columns for name in ISB_ANGLES)
    names = ISB_ANGLES if isb else ANGLES
    missing = np.full(table.count, np.nan)
    angles_deg = np.stack([table.columns.get(mapping.column(name), missing) for name in names], axis=1)
    if np.isnan(angles_deg).all():
        cause = f"none of the columns {', '.join(mapping.column(name) for name in names)} is there"
        remedy = f"Name them in a mapping file (--map), under [columns]; the file has {', '.join(table.columns)}"
        raise InputError(table.file, None, cause, remedy)
    if isb:
        angles_deg = thesis_from_isb(angles_deg)
    if labels.side == "left":
        angles_deg = angles_deg * MIRROR_ANGLES
    through = table.header.get(SCAPULA_THROUGH) or ("AA" if isb else "AC")
    if through != "AC":
        angles_deg = _brought_to_ac(table, angles_deg, labels)
    elevation_deg = table.columns.get(mapping.column(ELEVATION), missing)
    if (elevation_deg < 0.0).any():  # NaN is not
        cause = f"{mapping.column(ELEVATION)} is {np.nanmin(elevation_deg):g}, below 0"
        raise InputError(table.file, None, cause, ELEVATION_REMEDY)
    numbers, extra = _numbers(table), {}
    if labels.at_deg:
        whose = mapping.column(ELEVATION)
        sampled = resample_trial(elevation_deg, angles_deg, np.array(labels.at_deg), table.file, whose)
        angles_deg, elevation_deg = sampled.values, sampled.at_deg
        numbers = np.arange(1, len(elevation_deg) + 1)
        extra = {spread_column(angle): [f"{x:.4g}" for x in sampled.spread[:, k]] for k, angle in enumerate(ANGLES)}
        extra[FRAMES] = [str(count) for count in sampled.frames.tolist()]
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
    return motions.select(np.sum(np.isfinite(angles_deg), axis=1) >= FEWEST_ANGLES)


def table_from_motions(motions: Motions, isb: bool, file: str) -> AngleTable:
    """Lay out the postures of one motion of one subject as columns, degrees; time is the number of the posture.

    The columns are elevation and the six ANGLES, or ISB_ANGLES: the same rotations under ISB's names, the
    scapula still through AC.
    """
    subject, motion = str(motions.subject[0]), str(motions.motion[0])
    for name in (subject, motion):
        if "\n" in name or "\r" in name:
            raise InputError(file, None, f"the name {name!r} has a line break", "Give it a name on one line")
    angles_deg = isb_from_thesis(motions.angles_deg) if isb else motions.angles_deg
    header = {"subject": subject, "motion": motion, SCAPULA_THROUGH: "AC"}
    if is_marked(motions, ESTIMATED, "yes").any():
        header[ESTIMATED] = "yes"
    if ORIGIN in motions.extra and len(set(motions.extra[ORIGIN])) == 1:
        header[ORIGIN] = " ".join(str(motions.extra[ORIGIN].iloc[0]).split())
    columns = {"time": motions.posture.astype(float), ELEVATION: motions.humerus_elevation_deg}
    columns |= dict(zip(ISB_ANGLES if isb else ANGLES, angles_deg.T, strict=True))
    return AngleTable(file, header, columns)


def _brought_to_ac(table: AngleTable, angles_deg: np.ndarray, labels: Labels) -> np.ndarray:
    """The angles with the scapula through AC instead of AA."""
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
    """Numbers of the postures: those of this project's own files, else 1, 2, 3, ..."""
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
