"""Run of ``girdle model``: landmarks and points of persons in, a parameter set for each person out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adapt.cli.landmarks.many_files import calibration_for, static_files
from models.export.toml import parameters_toml
from models.parameter_sets import ParameterSet, parameter_document, parameter_set
from models.person.attachments import ScapularSurfaces
from models.person.bony_contours import described_contours
from models.person.person_set import PersonSet, person_set
from models.person.sizes import DEEPEST_MM
from models.person.transfer.mesh import read_mesh
from motions.errors import InputError, warn_input
from motions.files import atomic_write, file_names, make_folder, printable, refuse_replacing
from motions.formats.person_file import PersonLandmarks, read_persons
from motions.landmarks.clusters.calibration import SAME_POSTURE_DEG
from motions.landmarks.frames import scapula_frame
from motions.landmarks.mapping import Mapping
from motions.landmarks.sampled_postures import Labels

TOML = ".toml"


@dataclass(frozen=True)
class Written:
    """Parameter set of one person, and its file."""

    subject: str
    path: Path
    built: PersonSet
    contours: tuple[str, ...]
    rest: str
    """Posture in which the chain closes, with the elevation of the arm."""


@dataclass(frozen=True)
class SurfaceFiles:
    """Surfaces of the generic scapula (in its scapula frame) and of the person's (in the frame of the landmarks)."""

    generic: Path
    person: Path
    unit_mm: float


def write_person_sets(
    source: Path,
    target: Path,
    generic: ParameterSet,
    mapping: Mapping,
    labels: Labels,
    rest: str,
    points: Path | None,
    surface_files: SurfaceFiles | None = None,
    statics: Sequence[Path] = (),
    also_read: Sequence[Path | None] = (),
) -> tuple[list[Written], list[InputError]]:
    """Write a parameter set for every subject in the source; return the sets, and the errors of subjects without one.

    ``target``: a file that ends in .toml for one subject, else a folder. ``surface_files``: for a single subject only.
    ``statics``: trials with palpated landmarks, which clusters carry into the source. ``also_read``: files of the
    mapping and the generic set. Raise an InputError if no set can be written, or if one would replace a file that is
    read.
    """
    calibration = calibration_for(source, statics, mapping, labels)
    persons, rejected = read_persons(source, mapping, labels, points, calibration)
    if calibration is None and mapping.clusters:
        _warn_of_clusters(persons, mapping, source)
    if surface_files is not None and len(persons) > 1:
        cause = f"{source} has {len(persons)} subjects, and a surface is of one"
        raise InputError("--surface", None, cause, "Give the landmarks of the one whose surface it is")
    if target.suffix.lower() == TOML and len(persons) > 1:
        cause = f"{source} has {len(persons)} subjects and {target.name} holds one"
        raise InputError(str(target), None, cause, "Name a folder instead, without an ending")
    meshes = () if surface_files is None else (surface_files.generic, surface_files.person)
    paths = list(_paths(persons, target))
    for path in paths:
        refuse_replacing(path, (source, points, *meshes, *static_files(source, statics), *also_read))
    written = []
    for person, path in zip(persons, paths, strict=True):
        try:
            at = person.named(rest) if rest else _lowest(person)
            surfaces = None if surface_files is None else _surfaces(person, surface_files, mapping)
            built, contours = _built(person, generic, at, surfaces)
            if calibration is not None:
                contours = (*contours, f"Landmarks are those that clusters carried; the scapula's: {calibration.said}.")
            text = person_toml(person.subject, built, contours, person.described(at), generic.name)
            parameter_set(parameter_document(text, person.file), person.file)  # raises where --model would refuse it
        except InputError as error:
            rejected.append(error)
            continue
        atomic_write(path, text)
        written.append(Written(person.subject, path, built, contours, person.described(at)))
        _warn_inside(person, built, generic.name, person.described(at))
    if not written:
        raise rejected[0]
    return written, rejected


def _warn_of_clusters(persons: Sequence[PersonLandmarks], mapping: Mapping, source: Path) -> None:
    """Warn (InputWarning) of clusters that carry nothing, except in a static trial itself: the arm holds still."""
    known = [one.elevation_deg[np.isfinite(one.elevation_deg)] for one in persons]
    if any(len(one) and np.ptp(one) > SAME_POSTURE_DEG for one in known):
        cause = f"without --static the clusters of the mapping carry nothing ({', '.join(mapping.clusters)})"
        remedy = "Give the static trials, or take [clusters] out of the mapping: the landmarks are those of this file"
        warn_input(InputError(str(source), None, cause, remedy))


