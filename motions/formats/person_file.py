"""Measurements of persons: landmarks in one or more postures, and points on their bones, in the thorax frame."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from motions.checks.distances import FROM_IJ_MM
from motions.checks.trial import sound_landmarks
from motions.errors import InputError, listed
from motions.formats.any_file import labels_of_file, marker_groups, warn_of_unused
from motions.formats.marker_files.any_markers import read_markers
from motions.formats.text import numbers
from motions.landmarks.clusters.calibration import Calibration
from motions.landmarks.clusters.carried import carry
from motions.landmarks.estimated_landmarks import with_estimated_landmarks
from motions.landmarks.frames import humerus_angles, humerus_frame, thorax_frame, transposed
from motions.landmarks.girdle_angles import in_thorax
from motions.landmarks.mapping import THORAX, UNITS_MM, Mapping
from motions.landmarks.markers import Markers, landmarks_mm
from motions.landmarks.sampled_postures import Labels
from motions.motion_csv.cells import Side
from motions.motion_csv.columns import SIDE_MEASURED
from motions.motion_csv.posture_rows import MIRROR_POSITION
from motions.motion_csv.reading import read_motions
from motions.motion_csv.rows import CsvTable, Row, read_table
from motions.rotations import DEG, rotate

SURFACES = ("thorax", "humeral_head", "humeral_shaft", "sc_joint", "clavicle", "scapula")
"""Surfaces on which a point may lie (thesis 4.3.3, 4.3.5)."""


_MOST_NAMED = 10
"""Maximum number of postures in a message."""

_OPTIONS_THAT_ESTIMATE = {"SC": "from IJ with --sc-from-ij kaptein1999", "AC": "from AA with --aa-to-ac kolz2020"}


@dataclass(frozen=True, eq=False)
class PersonLandmarks:
    """Landmarks by posture and points by surface of one shoulder, as a right one, in the thorax frame, mm."""

    subject: str
    file: str
    side: Side
    landmarks_mm: dict[str, Float[np.ndarray, "3 postures"]]
    postures: tuple[str, ...]
    """Names of the postures: motion and number, as in the file."""
    elevation_deg: Float[np.ndarray, " postures"]
    """Elevation of the humerus in degrees; NaN where not measured."""
    estimated_landmarks: dict[str, str]
    """Estimated landmarks, and the source of each."""
    points_mm: dict[str, Float[np.ndarray, "3 points"]] = field(default_factory=dict)
    frames: "Frames | None" = None
    """Frame of the thorax in the file's own frame, per posture."""

    def in_thorax_mm(self, file_mm: Float[np.ndarray, "3 points"], posture: int = 0) -> Float[np.ndarray, "3 points"]:
        """Convert points from the frame of the landmarks in a posture to the thorax frame of a right shoulder."""
        assert self.frames is not None  # read_persons has set them
        return _moved(file_mm, np.full(file_mm.shape[1], posture), self.frames, self.side)

    def described(self, posture: int) -> str:
        """Write the name of a posture with its elevation of the arm."""
        height = self.elevation_deg[posture]
        return self.postures[posture] + ("" if np.isnan(height) else f", arm at {height:.0f} degrees")

    def named(self, posture: str) -> int:
        """Find a posture by its name, or by its number alone. Raise InputError if none or several have it."""
        found = [k for k, name in enumerate(self.postures) if posture in (name, name.rpartition(" ")[2])]
        if len(found) == 1:
            return found[0]
        cause = f"subject {self.subject!r} has {len(found) or 'no'} posture{'s' if found else ''} called {posture!r}"
        raise InputError(self.file, None, cause, f"Name one of {listed(self.postures, _MOST_NAMED)}")


