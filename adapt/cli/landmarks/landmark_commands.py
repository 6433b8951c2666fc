"""Options and help of ``girdle convert``, ``girdle model`` and ``girdle contour``, which prepare measured data."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from adapt.cli.choices import CLAVICLE_Z, DEFAULT_MODEL, HALF_WIDTH_PX, VECTOR_PX
from adapt.cli.ending import EXIT_SOME_NOT_HANDLED, finish
from adapt.cli.options import AaToAc, ClavicleZ, GhFromAc, Names, ScFromIj, Shoulder, SurfaceUnit, console, errors
from motions.errors import InputError

Statics = Annotated[
    list[Path] | None,
    typer.Option(
        "--static",
        help="Static trial with palpated landmarks and the markers of clusters (see [clusters] of --map), which carry "
        "them; repeatable: over several postures of the arm the scapula is interpolated.",
        show_default=False,
    ),
]

LARGEST = 10_000.0
"""Largest value in pixels or mm of an option about images; a larger number is a typing error, or infinite."""


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
        str, typer.Option(help="Name of the subject, if the file has none. Default: the name of its folder or file.")
    ] = "",
    motion: Annotated[
        str, typer.Option(help="Name of the motion, if the file has none. Default: the name of the file.")
    ] = "",
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
    """Convert files of your laboratory into motion files, and results into the formats of other programs.

    Landmarks (.c3d, .trc, .csv, .tsv), angles (.mot, .sto) or a Spartacus checkout become a motion file (.csv) for the
    other commands; many files become one. A motion file, or fits.csv with its simulated motions, becomes one .mot file
    or a folder of them. A parameter set, such as an adapted model, becomes an OpenSim model (.osim). Any table becomes
    .parquet.
    """
    from adapt.cli.landmarks.asked_labels import asked_labels  # slow import: file readers
    from adapt.cli.landmarks.convert import convert
    from adapt.cli.landmarks.many_files import first_file
    from adapt.cli.landmarks.write_map import write_map as write_mapping
    from adapt.cli.terminal.print_converted import print_converted
    from motions.landmarks.mapping import read_mapping

    if clavicle_z not in CLAVICLE_Z:
        raise InputError("--clavicle-z", None, f"there is no '{clavicle_z}'", f"Use one of {', '.join(CLAVICLE_Z)}")
    labels = asked_labels(subject, motion, side, at, aa_to_ac, sc_from_ij, gh_from_ac)
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
    print_converted(console, motions, sources, target, every_frame=not labels.at_deg)
    finish(motions, {})


def model_of_person(
    source: Annotated[
        Path, typer.Argument(metavar="PERSON.csv", help="Landmarks (.c3d, .trc, .csv), or a motion file that has them.")
    ],
    out: Annotated[Path, typer.Option("--out", help="A file that ends in .toml; a folder for several subjects.")],
    model: Annotated[
        str, typer.Option(help="Parameter set that gives what was not measured: a name or a TOML file.")
    ] = DEFAULT_MODEL,
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
        str, typer.Option(help="Name of the subject, if the file has none. Default: the name of the file.")
    ] = "",
    side: Shoulder = "right",
    static: Statics = None,
    aa_to_ac: AaToAc = "",
    sc_from_ij: ScFromIj = "",
) -> None:
    """Make a parameter set of a person from landmarks and, if there are any, points of surfaces (Chapters 4 and 5).

    Lengths are medians over the postures. The thorax ellipsoid is fitted to points on the thorax. Numbers that were not
    measured come from another set, carried to the person's bones. Every number has its source and its SD. The file is
    for `girdle adapt --model`, a folder of such files for `--models-of`.
    """
    from adapt.cli.landmarks.asked_labels import asked_labels, asked_unit_mm  # slow import: file readers
    from adapt.cli.landmarks.person import SurfaceFiles, write_person_sets
    from adapt.cli.terminal.print_person import print_persons
    from models.parameter_sets import load_model, model_file
    from motions.landmarks.mapping import read_mapping

    labels = asked_labels(subject, "", side, "", aa_to_ac, sc_from_ij)
    if (surface is None) != (generic_surface is None):
        lacking = "--surface" if surface is None else "--generic-surface"
        raise InputError(lacking, None, "one scapula has a surface, the other none", "Give both, or none")
    unit_mm = asked_unit_mm(surface_unit, (surface, generic_surface))
    files = SurfaceFiles(generic_surface, surface, unit_mm) if surface and generic_surface else None
    generic, mapping = load_model(model), read_mapping(names)
    also_read = (names, model_file(model))
    written, rejected = write_person_sets(
        source, out, generic, mapping, labels, rest, points, files, static or [], also_read
    )
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
        typer.Option(
            help="Surface of the clicks in the window: a name of `girdle model --points`, or any other, as a muscle."
        ),
    ] = "thorax",
    volumes: Annotated[
        Path | None,
        typer.Option(help="CSV for the volume of each surface: area times distance of the slices.", show_default=False),
    ] = None,
    inside: Annotated[
        str, typer.Option(help="Brightness of the bone against its surroundings: bright, dark, either.")
    ] = "either",
    half_width_px: Annotated[
        float,
        typer.Option(
            min=1.0,
            max=LARGEST,
            help="Width of the search for edges about the clicks or the previous slice, to each side.",
        ),
    ] = HALF_WIDTH_PX,
    vector_px: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=LARGEST,
            help="Largest distance of the polygon of the points from the contour; 0 keeps all points.",
        ),
    ] = VECTOR_PX,
    pixel_mm: Annotated[
        float | None,
        typer.Option(min=1e-3, max=LARGEST, help="Size of a pixel, if the images do not say.", show_default=False),
    ] = None,
    slice_mm: Annotated[
        float | None,
        typer.Option(
            min=-LARGEST, max=LARGEST, help="Distance of the slices, if the images do not say.", show_default=False
        ),
    ] = None,
) -> None:
    """Find contours of bones in image slices from a few clicks, and write their points in mm (Chapter 2).

    Between clicks, the contour follows the strongest edge near them. The contour is propagated to the other slices;
    where that fails, correct it with three clicks or draw a new contour. Volumes are computed as in Table 4.8. Needs
    the extra `contour` of the package.
    """
    from adapt.cli.landmarks.contour import print_contours, write_contours  # slow import: image readers
    from models.person.contours.band import INSIDE, Settings

    if inside not in INSIDE:
        raise InputError("--inside", None, f"there is no '{inside}'", f"Use one of {', '.join(INSIDE)}")
    if slice_mm == 0.0:
        raise InputError("--slice-mm", None, "slices 0 mm apart are one", "Give their distance")
    settings = Settings(inside, half_width_px)  # type: ignore[arg-type]
    done = write_contours(
        slices, clicks, out, settings, vector_px, (pixel_mm, slice_mm), surface if click else "", volumes
    )
    print_contours(console, done, out)
