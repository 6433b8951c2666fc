"""Reading of any file that holds motions as a table of postures; its extension, and a CSV's columns, tell its kind."""

import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from motions.checks.at_rest import warn_of_subjects
from motions.errors import InputError, listed, warn_input
from motions.formats.angle_table import motions_from_table
from motions.formats.marker_files.any_markers import read_markers
from motions.formats.marker_files.export_table import read_head
from motions.formats.mot import read_mot
from motions.formats.spartacus import is_spartacus, read_spartacus
from motions.formats.text import is_number
from motions.landmarks.clusters.calibration import Calibration, calibrate
from motions.landmarks.clusters.carried import CarriedTrial, carry
from motions.landmarks.clusters.carried_columns import with_cluster, with_placed_gh
from motions.landmarks.estimated_landmarks import place_gh
from motions.landmarks.mapping import Mapping, read_mapping
from motions.landmarks.markers import Markers, landmarks_mm, marker_mm
from motions.landmarks.sampled_postures import BY_GLOBAL_Y, SCAPULA_ROTATED, Labels, postures_from_landmarks
from motions.motion_csv.cells import SIDES, Side
from motions.motion_csv.reading import read_motions
from motions.table import Motions

_MOST_NAMED = 20
"""Maximum number of columns in a message."""

_OF_ANGLES = (".mot", ".sto")

ARM = ("GH", "EM", "EL")
"""Landmarks that the elevation of the arm needs."""


def read_trial(
    path: str | os.PathLike[str],
    mapping: str | os.PathLike[str] | None = None,
    subject: str = "",
    motion: str = "",
    side: Side = "right",
    at_deg: Sequence[float] = (),
    static: Sequence[str | os.PathLike[str]] = (),
) -> Motions:
    """Read the postures of a trial of one subject (.c3d, .trc, .mot, .sto, .csv, .tsv), as ``girdle convert`` does.

    - ``mapping``: a TOML file with your names of markers and angles, and the unit.
    - ``subject``, ``motion``: names; by default those in the file, else the name of the file.
    - ``at_deg``: elevations of the arm at which the trial is sampled; without any, each frame is a posture.
    - ``static``: trials with palpated landmarks, which the clusters of the mapping carry into this trial.

    Raise InputError if the file cannot be read. Issue an InputWarning if its angles with the arm lowest are no
    person's.
    """
    at = elevations(at_deg)
    if at is None:
        cause = f"{at_deg!r} is not a list of elevations"
        raise InputError("at_deg", None, cause, "Give degrees from 0 to 180, as in at_deg=[30, 60, 90]")
    labels = Labels(subject, motion, _side(side, "side"), at)
    names = read_mapping(None if mapping is None else Path(mapping))
    return read_any(Path(path), names, labels, read_calibration([Path(one) for one in static], names, labels))


def elevations(at_deg: Iterable[float | str]) -> tuple[float, ...] | None:
    """Return elevations, each once, in ascending order; None where this is no list of numbers from 0 to 180."""
    if isinstance(at_deg, str) or not isinstance(at_deg, Iterable):
        return None
    try:
        found = tuple(sorted({float(at) for at in at_deg}))
    except (TypeError, ValueError):
        return None
    return found if all(0.0 <= at <= 180.0 for at in found) else None


def read_calibration(statics: Sequence[Path], mapping: Mapping, labels: Labels) -> Calibration | None:
    """Read static trials of one person; None without any. Raise InputError if they do not calibrate the clusters."""
    found = []
    for path in statics:
        markers = read_markers(path)
        if markers is None:
            cause = "a static trial holds positions of markers, and this file does not"
            raise InputError(str(path), None, cause, "Name a .c3d, .trc, .csv or .tsv file of markers")
        found.append(markers)
    return calibrate(found, mapping, labels.side, labels.gh_from_ac) if found else None


def read_any(path: Path, mapping: Mapping, labels: Labels, calibration: Calibration | None = None) -> Motions:
    """Read the postures in a file of any kind, or in a Spartacus checkout. Raise InputError if the kind is not known.

    If ``labels.subject`` or ``labels.motion`` is empty, the name in the file is used, else the name of the file.
    """
    if path.is_dir():
        if not is_spartacus(path):
            cause = "this folder is not a checkout of the Spartacus collection"
            raise InputError(str(path), None, cause, "Name files, or the folder of the checkout")
        _check_unused(labels, path, "shoulders and motions")
        return read_spartacus(path, labels)
    kind = path.suffix.lower()
    markers = read_markers(path)
    if markers is not None:
        return _of_markers(markers, mapping, labels_of_file(labels, path), calibration)
    if kind in _OF_ANGLES:
        motions = motions_from_table(read_mot(path), mapping, labels)
        _warn_of_unused_beside_angles(motions, mapping, labels, path, static=calibration is not None)
        return _checked(_with_names(motions, labels, path), path)
    if kind == ".csv":
        _check_columns(path)
        _check_unused(labels, path, "subjects, motions and postures")
        motions = read_motions(path)
        _warn_of_unused_beside_angles(motions, mapping, labels, path, static=calibration is not None)
        return motions
    if not path.exists():
        raise InputError(str(path), None, "there is no such file or folder", "Check its name")
    cause = f"files that end in {kind!r} are not known" if kind else "the name of the file has no ending"
    raise InputError(
        str(path), None, cause, "Known are .c3d, .trc, .mot, .sto, .csv, .tsv, .txt and a Spartacus checkout"
    )