def read_persons(
    path: Path, mapping: Mapping, labels: Labels, points: Path | None = None, calibration: Calibration | None = None
) -> tuple[list[PersonLandmarks], list[InputError]]:
    """Read the subjects in a file of positions or a motion file with landmarks, and the errors of those left out.

    - ``labels`` say how AC is estimated from AA, and SC from IJ, if they were not measured.
    - ``points``: a CSV file with the columns surface, x_mm, y_mm, z_mm (or _cm, _m) and optionally subject and posture,
      in the frame of the landmarks in that posture (by default the subject's first).
    - ``calibration``: calibration of clusters that carry landmarks.
    """
    markers = read_markers(path)
    if calibration is not None and markers is None:
        cause = "static trials calibrate clusters of markers, and this file has none"
        raise InputError(
            str(path), None, cause, "Leave out --static, or name a .c3d, .trc, .csv or .tsv file of markers"
        )
    table = None if points is None else read_table(points)
    found, rejected = [], []
    if markers is None:
        persons = _of_motion_file(path)
    else:
        persons = _of_markers(markers, mapping, labels_of_file(labels, path), calibration)
    for one in persons:
        if isinstance(one, InputError):
            rejected.append(one)
            continue
        try:
            found.append(_complete(*one, labels, points, table, mapping))
        except InputError as error:
            rejected.append(error)
    if not found:
        raise rejected[0]
    every = [name for name in ("SC", "AC") if all(name not in one.estimated_landmarks for one in found)]
    warn_of_unused(every, labels, str(path))
    return found, rejected


Frames = tuple[Float[np.ndarray, " 3 3 postures"], Float[np.ndarray, "3 postures"]]
"""R_file_thorax and position of IJ, per posture."""


def _of_markers(
    markers: Markers, mapping: Mapping, labels: Labels, calibration: Calibration | None
) -> Iterable[tuple[PersonLandmarks, Frames] | InputError]:
    lab_mm = landmarks_mm(markers, mapping) if calibration is None else carry(markers, mapping, calibration).lab_mm
    for rows, one in marker_groups(markers, labels):
        try:
            mine = sound_landmarks({name: xyz[:, rows] for name, xyz in lab_mm.items()}, one.subject, markers.file)
            thorax_mm = in_thorax(mine, one.side, markers.file)
        except InputError as error:
            yield error
            continue
        said = [[markers.rows[k][r] for k in ("motion", "posture") if k in markers.rows] for r in rows]
        names = tuple(" ".join(word for word in words if word) or str(k + 1) for k, words in enumerate(said))
        frames = thorax_frame(*(mine[name] for name in THORAX)), mine["IJ"]
        yield PersonLandmarks(one.subject, markers.file, one.side, thorax_mm, names, _elevation(thorax_mm), {}), frames


def _of_motion_file(path: Path) -> Iterable[tuple[PersonLandmarks, Frames] | InputError]:
    motions = read_motions(path)
    yield from motions.rejected
    for subject in motions.subjects:
        mine = motions.select(motions.subject == subject)
        known = {name: p.T for name, p in mine.landmarks_mm.items() if np.isfinite(p).all(axis=1).any()}
        if not {"TS", "AI"} <= set(known) or not {"AC", "AA"} & set(known):
            cause = f"subject {subject!r}: the motion file has no positions of TS, AI and AC (or AA)"
            remedy = "Give positions of landmarks: .c3d, .trc or CSV with columns such as TS_x_mm"
            yield InputError(str(path), None, cause, remedy)
            continue
        try:
            known = sound_landmarks(known, subject, str(path))
        except InputError as error:
            yield error
            continue
        left = SIDE_MEASURED in mine.extra and "left" in mine.extra[SIDE_MEASURED].tolist()
        names = tuple(f"{m} {p}" for m, p in zip(mine.motion, mine.posture, strict=True))
        count = len(names)
        frames = np.repeat(np.eye(3)[..., None], count, axis=2), np.zeros((3, count))
        side: Side = "left" if left else "right"
        yield PersonLandmarks(subject, str(path), side, known, names, mine.humerus_elevation_deg, {}), frames


def _elevation(thorax_mm: dict[str, np.ndarray]) -> Float[np.ndarray, " postures"]:
    if not all(name in thorax_mm for name in ("GH", "EM", "EL")):
        return np.full(thorax_mm["TS"].shape[1], np.nan)
    return humerus_angles(humerus_frame(*(thorax_mm[name] for name in ("GH", "EM", "EL"))))[1] * float(DEG)


