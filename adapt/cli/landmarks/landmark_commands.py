# pyright: reportGeneralTypeIssues=false
# (pandas says "Hashable" of a group's key)
"""``girdle convert``, ``girdle model`` and ``girdle contour``: from what a laboratory measures to what is adapted."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from adapt.cli.ending import EXIT_SOME_NOT_HANDLED, finish
from adapt.cli.options import AaToAc, ClavicleZ, GhFromAc, Names, ScFromIj, Shoulder, SurfaceUnit, console, errors
from adapt.cli.terminal.print_tables import folding_table
from adapt.tables.thorax_table import THORAX_WORDS, thorax_table
from models import load_model
from models.person.contours.band import HALF_WIDTH_PX, INSIDE, VECTOR_PX, Settings
from motions import InputError, Motions
from motions.errors import named
from motions.landmarks.acromion import ROTATIONS
from motions.landmarks.clusters.carried_columns import HUMERUS_PLACED, SCAPULA_FROM, residual_column
from motions.landmarks.mapping import CLUSTERS, UNITS_MM, read_mapping
from motions.landmarks.sampled_postures import (
    CLAVICLE_Z,
    CLAVICLE_Z_BY,
    ESTIMATE_ZERO,
    ESTIMATED,
    Labels,
    is_marked,
    marked_slips,
)
from motions.landmarks.stand_ins import GH_OFFSETS, OFFSETS
from motions.motion_csv.cells import SIDES

Statics = Annotated[
    list[Path] | None,
    typer.Option(
        "--static",
        help="Static trial with palpated landmarks and the markers of clusters (see [clusters] of --map), which carry "
        "them; repeatable: over several postures of the arm the scapula is interpolated.",
        show_default=False,
    ),
]

_NUMBER = r"\d+(\.\d+)?(e[+-]\d+)?"

MANY_FRAMES = 50
"""More postures than a palpator records: this is a trial, which is better sampled."""

LARGEST = 10_000.0
"""Pixels or mm, of an option about images: more is a slip of the pen, or no number."""


def convert_file(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="IN... OUT",
            help="Files, folders of them, or a Spartacus checkout; then a file, or a folder for .mot files.",
        ),
    ],
    names: Names = None,
    write_map: Annotated[
        Path | None,
        typer.Option(
            "--write-map", metavar="lab.toml", help="Write a mapping file for IN, to be edited, and convert nothing."
        ),
    ] = None,
    subject: Annotated[
        str, typer.Option(help="Whose motion it is, if the file does not say; else its folder's or its own name.")
    ] = "",
    motion: Annotated[str, typer.Option(help="What motion it is, if the file does not say; else its name.")] = "",
    side: Shoulder = "right",
    at: Annotated[
        str, typer.Option("--at", help="Elevations of the arm to sample a trial at, as in 30,60,90. Else every frame.")
    ] = "",
    static: Statics = None,
    aa_to_ac: AaToAc = "",
    sc_from_ij: ScFromIj = "",
    gh_from_ac: GhFromAc = "",
    clavicle_z: ClavicleZ = CLAVICLE_Z[0],
    isb: Annotated[bool, typer.Option("--isb", help="Write .mot angles as ISB's alpha, beta, gamma.")] = False,
) -> None:
    """Bring files of your laboratory into this project's forms, and results into those of others.

    Landmarks (.c3d, .trc, .csv, .tsv), angles (.mot, .sto) or a Spartacus checkout become a motion file (.csv), which
    the other commands take; many files become one. A motion file, or fits.csv with its simulated motions, becomes one
    .mot or a folder of them; a parameter set, such as an adapted model, becomes an OpenSim model (.osim); any table
    becomes .parquet.
    """
    from adapt.cli.landmarks.convert import convert  # readers of laboratories' files: not for every command
    from adapt.cli.landmarks.many_files import first_file
    from adapt.cli.landmarks.write_map import write_map as write_mapping

    if clavicle_z not in CLAVICLE_Z:
        raise InputError("--clavicle-z", None, f"there is no '{clavicle_z}'", f"Use one of {', '.join(CLAVICLE_Z)}")
    labels = _labels(subject, motion, side, at, aa_to_ac, sc_from_ij, gh_from_ac)
    labels = replace(labels, clavicle_z=clavicle_z)
    if write_map is not None:
        found = write_mapping(first_file(files[0]), write_map, read_mapping(names))
        console.print(f"{write_map} written: {found} names found. Edit it, and take it with --map", soft_wrap=True)
        return
    *sources, target = files
    if not sources:
        raise InputError(str(target), None, "there is one file, and no name to write to", "Name IN and OUT")
    motions = convert(sources, target, read_mapping(names), labels, isb, static or [])
    if motions is None:
        console.print(f"{target} written", soft_wrap=True)
        return
    _say_converted(motions, sources, target, every_frame=not labels.at_deg)
    finish(motions, {})


def _say_converted(motions: Motions, sources: Sequence[Path], target: Path, *, every_frame: bool) -> None:
    """What was written, and what of it a user may not expect."""
    subjects = len(motions.subjects)
    console.print(
        f"{len(motions.posture)} postures of {subjects} subject{'s' if subjects > 1 else ''} in {target}",
        soft_wrap=True,
    )
    if len(sources) > 1 and subjects == len(sources):
        said = "Each file is a subject of its own; --subject, or a folder for each person, puts trials together."
        console.print(said, soft_wrap=True)
    if every_frame and sources[0].suffix.lower() in (".c3d", ".trc") and len(motions.posture) > MANY_FRAMES:
        measured = np.isfinite(motions.humerus_elevation_deg).any()
        sampled = "--at 30,60,90 would sample the trial at elevations of the arm"
        said = sampled if measured else "GH, EM and EL would give the elevation of the arm, which is empty"
        console.print(f"Every frame is a posture; {said}.", soft_wrap=True)
    _say_estimated(motions)
    _say_cluster(motions)
    _say_slipped(motions)
    _say_thorax(motions)


def model_of_person(
    source: Annotated[
        Path, typer.Argument(metavar="PERSON.csv", help="Landmarks (.c3d, .trc, .csv), or a motion file that has them.")
    ],
    out: Annotated[Path, typer.Option("--out", help="A file that ends in .toml; a folder for several subjects.")],
    model: Annotated[
        str, typer.Option(help="Parameter set that gives what was not measured: a name or a TOML file.")
    ] = "R2",
    points: Annotated[
        Path | None,
        typer.Option(help="CSV of points: surface (thorax, humeral_head, humeral_shaft, ...), x_mm, y_mm, z_mm."),
    ] = None,
    surface: Annotated[
        Path | None,
        typer.Option(
            help="Surface of the person's scapula (.stl, .ply, .vtp), in the frame of the landmarks, first posture: "
            "with --generic-surface it carries the conoid's attachment in place of the landmarks.",
            show_default=False,
        ),
    ] = None,
    generic_surface: Annotated[
        Path | None,
        typer.Option(
            help="Surface of the scapula of --model, in its scapula frame (origin AC, Appendix A).", show_default=False
        ),
    ] = None,
    surface_unit: SurfaceUnit = "mm",
    rest: Annotated[
        str, typer.Option(help="Posture in which the chain closes, by its name. Default: the arm lowest.")
    ] = "",
    names: Names = None,
    subject: Annotated[
        str, typer.Option(help="Whose landmarks they are, if the file does not say; else its name.")
    ] = "",
    side: Shoulder = "right",
    static: Statics = None,
    aa_to_ac: AaToAc = "",
    sc_from_ij: ScFromIj = "",
) -> None:
    """Make a parameter set of a person from landmarks, and from points if there are any (Chapters 4 and 5).

    Lengths are medians over the postures. The thorax is fitted to points on it. What was not measured is that of
    another set, carried to the person's bones. Every number has its source and its SD; `girdle adapt --model` takes
    the file, `--models-of` a folder of them.
    """
    from adapt.cli.landmarks.person import SurfaceFiles, write_person_sets  # readers of files: not for every command
    from adapt.cli.terminal.print_person import print_persons

    labels = _labels(subject, "", side, "", aa_to_ac, sc_from_ij)
    if (surface is None) != (generic_surface is None):
        lacking = "--surface" if surface is None else "--generic-surface"
        raise InputError(lacking, None, "one scapula has a surface, the other none", "Give both, or none")
    unit_mm = named(surface_unit, UNITS_MM, "--surface-unit", "unit")
    files = SurfaceFiles(generic_surface, surface, unit_mm) if surface and generic_surface else None
    generic, mapping = load_model(model), read_mapping(names)
    written, rejected = write_person_sets(source, out, generic, mapping, labels, rest, points, files, static or [])
    print_persons(console, written)
    for error in rejected:
        errors.print(f"left out: {error}", soft_wrap=True)
    if rejected:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)


def contours_of_slices(
    slices: Annotated[list[Path], typer.Argument(metavar="SLICE...", help="DICOM or PNG files, or a folder of them.")],
    clicks: Annotated[Path, typer.Option(help="CSV of clicks: slice, x_px, y_px; use (draw, correct), surface.")],
    out: Annotated[Path, typer.Option("--out", help="CSV of points, which `girdle model --points` takes.")],
    click: Annotated[
        bool, typer.Option("--click", help="Take clicks in a window first, and add them to --clicks.")
    ] = False,
    surface: Annotated[
        str,
        typer.Option(help="Of the clicks in the window: as `girdle model --points` names it, or any other, a muscle."),
    ] = "thorax",
    volumes: Annotated[
        Path | None,
        typer.Option(help="CSV for the volume of each surface: area times distance of the slices.", show_default=False),
    ] = None,
    inside: Annotated[
        str, typer.Option(help="What the bone is beside what surrounds it: bright, dark, either.")
    ] = "either",
    half_width_px: Annotated[
        float,
        typer.Option(min=1.0, max=LARGEST, help="How far from the clicks, or the slice before, an edge is looked for."),
    ] = HALF_WIDTH_PX,
    vector_px: Annotated[
        float,
        typer.Option(
            min=0.0, max=LARGEST, help="How far the polygon of the points may be from the contour; 0 keeps all."
        ),
    ] = VECTOR_PX,
    pixel_mm: Annotated[
        float | None,
        typer.Option(min=1e-3, max=LARGEST, help="Size of a pixel, of images that do not say.", show_default=False),
    ] = None,
    slice_mm: Annotated[
        float | None,
        typer.Option(
            min=-LARGEST, max=LARGEST, help="Distance of slices, of images that do not say.", show_default=False
        ),
    ] = None,
) -> None:
    """Find contours of bones in image slices from a few clicks, and write their points in mm (Chapter 2).

    Between clicks the contour follows the strongest edge near them. It is propagated to the other slices; where that
    fails, a correction of three clicks, or a new contour, puts it right. Volumes are those of Table 4.8. Needs the
    extra `contour` of the package.
    """
    from adapt.cli.landmarks.contour import print_contours, write_contours  # readers of images: not for every command

    if inside not in INSIDE:
        raise InputError("--inside", None, f"there is no '{inside}'", f"Use one of {', '.join(INSIDE)}")
    if slice_mm == 0.0:
        raise InputError("--slice-mm", None, "slices 0 mm apart are one", "Give their distance")
    settings = Settings(inside, half_width_px)  # type: ignore[arg-type]
    done = write_contours(
        slices, clicks, out, settings, vector_px, (pixel_mm, slice_mm), surface if click else "", volumes
    )
    print_contours(console, done, out)


def _labels(
    subject: str, motion: str, side: str, at: str, aa_to_ac: str, sc_from_ij: str, gh_from_ac: str = ""
) -> Labels:
    """What the options say of a file of landmarks."""
    if side not in SIDES:
        raise InputError("--side", None, f"the side is '{side}'", "Say left or right")
    rotation = named(aa_to_ac, ROTATIONS, "--aa-to-ac", "rotation") if aa_to_ac else None
    offset = named(sc_from_ij, OFFSETS, "--sc-from-ij", "offset") if sc_from_ij else None
    gh = named(gh_from_ac, GH_OFFSETS, "--gh-from-ac", "offset") if gh_from_ac else None
    return Labels(subject, motion, SIDES[side], _elevations(at), rotation, aa_to_ac, offset, gh)


def _say_estimated(motions: Motions) -> None:
    """Say that the axial rotation of the clavicle is an estimate, and with which elevation of the arm it is 0."""
    if not is_marked(motions, ESTIMATED, "yes").any():
        return
    said = "clavicle_x_deg (axial rotation) is an estimate"
    if ESTIMATE_ZERO in motions.extra:
        zeros = sorted({float(word) for word in motions.extra[ESTIMATE_ZERO] if re.fullmatch(r"\d+\.?\d*", word)})
        span = " to ".join(dict.fromkeys(f"{zero:.0f}" for zero in zeros[:1] + zeros[-1:]))
        said += f"; it is 0 {f'with the arm lowest, at {span} degrees' if zeros else 'in the first posture'}"
    console.print(said, soft_wrap=True)


def _say_cluster(motions: Motions) -> None:
    """Say that the scapula is a cluster's, how well each cluster kept its shape, and that GH was placed."""
    marks = {column: list(motions.extra[column]) for column in motions.extra.columns}
    for column, what in ((SCAPULA_FROM, "The scapula is of a"), (HUMERUS_PLACED, "The elevation rests on")):
        for said in dict.fromkeys(word for word in marks.get(column, []) if word):
            console.print(f"{what} {said}", soft_wrap=True)
    for segment in CLUSTERS:
        known = [float(mm) for mm in marks.get(residual_column(segment), []) if re.fullmatch(_NUMBER, mm)]
        if known:
            said = f"residual of the rigid fit {np.median(known):.2g} mm (median), {max(known):.2g} mm (largest)"
            console.print(f"Cluster {segment}: {said}", soft_wrap=True)


