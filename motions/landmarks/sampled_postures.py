"""Table of postures from landmarks: palpated postures unchanged, a trial sampled at chosen elevations of the arm."""

from collections.abc import Mapping as Dictionary
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from motions.checks.at_rest import HIGHEST_REST_DEG, Rest, doubt_of_rest, likely_swap, lowest_frames, unlike_rest
from motions.checks.trial import against_global, slipped, sound_landmarks, without_outliers
from motions.errors import InputError, warn_input
from motions.landmarks.acromion import AcromionRotation
from motions.landmarks.estimated_landmarks import GlenohumeralOffset, SternoclavicularOffset
from motions.landmarks.girdle_angles import CLAVICLE_X, FrameAngles, estimated_axial_deg, frame_angles
from motions.landmarks.mapping import THORAX
from motions.landmarks.resampling import resample_trial
from motions.motion_csv.cells import Side, landmarks_named, says_yes
from motions.motion_csv.columns import (
    ANGLES_FROM_LANDMARKS,
    CLAVICLE_PLACED,
    ESTIMATE_ZERO,
    ESTIMATED,
    SCAPULA_ROTATED,
    SIDE_MEASURED,
    SLIPPED,
)
from motions.table import ANGLES, FEWEST_ANGLES, Motions

_LOOK_FOR_GAPS = "Look for gaps in IJ, PX, C7, T8, AC, TS and AI"

THORAX_COLUMNS = ("thorax_x_deg", "thorax_y_deg", "thorax_z_deg")
"""Extra columns: backward tilt, torsion and lateral flexion of the thorax in the global frame (Appendix A), if the file
has a global frame."""

BY_GLOBAL_Y = "global"
"""Word for a clavicle with z axis normal to the global y."""

CLAVICLE_Z = ("thorax", BY_GLOBAL_Y)
"""Choices of the y axis to which the clavicle's z axis is normal with the arm lowest: the thorax's, with which the
axial rotation begins at 0, or the global y of Appendix A."""

CLAVICLE_Z_BY = "clavicle_z_by"
"""Extra column for a clavicle by the global y: states this choice and the axial rotation with the arm lowest."""

FRAMES = "frames"
"""Extra column: number of frames of the trial from which a posture was computed."""


def is_marked(motions: Motions, column: str, mark: str) -> Bool[np.ndarray, " postures"]:
    """Find the postures in which an extra column matches ``mark``, a regular expression; none without this column."""
    if column not in motions.extra:
        return np.zeros(len(motions.posture), bool)
    return motions.extra[column].str.contains(mark).to_numpy(bool)


def is_yes(motions: Motions, column: str) -> Bool[np.ndarray, " postures"]:
    """Find the postures in which an extra column says yes; none without this column."""
    if column not in motions.extra:
        return np.zeros(len(motions.posture), bool)
    return np.array([says_yes(str(cell)) is True for cell in motions.extra[column]], bool)


def marked_outliers(motions: Motions) -> dict[int, str]:
    """Return the landmarks marked as outliers, by row, separated by spaces."""
    marks = motions.extra[SLIPPED].to_numpy(str) if SLIPPED in motions.extra else ()
    by_row = {row: " ".join(landmarks_named(cell)) for row, cell in enumerate(marks)}
    return {row: names for row, names in by_row.items() if names}


def measured_places_mm(motions: Motions) -> dict[str, Float[np.ndarray, "3 postures"]]:
    """Return the measured positions by landmark, thorax frame; NaN where not measured, estimated or an outlier."""
    found = {name: np.array(place.T) for name, place in motions.landmarks_mm.items()}
    for name, place in found.items():
        place[:, is_marked(motions, CLAVICLE_PLACED, f"{name} from")] = np.nan
    for row, names in marked_outliers(motions).items():
        for name in filter(found.__contains__, names.split()):
            found[name][:, row] = np.nan
    return found


def spread_column(angle: str) -> str:
    """Return the name of the extra column with the spread of an angle about a posture of a trial (SD, degrees)."""
    return f"{angle}_spread_deg"


@dataclass(frozen=True)
class Labels:
    """Subject and motion of a trial, and options for the conversion of its frames to postures."""

    subject: str
    motion: str
    side: Side = "right"
    at_deg: tuple[float, ...] = ()
    """Elevations at which a trial is sampled; if empty, each frame is a posture."""
    aa_to_ac: AcromionRotation | None = None
    aa_to_ac_name: str = ""
    sc_from_ij: SternoclavicularOffset | None = None
    gh_from_ac: GlenohumeralOffset | None = None
    R_lab_global: Float[np.ndarray, "3 3"] | None = None
    """The global frame, if the mapping states it."""
    clavicle_z: str = CLAVICLE_Z[0]
    """Choice of the clavicle's z axis, one of CLAVICLE_Z."""
    folder: str = ""
    """Name of the subject by the file's folder, if neither the file nor ``subject`` states the subject."""

    @property
    def scapula_rotated(self) -> str:
        """Text for the column SCAPULA_ROTATED; empty without a rotation."""
        rotation = self.aa_to_ac
        return f"AA brought to AC by {self.aa_to_ac_name} +- {rotation.uncertainty_deg:g} deg" if rotation else ""


