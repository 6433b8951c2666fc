"""Options and help of ``girdle transfer``."""

from pathlib import Path
from typing import Annotated

import typer

from adapt.cli.options import SurfaceUnit

Optional = Path | None


def transfer(
    attachments: Annotated[
        Path,
        typer.Argument(
            metavar="ATTACHMENTS.csv",
            help="Points of attachments on the source: attachment, x_mm, y_mm, z_mm, and shape (point, line, plane).",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for the results; made if it is not there.")],
    from_landmarks: Annotated[
        Optional, typer.Option(help="CSV of landmarks of the source: landmark, x_mm, y_mm, z_mm.", show_default=False)
    ] = None,
    to_landmarks: Annotated[
        Optional, typer.Option(help="The same landmarks of the target.", show_default=False)
    ] = None,
    from_surface: Annotated[
        Optional, typer.Option(help="Surface of the source (.stl, .ply, .vtp).", show_default=False)
    ] = None,
    to_surface: Annotated[Optional, typer.Option(help="Surface of the target.", show_default=False)] = None,
    measured: Annotated[
        Optional,
        typer.Option(help="Attachments measured on the target, as ATTACHMENTS.csv.", show_default=False),
    ] = None,
    same_bone: Annotated[
        bool,
        typer.Option("--same-bone", help="Both are of one bone, measured twice: moved rigidly, without scaling."),
    ] = False,
    surface_unit: SurfaceUnit = "mm",
) -> None:
    """Transfer attachments from bone to bone, by landmarks or surfaces (Chapter 5); compare them with measured ones.

    Give --from-landmarks and --to-landmarks, three or more; or --from-surface and --to-surface, with landmarks too
    where there are any. Landmarks and attachments of a bone are in the frame of its surface; both bones are of the same
    side. Surfaces need the extra `surface` of the package. With --same-bone, two measurements of one bone are compared
    with each other (Tables 4.6 and 4.7) and with the surface of the bone, --to-surface (Appendix C): landmarks of both
    measurements align them; without landmarks, they are taken to be in one frame.

    Writes attachments.csv (the points on the target: attachment, shape, x_mm, y_mm, z_mm), distances.csv (one row per
    attachment: mean and SD of the distance to the target's surface; with --measured the smallest, mean and largest
    distance of the contours, the type of Table 5.3, and the distances of Tables 4.6 and 4.7) and run.json.
    """
    from adapt.cli.landmarks.transfer_run import transfer_attachments  # slow import: pandas and file readers

    landmarks, surfaces = (from_landmarks, to_landmarks), (from_surface, to_surface)
    transfer_attachments(attachments, out, landmarks, surfaces, measured, same_bone, surface_unit)
