"""``girdle transfer``: its options and help."""

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
    """Carry attachments from bone to bone, by landmarks or by surfaces (Chapter 5); compare them with measured ones.

    Give --from-landmarks and --to-landmarks, three and more; or --from-surface and --to-surface, with landmarks beside
    them where there are any. Landmarks and attachments of a bone are in the frame of its surface; both bones are of one
    side. Surfaces need the extra `surface` of the package. With --same-bone a bone measured twice is compared with
    itself (Tables 4.6 and 4.7), and with its surface, --to-surface (Appendix C): moved by landmarks of both, or in one
    frame already where none are given.

    Writes attachments.csv (the points on the target: attachment, shape, x_mm, y_mm, z_mm), distances.csv (one row an
    attachment: to the target's surface, mean and SD; with --measured the smallest, mean and largest distance of the
    contours and the type of Table 5.3, and the distances of Tables 4.6 and 4.7) and run.json.
    """
    from adapt.cli.landmarks.transfer_run import transfer_attachments  # pandas and readers of files: not for --help

    landmarks, surfaces = (from_landmarks, to_landmarks), (from_surface, to_surface)
    transfer_attachments(attachments, out, landmarks, surfaces, measured, same_bone, surface_unit)