def _check_columns(path: Path) -> None:
    """Raise InputError if no column is a motion file's: then a list of missing columns would not help."""
    columns = [column for column in read_head(path).columns() if column]
    if columns and not any(word in column.lower() for column in columns for word in ("clavicle", "scapula", "subject")):
        cause = f"the header has neither angles nor positions of markers, but {listed(columns, _MOST_NAMED)}"
        if all(is_number(column) for column in columns):
            cause = "there is no header: the first line has numbers and no names"
        remedy = (
            "Call columns IJ_x_mm, IJ_y_mm, ..., or give an export of Vicon, Motive, Qualisys or Visual3D, .c3d or .trc"
        )
        raise InputError(str(path), 1, cause, remedy)


def _check_unused(labels: Labels, path: Path, own: str) -> None:
    """Raise InputError for options that would change nothing, because the file has its own values."""
    if labels.subject or labels.motion or labels.at_deg or labels.side != "right":
        cause = f"it has its own {own}: --subject, --motion, --side and --at would change nothing"
        raise InputError(str(path), None, cause, "Leave them out")


def labels_of_file(labels: Labels, path: Path) -> Labels:
    """Fill empty labels with the name of the file, or, for the subject, of its folder if known."""
    return replace(labels, subject=labels.subject or labels.folder or path.stem, motion=labels.motion or path.stem)


def _with_names(motions: Motions, labels: Labels, path: Path) -> Motions:
    subject = np.where(motions.subject == "", labels.folder or path.stem, motions.subject)
    return replace(motions, subject=subject, motion=np.where(motions.motion == "", path.stem, motions.motion))


def _checked(motions: Motions, path: Path) -> Motions:
    warn_of_subjects(motions, str(path))
    return motions


def _of_markers(markers: Markers, mapping: Mapping, labels: Labels, calibration: Calibration | None) -> Motions:
    """Compute the postures of every subject in the file; a subject with wrong landmarks is left out and named."""
    labels = replace(labels, R_lab_global=mapping.R_lab_global)
    trial = None if calibration is None else carry(markers, mapping, calibration)
    lab_mm = landmarks_mm(markers, mapping) if trial is None else trial.lab_mm
    if "SC" not in lab_mm and labels.sc_from_ij is None:
        cause = "landmark SC was not found, so the angles of the clavicle stay empty"
        remedy = "Name its marker in a mapping file (--map), or place it with --sc-from-ij kaptein1999"
        warn_input(InputError(markers.file, None, cause, remedy))
    _warn_of_arm(lab_mm, labels, markers.file)
    _warn_of_unused_mapping(mapping, markers, static=trial is not None)
    if trial is None:  # with clusters, the options may place landmarks of the static trial
        warn_of_unused(lab_mm, labels, markers.file)
    parts, rejected = [], []
    for rows, one in marker_groups(markers, labels):
        mine = {name: xyz[:, rows] for name, xyz in lab_mm.items()}
        try:
            part = _of_shoulder(mine, one, trial, rows, markers.file)
        except InputError as error:
            rejected.append(error)
        else:
            parts.append(part if labels.at_deg else _with_rows(part, markers, rows))
    if not parts:
        raise rejected[0]
    return replace(Motions.concatenate(parts), rejected=tuple(rejected))


def _warn_of_arm(lab_mm: dict[str, np.ndarray], labels: Labels, file: str) -> None:
    """Issue an InputWarning if some, but not all, landmarks are there that the elevation of the arm needs."""
    absent = [name for name in ARM if name not in lab_mm and not (name == "GH" and labels.gh_from_ac)]
    if not absent or len(absent) == len(ARM):
        return
    found = [name for name in ARM if name in lab_mm]
    cause = f"of the arm there is {' and '.join(found)} but not {' and '.join(absent)}, so its elevation stays empty"
    remedy = "Name the marker in a mapping file (--map)"
    warn_input(InputError(file, None, cause, remedy + (", or place GH (--gh-from-ac)" if "GH" in absent else "")))


def warn_of_unused(measured: Collection[str], labels: Labels, file: str) -> None:
    """Warn of options that would place a landmark that was measured."""
    placed = {"AC": labels.aa_to_ac, "SC": labels.sc_from_ij, "GH": labels.gh_from_ac}
    for name, option in (("AC", "--aa-to-ac"), ("SC", "--sc-from-ij"), ("GH", "--gh-from-ac")):
        if placed[name] is not None and name in measured:
            cause = f"{name} was measured, so {option} changes nothing"
            warn_input(InputError(file, None, cause, f"Leave {option} out"))


