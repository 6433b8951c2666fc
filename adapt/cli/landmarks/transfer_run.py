"""Run of ``girdle transfer``: attachments of one bone in, attachments of another bone out."""

from math import isnan
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console

from adapt.cli.landmarks.asked_labels import asked_unit_mm
from adapt.cli.options import console
from adapt.cli.terminal.console import folding_table
from adapt.output.run_files import inputs_record, results_folder, transaction, write_run, write_table
from adapt.tables.attachment_tables import distances_table, points_table
from models.person.attachments import ATTACHMENT_SD_MM
from models.person.transfer.carried_attachments import Bone, Carried, carry_attachments, lay_on_same_bone
from models.person.transfer.contour_distances import LINE, PLANE, POINT, SHAPES
from models.person.transfer.mesh import read_mesh
from motions import InputError
from motions.formats.named_points import NamedPoints, read_landmarks, read_named_points


def transfer_attachments(
    attachments: Path,
    out: Path,
    landmarks: tuple[Path | None, Path | None],
    surfaces: tuple[Path | None, Path | None],
    measured: Path | None,
    same_bone: bool,
    surface_unit: str,
) -> None:
    """Transfer attachments, write the files of ``girdle transfer`` and print the distances.

    ``landmarks``, ``surfaces``: files of the source and of the target.
    """
    (from_landmarks, to_landmarks), (from_surface, to_surface) = landmarks, surfaces
    unit_mm = asked_unit_mm(surface_unit, surfaces)
    files = [attachments, from_landmarks, to_landmarks, from_surface, to_surface, measured]
    given, shapes = _attachments(attachments)
    source, target = _bone(from_landmarks, from_surface, unit_mm), _bone(to_landmarks, to_surface, unit_mm)
    carried = _carried(attachments, given, source, target, same_bone)
    known = {} if measured is None else _measured(measured, given, attachments)
    try:
        distances = distances_table(carried.points_mm, shapes, known, target.mesh)
    except ValueError as error:
        raise InputError(str(attachments), None, str(error), "Say shape line, or give its contour") from error
    with results_folder(out) as folder, transaction(folder) as staged:
        write_table(points_table(carried.points_mm, shapes), staged / "attachments.csv")
        write_table(distances, staged / "distances.csv")
        options = {"surface_unit": surface_unit, "same_bone": same_bone}
        write_run(staged, "transfer", inputs_record([path for path in files if path], []), options)
    _print_carried(console, carried, distances, same_bone)


def _bone(landmarks: Path | None, surface: Path | None, unit_mm: float) -> Bone:
    return Bone(
        {} if landmarks is None else read_landmarks(landmarks), None if surface is None else read_mesh(surface, unit_mm)
    )


def _attachments(path: Path) -> tuple[dict[str, NamedPoints], dict[str, str]]:
    """Read the points of the attachments and their shapes; by default one point is a point, and several are a line."""
    given = read_named_points(path, "attachment")
    for name, one in given.items():
        if one.shape and one.shape not in SHAPES:
            cause = f"{name!r} has the shape {one.shape!r}"
            raise InputError(str(path), one.line, cause, f"Use one of {', '.join(SHAPES)}")
        if one.shape == PLANE and one.points_mm.shape[1] < 3:
            raise InputError(str(path), one.line, f"{name!r} has too few points for a plane", "Give three, or its line")
    return given, {name: one.shape or (POINT if one.points_mm.shape[1] == 1 else LINE) for name, one in given.items()}


def _carried(path: Path, given: dict[str, NamedPoints], source: Bone, target: Bone, same_bone: bool) -> Carried:
    points = {name: one.points_mm for name, one in given.items()}
    if same_bone:
        return _laid(path, points, source, target)
    if (source.mesh is None) != (target.mesh is None):
        lacking = "--from-surface" if source.mesh is None else "--to-surface"
        raise InputError(lacking, None, "one bone has a surface, the other none", "Give both, or landmarks alone")
    try:
        return carry_attachments(points, source, target)
    except ValueError as error:
        remedy = "Give three landmarks of both bones (--from-landmarks, --to-landmarks), or both surfaces"
        raise InputError(str(path), None, f"these attachments cannot be carried: {error}", remedy) from error


def _laid(path: Path, points: dict[str, np.ndarray], source: Bone, target: Bone) -> Carried:
    if source.mesh is not None:
        cause = "with --same-bone there is one bone, and its surface is in the frame of --to-landmarks and --measured"
        raise InputError("--from-surface", None, cause, "Give it as --to-surface")
    try:
        return lay_on_same_bone(points, source, target)
    except ValueError as error:
        remedy = "Give three landmarks of both (--from-landmarks, --to-landmarks), or none if both are in one frame"
        raise InputError(str(path), None, f"these attachments cannot be moved: {error}", remedy) from error


def _measured(path: Path, given: dict[str, NamedPoints], source: Path) -> dict[str, np.ndarray]:
    found = {name: one.points_mm for name, one in read_named_points(path, "attachment").items() if name in given}
    if not found:
        cause = f"none of the attachments of {source} is in it"
        raise InputError(str(path), None, cause, f"Name them as there: {', '.join(given)}")
    return found


def _print_carried(console: Console, carried: Carried, distances: pd.DataFrame, same_bone: bool) -> None:
    console.print(f"Carried {carried.how}", soft_wrap=True)
    columns = {"surface_mm": "to surface", "least_mm": "least", "mean_mm": "mean", "most_mm": "most"}
    table = folding_table("Distances, mm; from measured ones, type of Table 5.3", ("attachment", "shape"), ("points",))
    for header in columns.values():
        table.add_column(header, no_wrap=True, justify="right")
    table.add_column("type", no_wrap=True)
    for row in distances.to_dict("records"):
        cells = ["-" if isnan(value) else f"{value:.1f}" for value in (float(row[name]) for name in columns)]
        kind = row["type"] if isinstance(row["type"], str) else ""
        table.add_row(row["attachment"], row["shape"], str(row["points"]), *cells, kind)
    console.print(table)
    if not same_bone and not any(isinstance(kind, str) for kind in distances["type"]):
        said = f"An attachment carried from another bone is assumed to be {ATTACHMENT_SD_MM:g} mm (SD a coordinate) off"
        console.print(f"{said} (Tables 4.6 and 4.7: 4 to 21 mm)", soft_wrap=True)
