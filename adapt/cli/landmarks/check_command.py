"""Options and help of ``girdle check``."""

from pathlib import Path
from typing import Annotated

import typer

from adapt.cli.options import Names


def check(
    landmarks: Annotated[
        Path,
        typer.Argument(metavar="LANDMARKS", help="File of markers, or CSV of points: landmark, x_mm, y_mm, z_mm."),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for the results; made if it is not there.")],
    other: Annotated[
        Path | None,
        typer.Argument(metavar="OTHER", help="A second measurement of the same points.", show_default=False),
    ] = None,
    names: Names = None,
) -> None:
    """Check landmarks: distances within bones, rigid motions between postures, impossible values (Chapters 4 and 5).

    For one file, writes distances.csv (every pair of points over the postures, with the range of adults) and
    rigid_motions.csv (rotation, translation and residual of each bone from its first posture); with `global` in --map
    also thorax.csv (the thorax against the global frame, Appendix A). Landmarks that no person can have, jumps and
    landmark outliers are named.

    For two files of one posture each, writes distances.csv (the difference of the distance matrices, Tables 4.1 and
    5.1, and the points in the largest set that agrees) and rigid_motions.csv (the motion between the files by these
    points, or by all points where these are fewer than three, Table 5.2). Points may have any names.

    Also writes run.json.
    """
    from adapt.cli.landmarks.check_run import check_landmarks  # slow import: pandas and file readers

    check_landmarks(landmarks, out, other, names)
