"""Checkout of Spartacus, the public collection of measured shoulder kinematics (doi 10.5281/zenodo.11455521).

``spartacus/dataset/dataset_of_datasets.csv`` has one row per study, with the axes of its bones' frames in words.
``dataset_clean_of_joint_data.csv`` has one row per joint, motion and shoulder, with the sequence of angles and the
names of three files in ``spartacus/data/FOLDER``. These have two columns without names: angle of the arm, angle of the
bone (degrees).

Only studies of clavicle and scapula against an anatomical thorax in ISB's axes and sequence yx'z'' are read. Known
errors of the collection are treated as follows:

- The collection applies its matrix of Kolz 2020 from AC to AA transposed: the matrix is not used here, see
  ``motions.landmarks.acromion``.
- Moissenet's files of upward rotation have the opposite sign of ISB's beta, and ``corrections.csv`` turns only the
  elevations round, not horizontal flexion and axial rotation: the sign is turned round here in every motion.
- The columns of clavicular protraction and elevation are swapped for Matsuki: an angle is known here by the name of its
  file, not by its column. (Matsuki's thorax is the imaging frame, its scapula goes through the glenoid: left out.)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from motions.errors import InputError
from motions.files import read_text
from motions.formats.isb import ISB_ANGLES, thesis_from_isb
from motions.formats.text import numbers
from motions.landmarks.acromion import ac_from_aa_deg
from motions.landmarks.resampling import resample
from motions.landmarks.sampled_postures import SCAPULA_ROTATED, Labels
from motions.motion_csv.columns import SIDE_MEASURED
from motions.motion_csv.rows import Row, read_table
from motions.table import Motions

_STUDIES = Path("spartacus", "dataset", "dataset_of_datasets.csv")
_JOINTS = Path("spartacus", "dataset", "dataset_clean_of_joint_data.csv")
_DATA = Path("spartacus", "data")

_COLUMNS_OF_STUDY = (
    *("dataset_id", "dataset_authors", "dataset_year"),
    *("thorax_y_direction", "scapula_z_direction", "side_as_right"),
)
_ANGLES_OF = ("dof_1st_euler", "dof_2nd_euler", "dof_3rd_euler")
_COLUMNS_OF_JOINT = (
    "dataset_id",
    "humeral_motion",
    "joint",
    "euler_sequence",
    "shoulder_id",
    "side",
    "folder",
    *_ANGLES_OF,
)
"""Columns that are read."""

_SEQUENCE = "yx'z''"
_THORAX_Y = "vec((T8+PX)/2>(C7+IJ)/2)"
_SCAPULA_Z = {"vec(TS>AC)": "AC", "vec(TS>AA)": "AA"}
_JOINT_OF = {"sternoclavicular": "SC", "scapulothoracic": "ST"}

_FILES = {
    "clavicle_alpha": "SC_protraction",
    "clavicle_beta": "SC_elevation",
    "clavicle_gamma": "SC_rotation",
    "scapula_alpha": "ST_protraction",
    "scapula_beta": "ST_medRotation",
    "scapula_gamma": "ST_tilt",
}
"""Beginning of the file names of each angle."""

_MOTIONS = {
    "frontal plane elevation": ("frontal_elevation", None),
    "scapular plane elevation": ("scapular_elevation", None),
    "sagittal plane elevation": ("sagittal_elevation", None),
    "horizontal flexion": ("horizontal_flexion", 90.0),
    "internal-external rotation 0 degree-abducted": ("axial_rotation", 0.0),
    "internal-external rotation 90 degree-abducted": ("axial_rotation_90", 90.0),
}
"""Name of each motion here, and elevation of the arm in it; None if the first column of the files is the elevation."""

_TURNED_ROUND = ("#14_Moissenet_et_al", "ST_medRotation")
"""Folder, and beginning of the file names, of an angle with the opposite sign of ISB's."""

STEP_DEG = 10.0
"""Step in degrees: postures are at its multiples that all files of a motion reach, as in the studies' own tables."""


@dataclass(frozen=True)
class _Curve:
    """Angle of a bone over the angle of the arm, in degrees."""

    arm_deg: Float[np.ndarray, " rows"]
    angle_deg: Float[np.ndarray, " rows"]

    def at(self, arm_deg: Float[np.ndarray, " grid"]) -> Float[np.ndarray, " grid"]:
        """Sample the curve: smooth a dense one as a trial, such as 1500 rows of a recorded motion, else interpolate."""
        if len(self.arm_deg) > 20 * len(arm_deg):
            sampled = resample(self.arm_deg, self.angle_deg[:, None], arm_deg)
            return np.interp(arm_deg, sampled.at_deg, sampled.values[:, 0])
        order = np.argsort(self.arm_deg)
        return np.interp(arm_deg, self.arm_deg[order], self.angle_deg[order])