def postures_from_landmarks(
    lab_mm: Dictionary[str, Float[np.ndarray, "3 frames"]], labels: Labels, file: str, carried: bool = False
) -> Motions:
    """Compute the postures of one subject, numbered from 1 in the order of the frames.

    ``lab_mm``: landmarks in any right-handed frame. The clavicle's axial rotation is estimated relative to the frames
    of the whole trial with the arm lowest (the first frame if the humerus was not measured), and marked as an estimate.
    Postures with too few angles are left out. ``carried``: True where a cluster carried the scapula; its distances to
    SC change with the skin, so landmark outliers are not searched.
    InputError if no posture is left, or if distances between landmarks are no person's. InputWarning where landmarks
    are left out (``motions.checks.trial``), and where the angles with the arm lowest are unlike a person's at rest.
    """
    sound_mm = sound_landmarks(lab_mm, f"{labels.subject}, {labels.motion}", file)
    outliers = {} if carried else slipped(sound_mm)
    if labels.at_deg:
        sound_mm = without_outliers(sound_mm, outliers, f"{labels.subject}, {labels.motion}", file)
    frames = _frames(sound_mm, labels, file)
    rest = lowest_frames(frames.angles_deg, frames.humerus_deg[:, 1])
    _check_rest(sound_mm, frames, rest, labels, file)
    if turned := against_global(frames.thorax_deg):
        warn_input(InputError(file, None, f"{labels.subject}, {labels.motion}: {turned[0]}", turned[1]))
    angles_deg, begins_deg = frames.angles_deg.copy(), _axial_at_rest_deg(frames, rest, labels, file)
    angles_deg[:, CLAVICLE_X] = estimated_axial_deg(angles_deg, rest.angles_deg, begins_deg)
    frames = replace(frames, angles_deg=angles_deg)
    table = _sampled(frames, labels, file) if labels.at_deg else _as_they_are(frames, labels)
    table = _with_marks(table, frames.estimated_landmarks, rest.elevation_deg)
    if labels.clavicle_z == BY_GLOBAL_Y:
        said = f"global y: axial rotation begins at {begins_deg:.1f} deg, by the thorax's y at 0"
        table = replace(table, extra=table.extra.assign(**{CLAVICLE_Z_BY: [said] * len(table.posture)}))
    if outliers and not labels.at_deg:
        table = replace(table, extra=table.extra.assign(**{SLIPPED: _marks(outliers, len(table.posture))}))
    measured = np.sum(np.isfinite(table.angles_deg), axis=1) >= FEWEST_ANGLES
    if not measured.any():
        cause = f"no posture has {FEWEST_ANGLES} angles: landmarks are missing in every one"
        raise InputError(file, None, cause, _LOOK_FOR_GAPS)
    if not measured.all():
        which = f"{np.sum(~measured)} of {len(measured)} postures are left out"
        if labels.at_deg:
            which += f", at {', '.join(f'{at:g}' for at in table.humerus_elevation_deg[~measured])} degrees"
        cause = f"{labels.subject}, {labels.motion}: {which}: fewer than {FEWEST_ANGLES} angles are known there"
        gaps = [] if labels.at_deg else _gaps(sound_mm, ~measured)
        remedy = f"They have gaps in {', '.join(gaps)}" if gaps else _LOOK_FOR_GAPS
        warn_input(InputError(file, None, cause, remedy))
    return table.select(measured)


def _axial_at_rest_deg(frames: FrameAngles, rest: Rest, labels: Labels, file: str) -> float:
    """Compute the axial rotation with the arm lowest. InputError if it needs the global frame, which is not known."""
    if labels.clavicle_z != BY_GLOBAL_Y:
        return 0.0
    if labels.R_lab_global is None:
        cause = "the clavicle's z axis by the global y needs the global frame, and the file does not say it"
        raise InputError(
            file, None, cause, 'Write global = ["x", "z", "-y"], right, up and back, in the mapping (--map)'
        )
    return float(np.median(frames.global_axial_deg[rest.rows]))


def _frames(lab_mm: dict[str, Float[np.ndarray, "3 frames"]], labels: Labels, file: str) -> FrameAngles:
    return frame_angles(lab_mm, labels.side, file, labels.aa_to_ac, labels.sc_from_ij, labels.R_lab_global)


def _check_rest(
    lab_mm: dict[str, Float[np.ndarray, "3 frames"]], frames: FrameAngles, rest: Rest, labels: Labels, file: str
) -> None:
    """Warn if the angles with the arm lowest are unlike a person's at rest, and name landmarks that may be swapped."""

    def unlike_with(exchanged: dict[str, Float[np.ndarray, "3 frames"]]) -> list[str]:
        other = _frames(exchanged, labels, file)
        lowest = lowest_frames(other.angles_deg, other.humerus_deg[:, 1])
        if lowest.elevation_deg > max(rest.elevation_deg, HIGHEST_REST_DEG):
            return ["the arm is never low"]  # the angles at rest are then unknown
        return unlike_rest(lowest, other.landmarks_mm)

    if unlike := unlike_rest(rest, frames.landmarks_mm):
        swap = likely_swap(lab_mm, unlike_with)
        warn_input(doubt_of_rest(file, f"{labels.subject}, {labels.motion}", rest, unlike, swap))


