"""``girdle check``: its options and help."""

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
    """Check landmarks: distances that bones keep, rigid motions between postures, what no person has (Chapters 4, 5).

    Of one file: distances.csv (every pair of points over the postures, with the range of adults) and
    rigid_motions.csv (rotation, translation and residual of each bone from its first posture); with `global` in --map,
    thorax.csv (the thorax against the global frame, Appendix A). Landmarks that are no person's, that jump or slip are
    named.

    Of two files of one posture each: distances.csv (the difference of the distance matrices, Tables 4.1 and 5.1, and
    which points are of the largest set that agrees) and rigid_motions.csv (the motion between them by these points, or
    by all where they are fewer than three, Table 5.2). Points may have any names. And run.json.
    """
    from adapt.cli.landmarks.check_run import check_landmarks  # pandas and readers of files: not for --help

    check_landmarks(landmarks, out, other, names)