def is_spartacus(folder: Path) -> bool:
    """Check whether the folder is a checkout of the collection."""
    return (folder / _STUDIES).is_file() and (folder / _JOINTS).is_file()


def read_spartacus(folder: Path, labels: Labels) -> Motions:
    """Read all shoulders of the collection whose clavicle and scapula this project's frames can express, as right ones.

    Scapulae through AA need ``labels.aa_to_ac``. Studies and shoulders that cannot be used are named in ``rejected``.
    Raise InputError if none can be used.
    """
    joints: dict[str, list[Row]] = {}
    for row in read_table(folder / _JOINTS, _has(_COLUMNS_OF_JOINT)).rows:
        joints.setdefault(row.cells["dataset_id"].strip(), []).append(row)
    parts, rejected = [], []
    for study in read_table(folder / _STUDIES, _has(_COLUMNS_OF_STUDY)).rows:
        rows = joints.get(study.cells["dataset_id"].strip(), [])
        try:
            through = _scapula_landmark(study, rows)
            if through == "AA" and labels.aa_to_ac is None:
                remedy = "Accept a mean rotation with --aa-to-ac kolz2020"
                raise _left_out(study, "its scapula frame goes through AA, not AC", remedy)
        except InputError as error:
            rejected.append(error)
            continue
        for shoulder in dict.fromkeys(row.cells["shoulder_id"] for row in rows):
            try:
                mine = [row for row in rows if row.cells["shoulder_id"] == shoulder]
                parts.append(_shoulder(folder, study, mine, through, labels))
            except InputError as error:
                rejected.append(error)
    if not parts:
        raise (
            rejected[0] if rejected else InputError(str(folder), None, "it has no studies", "Check out the collection")
        )
    joined = Motions.concatenate(parts)
    return Motions(**{**vars(joined), "rejected": tuple(rejected)})


def _has(names: Sequence[str]) -> Callable[[list[str], str, int], None]:
    """Make a check that a table has each of these columns exactly once."""

    def check(columns: list[str], file: str, line: int) -> None:
        wrong = [name for name in names if columns.count(name) != 1]
        if wrong:
            raise InputError(file, line, f"there is not one column {' and one '.join(wrong)}", "Check it out again")

    return check


def _left_out(study: Row, why: str, remedy: str) -> InputError:
    return InputError(study.file, study.line, f"{study.cells['dataset_authors']}: {why}", remedy)


def _scapula_landmark(study: Row, rows: list[Row]) -> str:
    """Return the landmark, AC or AA, of the study's scapula frame. Raise InputError for other frames or angles."""
    remedy = "Only studies in ISB's axes and sequence, with clavicle and scapula against the thorax, are read"
    through = _SCAPULA_Z.get(study.cells["scapula_z_direction"].strip())
    if study.cells["thorax_y_direction"].strip() != _THORAX_Y or through is None:
        raise _left_out(study, "the frame of its thorax or scapula is another one", remedy)
    for joint in _JOINT_OF:
        sequences = {row.cells["euler_sequence"].strip() for row in rows if row.cells["joint"].strip() == joint}
        if sequences != {_SEQUENCE}:
            said = " and ".join(sorted(sequences)) or "no angles"
            raise _left_out(study, f"{joint}: {said} instead of {_SEQUENCE}", remedy)
    if study.cells["side_as_right"].strip() != "True":
        raise _left_out(study, "its left shoulders are not written as right ones", remedy)
    return through


def _shoulder(folder: Path, study: Row, rows: list[Row], through: str, labels: Labels) -> Motions:
    """Read all motions of one shoulder in which both bones were measured."""
    first = study.cells["dataset_authors"].split()[:1] or ["unknown"]
    name = first[0].lower() + study.cells["dataset_year"].strip()
    number = rows[0].cells["shoulder_id"].strip()
    subject = f"{name}_{number.removesuffix('.0') or 'mean'}"
    side = rows[0].cells["side"].strip()
    parts = []
    for words, (motion, elevation_deg) in _MOTIONS.items():
        files = _files(folder, [row for row in rows if row.cells["humeral_motion"].strip() == words])
        if not set(ISB_ANGLES) <= set(files):
            continue
        arm_deg, isb_deg = _sampled(files, folder)
        if elevation_deg is None and abs(arm_deg[0]) > abs(arm_deg[-1]):  # ISB's elevation is negative
            arm_deg, isb_deg = arm_deg[::-1], isb_deg[::-1]
        if elevation_deg is None and isb_deg[-1, 4] > isb_deg[0, 4]:
            cause = f"{subject}, {motion}: the scapula rotates medially while the arm is raised"
            raise InputError(str(folder), None, cause, "Check the signs of its upward rotation")
        parts.append(_table(subject, motion, arm_deg, elevation_deg, isb_deg, side, through, labels))
    if not parts:
        raise _left_out(study, f"shoulder {number}: no motion with all six angles", "It cannot be read")
    return Motions.concatenate(parts)