def _with_marks(table: Motions, placed: Dictionary[str, str], zero_at_deg: float) -> Motions:
    """Add the columns that mark angles as estimates or as computed from landmarks, and estimated landmarks."""
    count, extra = len(table.posture), table.extra.copy()
    estimated = np.isfinite(table.angles_deg[:, CLAVICLE_X])
    extra[ANGLES_FROM_LANDMARKS] = ["yes"] * count
    extra[ESTIMATED] = np.where(estimated, "yes", "")
    extra[ESTIMATE_ZERO] = np.where(estimated & np.isfinite(zero_at_deg), f"{zero_at_deg:.1f}", "")
    if placed:
        extra[CLAVICLE_PLACED] = ["; ".join(f"{name} {said}" for name, said in placed.items())] * count
    return replace(table, extra=extra)


def _gaps(lab_mm: Dictionary[str, Float[np.ndarray, "3 frames"]], frames: Bool[np.ndarray, " frames"]) -> list[str]:
    """List the landmarks, of those that the angles need, that are missing in some of these frames."""
    names = (*THORAX, "SC", "AC", "TS", "AI")
    return [name for name in names if name in lab_mm and np.isnan(lab_mm[name][:, frames]).any()]


def _marks(outliers: Dictionary[str, Sequence[int]], count: int) -> list[str]:
    """Return the landmark outliers of each posture, separated by spaces."""
    return [" ".join(name for name, rows in outliers.items() if row in rows) for row in range(count)]


def _as_they_are(frames: FrameAngles, labels: Labels) -> Motions:
    """Return a table in which each frame is a posture."""
    extra = _thorax_columns(frames.thorax_deg, labels)
    return _table(labels, frames.humerus_deg[:, 1], frames.angles_deg, frames.landmarks_mm, extra)


def _thorax_columns(thorax_deg: Float[np.ndarray, "postures 3"], labels: Labels) -> dict[str, list[str]]:
    """Return the columns of the thorax, if the global frame is known."""
    if labels.R_lab_global is None:
        return {}
    return {column: _texts(one) for column, one in zip(THORAX_COLUMNS, thorax_deg.T, strict=True)}


def _sampled(frames: FrameAngles, labels: Labels, file: str) -> Motions:
    """Sample the trial at the chosen elevations."""
    elevation_deg = frames.humerus_deg[:, 1]
    if not np.isfinite(elevation_deg).any():
        cause = "the humerus was not measured (GH, EM and EL), so there are no elevations to sample at"
        remedy = "Name these markers in a mapping file (--map), or leave out --at: then each frame is a posture"
        raise InputError(file, None, cause, remedy)
    positions = list(frames.landmarks_mm.values())
    thorax = [] if labels.R_lab_global is None else [frames.thorax_deg]
    values = np.concatenate([frames.angles_deg, *positions, *thorax], axis=1)
    whose = f"{labels.subject}, {labels.motion}"
    sampled = resample_trial(elevation_deg, values, np.array(labels.at_deg), file, whose)
    landmarks_mm = {
        name: _whole(sampled.values[:, 6 + 3 * place : 9 + 3 * place]) for place, name in enumerate(frames.landmarks_mm)
    }
    extra = {spread_column(angle): _texts(sampled.spread[:, place]) for place, angle in enumerate(ANGLES)}
    extra |= _thorax_columns(sampled.values[:, -3:], labels)
    extra[FRAMES] = [str(count) for count in sampled.frames.tolist()]
    return _table(labels, sampled.at_deg, sampled.values[:, :6], landmarks_mm, extra)


def _table(
    labels: Labels,
    elevation_deg: Float[np.ndarray, " postures"],
    angles_deg: Float[np.ndarray, "postures 6"],
    landmarks_mm: dict[str, Float[np.ndarray, "postures 3"]],
    extra: Dictionary[str, Sequence[str]],
) -> Motions:
    count = len(elevation_deg)
    extra = dict(extra)
    if labels.aa_to_ac is not None and "AC" not in landmarks_mm:
        extra[SCAPULA_ROTATED] = [labels.scapula_rotated] * count
    if labels.side == "left":
        extra[SIDE_MEASURED] = ["left"] * count
    return Motions(
        subject=np.array([labels.subject] * count),
        motion=np.array([labels.motion] * count),
        posture=np.arange(1, count + 1),
        humerus_elevation_deg=elevation_deg,
        angles_deg=angles_deg,
        landmarks_mm=landmarks_mm,
        extra=pd.DataFrame(extra, index=pd.RangeIndex(count), dtype=str),
    )


def _whole(position_mm: Float[np.ndarray, "postures 3"]) -> Float[np.ndarray, "postures 3"]:
    """Set positions with a missing coordinate to NaN."""
    return np.where(np.isnan(position_mm).any(axis=1, keepdims=True), np.nan, position_mm)


def _texts(values: Float[np.ndarray, " postures"]) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.4g}" for value in values]