def _warn_of_unused_beside_angles(
    motions: Motions, mapping: Mapping, labels: Labels, path: Path, *, static: bool
) -> None:
    """Warn of options and parts of the mapping that place or turn landmarks: a file of angles takes none.

    A mapping that names columns too is that of both kinds of file.
    """
    asked = {
        "--aa-to-ac": labels.aa_to_ac is not None and SCAPULA_ROTATED not in motions.extra,
        "--sc-from-ij": labels.sc_from_ij is not None,
        "--gh-from-ac": labels.gh_from_ac is not None,
        "--clavicle-z": labels.clavicle_z == BY_GLOBAL_Y,
        "--static": static,
    }
    if not (mapping.columns or mapping.scapula_relative_to):
        asked |= dict.fromkeys(_parts_of_landmarks(mapping), True)
    if unused := [name for name, is_there in asked.items() if is_there]:
        through = ", through AC" if "--aa-to-ac" in unused else ""
        cause = f"its angles are read as they are{through}, so {', '.join(unused)} changes nothing"
        warn_input(InputError(str(path), None, cause, "Leave it out"))


def _parts_of_landmarks(mapping: Mapping) -> list[str]:
    """List the parts of the mapping file that only files of landmarks use."""
    parts = {
        "unit": mapping.unit is not None,
        "axes": mapping.axes != Mapping().axes,
        "global": mapping.global_axes is not None,
        "[markers]": bool(mapping.markers),
        "[clusters]": bool(mapping.clusters),
    }
    return [name for name, is_there in parts.items() if is_there]


def _warn_of_unused_mapping(mapping: Mapping, markers: Markers, *, static: bool) -> None:
    """Warn of a mapping of angles alone, and of clusters that carry nothing and are not in the file.

    A static trial, converted by itself, has the markers of its clusters.
    """
    of_angles = {"scapula_relative_to": mapping.scapula_relative_to, "[columns]": mapping.columns}
    if (unused := [name for name, part in of_angles.items() if part]) and not _parts_of_landmarks(mapping):
        cause = f"it has landmarks and no angles, so {' and '.join(unused)} of the mapping changes nothing"
        warn_input(InputError(markers.file, None, cause, "Leave it out, or name the markers under [markers]"))
    names = [] if static else [name for names in mapping.clusters.values() for name in names]
    if absent := [name for name in names if marker_mm(markers, mapping, name, 1.0) is None]:
        cause = f"[clusters] carries nothing without --static, and marker {absent[0]} is not there"
        warn_input(InputError(markers.file, None, cause, "Name the static trial, or leave [clusters] out"))


def _of_shoulder(
    lab_mm: dict[str, np.ndarray], labels: Labels, trial: CarriedTrial | None, rows: np.ndarray, file: str
) -> Motions:
    """Compute the postures of one subject, with marks if a cluster carried the landmarks or GH is estimated."""
    offset = labels.gh_from_ac
    complete = lab_mm if offset is None else place_gh(lab_mm, offset, labels.side)
    part = postures_from_landmarks(complete, labels, file, trial is not None and "scapula" in trial.residuals_mm)
    if trial is not None:
        part = with_cluster(part, trial, rows, bool(labels.at_deg))
    if offset is None or ("GH" in lab_mm and (trial is None or not trial.calibration.gh_placed)):
        return part
    if "GH" not in complete:
        cause = f"{labels.subject}: GH cannot be placed, as AC was not measured"
        warn_input(InputError(file, None, cause, "Measure GH or AC"))
        return part
    return with_placed_gh(part, offset)


def marker_groups(markers: Markers, labels: Labels) -> list[tuple[np.ndarray, Labels]]:
    """Group the rows by subject and side, and for sampling also by motion; return rows and labels of each group.

    The values of a row in the file override the labels.
    """
    count = markers.positions.shape[2]
    said = {key: markers.rows.get(key, [""] * count) for key in ("subject", "motion", "side")}
    keys = ("subject", "side", "motion") if labels.at_deg else ("subject", "side")
    kinds = list(zip(*(said[key] for key in keys), strict=True))
    groups = []
    for kind in dict.fromkeys(kinds):
        words = {key: word for key, word in zip(keys, kind, strict=True) if word}
        words["side"] = _side(words.get("side", labels.side), markers.file)
        groups.append((np.array([k for k, other in enumerate(kinds) if other == kind]), replace(labels, **words)))
    return groups


def _side(word: str, file: str) -> Side:
    if word.lower() not in SIDES:
        raise InputError(file, None, f"side is {word!r}", "Write left or right")
    return SIDES[word.lower()]


def _with_rows(part: Motions, markers: Markers, rows: np.ndarray) -> Motions:
    """Give the postures the motions and numbers of their rows in the file, where it has them."""
    kept = rows[part.posture - 1]
    if "motion" in markers.rows:
        part = replace(part, motion=np.array([markers.rows["motion"][k] or part.motion[0] for k in kept]))
    if "posture" in markers.rows:
        part = replace(part, posture=np.array([_number(markers.rows["posture"][k], markers.file) for k in kept]))
    return part


def _number(text: str, file: str) -> int:
    try:
        return int(text)
    except ValueError:
        cause = f"posture is {text!r}, not a whole number"
        raise InputError(file, None, cause, "Number the postures of a motion 1, 2, 3, ...") from None