def _files(folder: Path, rows: list[Row]) -> dict[str, _Curve]:
    """Read the curves of a motion, by ISB's names of their angles, which the names of their files tell."""
    curves = {}
    for row in rows:
        if row.cells["joint"].strip() not in _JOINT_OF:
            continue
        data = folder / _DATA / row.cells["folder"].strip()
        signs = _corrections(data)
        for column in _ANGLES_OF:
            name = row.cells[column].strip()
            angle = next((angle for angle, start in _FILES.items() if name.lower().startswith(start.lower())), None)
            if angle is None:
                continue
            turned = row.cells["folder"].strip() == _TURNED_ROUND[0] and name.startswith(_TURNED_ROUND[1])
            curves[angle] = _curve(data / name, -1.0 if turned else signs.get(name, 1.0))
    return curves


def _corrections(data: Path) -> dict[str, float]:
    """Read the factors by which the collection itself multiplies some files, from ``corrections.csv``."""
    path = data / "corrections.csv"
    if not path.is_file():
        return {}
    lines = [line.rpartition(",") for line in read_text(path, "Check it out again").splitlines() if line.strip()]
    factors = numbers(np.array([[factor] for _, _, factor in lines]), range(1, len(lines) + 1), str(path))
    return {name.strip(): float(factor) for (name, _, _), factor in zip(lines, factors[:, 0], strict=True)}


def _curve(path: Path, sign: float) -> _Curve:
    rows = [line.split(",") for line in read_text(path, "Check it out again").splitlines() if line.strip()]
    if any(len(row) != 2 for row in rows) or not rows:
        raise InputError(str(path), None, "the file has not two columns", "Check it out again")
    table = numbers(np.array(rows), range(1, len(rows) + 1), str(path))
    table = table[np.isfinite(table).all(axis=1)]
    if not len(table):
        raise InputError(str(path), None, "no row of the file has both numbers", "Check it out again")
    return _Curve(table[:, 0], sign * table[:, 1])


def _sampled(files: dict[str, _Curve], folder: Path):
    """Sample ISB_ANGLES in degrees at the multiples of STEP_DEG of the arm's angle that all files reach."""
    low = max(float(curve.arm_deg.min()) for curve in files.values())
    high = min(float(curve.arm_deg.max()) for curve in files.values())
    arm_deg = STEP_DEG * np.arange(np.ceil(low / STEP_DEG - 1e-9), np.floor(high / STEP_DEG + 1e-9) + 1)
    if len(arm_deg) < 2:
        cause = f"the files of a motion have only {low:.0f} to {high:.0f} degrees of the arm in common"
        raise InputError(str(folder), None, cause, "It cannot be read")
    return arm_deg, np.stack([files[angle].at(arm_deg) for angle in ISB_ANGLES], axis=1)


def _table(
    subject: str,
    motion: str,
    arm_deg: Float[np.ndarray, " postures"],
    elevation_deg: float | None,
    isb_deg: Float[np.ndarray, "postures 6"],
    side: str,
    through: str,
    labels: Labels,
) -> Motions:
    count = len(arm_deg)
    angles_deg = thesis_from_isb(isb_deg)
    extra = {"motion_angle_deg": [f"{abs(angle) if elevation_deg is None else angle:g}" for angle in arm_deg]}
    if through == "AA" and labels.aa_to_ac is not None:
        angles_deg = np.concatenate([angles_deg[:, :3], ac_from_aa_deg(angles_deg[:, 3:], labels.aa_to_ac)], axis=1)
        extra[SCAPULA_ROTATED] = [labels.scapula_rotated] * count
    extra[SIDE_MEASURED] = [side] * count
    return Motions(
        subject=np.array([subject] * count),
        motion=np.array([motion] * count),
        posture=np.arange(1, count + 1),
        humerus_elevation_deg=np.abs(arm_deg) if elevation_deg is None else np.full(count, elevation_deg),
        angles_deg=angles_deg,
        landmarks_mm={},
        extra=pd.DataFrame(extra, index=pd.RangeIndex(count), dtype=str),
    )