def _paths(persons: list[PersonLandmarks], target: Path) -> Iterator[Path]:
    if target.suffix.lower() == TOML:
        make_folder(target.parent)
        yield target
        return
    make_folder(target)
    for name in file_names([person.subject for person in persons]):
        yield target / f"{name}{TOML}"


def _surfaces(person: PersonLandmarks, files: SurfaceFiles, mapping: Mapping) -> ScapularSurfaces:
    """Return the surfaces of both scapulae in their own frames.

    The person's surface is placed by the landmarks of the first posture. Raise an InputError where AC, TS or AI was not
    measured there, or lies far off the surface, which is then in another frame.
    """
    at = {name: person.landmarks_mm[name][:, :1] for name in ("AC", "TS", "AI")}
    missing = [name for name, place in at.items() if name in person.estimated_landmarks or not np.isfinite(place).all()]
    if missing:
        cause = f"{' and '.join(missing)} were not measured in {person.postures[0]}, where the surface is"
        raise InputError(
            person.file, None, cause, "Measure AC, TS and AI in the frame of the surface, as first posture"
        )
    mesh = read_mesh(files.person, files.unit_mm)
    corners = person.in_thorax_mm(mapping.axes_matrix @ mesh.corners)
    placed = replace(mesh, corners=corners)
    off = {name: float(placed.distances_mm(place)[0]) for name, place in at.items()}
    if max(off.values()) > FARTHEST_MM:
        said = ", ".join(f"{name} {mm:.0f} mm" for name, mm in off.items())
        cause = f"the landmarks of {person.postures[0]} are off this surface: {said}"
        raise InputError(str(files.person), None, cause, "Give it in the frame and unit of the landmarks")
    R = scapula_frame(*(place[:, 0] for place in at.values()))
    return ScapularSurfaces(read_mesh(files.generic, files.unit_mm), replace(mesh, corners=R.T @ (corners - at["AC"])))


FARTHEST_MM = 25.0
"""Largest distance of AC, TS or AI from the surface of the same scapula, mm: the AC joint has cartilage, and landmarks
are palpated through skin. Assumed: ten times the 1.1-2.4 mm of Table 5.2."""


def _built(
    person: PersonLandmarks, generic: ParameterSet, at: int, surfaces: ScapularSurfaces | None
) -> tuple[PersonSet, tuple[str, ...]]:
    thorax_points_mm = person.points_mm.get("thorax")
    try:
        built = person_set(
            person.landmarks_mm, generic, at, person.postures, person.estimated_landmarks, thorax_points_mm, surfaces
        )
        return built, described_contours(person.points_mm)
    except ValueError as error:
        remedy = "Look at its landmarks and points; name another posture with --rest"
        raise InputError(person.file, None, f"subject {person.subject!r}: {error}", remedy) from error


def _warn_inside(person: PersonLandmarks, built: PersonSet, generic: str, rest: str) -> None:
    """Warn (InputWarning) where TS or AI is inside the thorax in the posture taken for rest."""
    distances = {"TS": float(built.girdle.ts_distance_mm), "AI": float(built.girdle.ai_distance_mm)}
    inside = [f"{name} {-mm:.0f} mm" for name, mm in distances.items() if mm < DEEPEST_MM]
    if not inside:
        return
    whose, remedy = f"of {generic}", "Give points on the person's thorax (--points), or take another set (--model)"
    if built.thorax is not None:
        whose, remedy = "fitted to the points", "Check points and landmarks, and the posture taken for rest (--rest)"
    cause = f"subject {person.subject!r}: at rest ({rest}) {' and '.join(inside)} inside the thorax {whose}"
    warn_input(InputError(person.file, None, cause, remedy))


def _lowest(person: PersonLandmarks) -> int:
    """Return the posture with the lowest arm among those with all landmarks; without elevations, the first of these."""
    whole = np.all([np.isfinite(person.landmarks_mm[name]).all(axis=0) for name in ("SC", "AC", "TS", "AI")], axis=0)
    height = np.where(np.isnan(person.elevation_deg), np.inf, person.elevation_deg)
    return int(np.lexsort((height, ~whole))[0])


def person_toml(subject: str, built: PersonSet, contours: tuple[str, ...], rest: str, generic: str) -> str:
    """Format the set as the text of a TOML file that ``--model`` takes."""
    lines = [
        f"{subject}, from landmarks; what was not measured is that of {generic}.",
        "Written by girdle model. Right shoulder, mm; frames as in the thesis, Appendix A.",
        f"Taken for rest: {rest}.",
        *contours,
        *built.notes,
    ]
    comment = printable("\n".join(line.replace("\n", " ") for line in lines))
    return parameters_toml(subject, comment, built.girdle, built.points_mm, built.source)