def _complete(
    person: PersonLandmarks,
    frames: Frames,
    labels: Labels,
    points: Path | None,
    table: CsvTable | None,
    mapping: Mapping,
) -> PersonLandmarks:
    """Add the estimated landmarks SC and AC, and the points of the person. Raise InputError if SC or AC is missing."""
    placed, said = with_estimated_landmarks(person.landmarks_mm, labels.aa_to_ac, labels.sc_from_ij)
    for name, remedy in _OPTIONS_THAT_ESTIMATE.items():
        if name not in placed:
            cause = f"subject {person.subject!r}: {name} was not measured, and without it the clavicle has no length"
            raise InputError(person.file, None, cause, f"Measure {name}, or place it {remedy}")
    surfaces = {} if points is None or table is None else _points(points, table, person, frames, mapping)
    return replace(person, landmarks_mm=placed, estimated_landmarks=said, points_mm=surfaces, frames=frames)


def _points(
    path: Path, table: CsvTable, person: PersonLandmarks, frames: Frames, mapping: Mapping
) -> dict[str, Float[np.ndarray, "3 points"]]:
    """Read the subject's points by surface, in the thorax frame."""
    file = str(path)
    unit = next((u for u in UNITS_MM if all(f"{axis}_{u}" in table.columns for axis in "xyz")), None)
    if "surface" not in table.columns or unit is None:
        raise InputError(file, 1, "columns surface, x_mm, y_mm and z_mm are needed", f"Surfaces: {', '.join(SURFACES)}")
    rows = [row for row in table.rows if row.cells.get("subject", "").strip() in ("", person.subject)]
    for row in rows:
        check_surface(row.cells["surface"].strip(), file, row.line)
    cells = np.array([[row.cells[f"{axis}_{unit}"] for axis in "xyz"] for row in rows], dtype=object).reshape(-1, 3)
    file_mm = UNITS_MM[unit] * mapping.axes_matrix @ numbers(cells, [row.line for row in rows], file).T
    if np.isnan(file_mm).any():
        line = rows[int(np.argmax(np.isnan(file_mm).any(axis=0)))].line
        raise InputError(file, line, "a coordinate of the point is empty", "Give x, y and z of each point")
    posture = [_posture(row, person) for row in rows]
    thorax_mm = _moved(file_mm, np.array(posture, int), frames, person.side)
    which = np.array([row.cells["surface"].strip() for row in rows])
    found = {name: thorax_mm[:, which == name] for name in SURFACES if (which == name).any()}
    for name, points in found.items():
        _check_place(name, points, file, person.subject)
    return found


def _check_place(surface: str, points_mm: Float[np.ndarray, "3 points"], file: str, subject: str) -> None:
    """Raise InputError if points cannot be on a person, in mm and in the frame of the landmarks."""
    farthest, (least, most) = float(np.linalg.norm(points_mm, axis=0).max()), FROM_IJ_MM
    if surface != "sc_joint" and not least <= farthest <= most:
        cause = f"subject {subject!r}: the farthest point of {surface} is {farthest:.3g} mm from IJ"
        remedy = "Give mm, or call the columns x_cm or x_m, in the frame of the landmarks"
        raise InputError(file, None, cause, remedy)


def check_surface(surface: str, file: str, line: int | None = None) -> None:
    """Raise InputError if there is no such surface."""
    if surface not in SURFACES:
        raise InputError(file, line, f"there is no surface {surface!r}", f"Use one of {', '.join(SURFACES)}")


def _posture(row: Row, person: PersonLandmarks) -> int:
    name = row.cells.get("posture", "").strip()
    return person.named(name) if name else 0


def _moved(file_mm: np.ndarray, posture: Int[np.ndarray, " points"], frames: Frames, side: Side) -> np.ndarray:
    R_file_thorax, IJ = (part[..., posture] for part in frames)
    mirror = MIRROR_POSITION[:, None] if side == "left" else 1.0
    return mirror * np.asarray(rotate(transposed(R_file_thorax), file_mm - IJ))