def _say_slipped(motions: Motions) -> None:
    """Name the landmarks that are not where their bone says."""
    for row, names in marked_slips(motions).items():
        where = f"{motions.subject[row]}, {motions.motion[row]} {motions.posture[row]}"
        console.print(f"{names} slipped: {where}", soft_wrap=True)


def _say_thorax(motions: Motions) -> None:
    """Print the thorax against the global frame, median and range by motion; and how the clavicle's axis differs."""
    said_by = motions.extra.get(CLAVICLE_Z_BY)
    for said in dict.fromkeys(() if said_by is None else said_by):
        console.print(f"Clavicle's z axis by the {said}", soft_wrap=True)
    rows = thorax_table(motions)
    if not len(rows):
        return
    table = folding_table("Thorax against the global frame, degrees: median (least to most)", ("subject", "motion"))
    for name in THORAX_WORDS.values():
        table.add_column(name, no_wrap=True, justify="right")
    for (subject, motion), part in rows.groupby(["subject", "motion"], sort=False):
        cells = [
            f"{r['median_deg']:.1f} ({r['least_deg']:.1f} to {r['most_deg']:.1f})" for r in part.to_dict("records")
        ]
        table.add_row(str(subject), str(motion), *cells)
    console.print(table)


def _elevations(at: str) -> tuple[float, ...]:
    """The numbers of --at, each once, from low to high."""
    try:
        found = tuple(sorted({float(word) for word in at.split(",") if word.strip()}))
    except ValueError:
        found = (np.nan,)
    if not all(0.0 <= elevation <= 180.0 for elevation in found):
        cause = f"'{at}' is not a list of elevations"
        raise InputError("--at", None, cause, "Give degrees from 0 to 180 separated by commas, as in --at 30,60,90")
    return found
