"""Landmarks, or any named points of bones, in a file: by subject and posture, in the file's own frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError
from motions.formats.any_file import labels_of_file, marker_groups
from motions.formats.marker_files.any_markers import read_markers
from motions.formats.named_points import read_landmarks
from motions.landmarks.mapping import Mapping
from motions.landmarks.markers import Markers, landmarks_there_mm, millimetres
from motions.landmarks.sampled_postures import Labels
from motions.motion_csv.rows import read_table


@dataclass(frozen=True)
class LandmarkSet:
    """Points of one subject, in a right-handed frame, mm; NaN where not measured."""

    subject: str
    points_mm: dict[str, Float[np.ndarray, "3 postures"]]
    postures: tuple[str, ...]

    def mean_mm(self) -> dict[str, Float[np.ndarray, "3"]]:
        """Return the position of each point in the only posture. Raise ValueError if there are several postures."""
        if len(self.postures) > 1:
            raise ValueError(f"it has {len(self.postures)} postures")
        return {name: place[:, 0] for name, place in self.points_mm.items() if np.isfinite(place[:, 0]).all()}


def read_landmark_sets(path: Path, mapping: Mapping) -> list[LandmarkSet]:
    """Read the points of every subject from a file of markers, or a CSV with the columns landmark, x_mm, y_mm, z_mm.

    A file of markers gives the landmarks of Appendix A under their names here (``mapping``); if it has none, all
    markers under the file's names. Raise InputError if the file holds neither.
    """
    if path.suffix.lower() == ".csv" and "landmark" in read_table(path).columns:
        points = {name: place[:, None] for name, place in read_landmarks(path).items()}
        return [LandmarkSet(path.stem, points, ("1",))]
    markers = read_markers(path)
    if markers is None:
        cause = "there are no positions of landmarks in it"
        remedy = "Give columns landmark, x_mm, y_mm, z_mm, or IJ_x_mm ..., or a file of markers"
        raise InputError(str(path), None, cause, remedy)
    points = _points(markers, mapping)
    return [
        LandmarkSet(one.subject, {name: place[:, rows] for name, place in points.items()}, _names(markers, rows))
        for rows, one in marker_groups(markers, labels_of_file(Labels("", ""), path))
    ]


def _points(markers: Markers, mapping: Mapping) -> dict[str, Float[np.ndarray, "3 postures"]]:
    factor = millimetres(markers, mapping)
    found = landmarks_there_mm(markers, mapping, factor)
    if found:
        return found
    by_name = zip(markers.names, markers.positions, strict=True)
    return {name: factor * (mapping.axes_matrix @ place) for name, place in by_name}


def _names(markers: Markers, rows: np.ndarray) -> tuple[str, ...]:
    said = [[markers.rows[key][k] for key in ("motion", "posture") if key in markers.rows] for k in rows]
    return tuple(" ".join(word for word in words if word) or str(k + 1) for k, words in zip(rows, said, strict=True))
