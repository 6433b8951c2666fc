"""Options and help of ``girdle drive``."""

from typing import Annotated

import typer

from adapt.cli.choices import DEFAULT_MODEL
from adapt.cli.options import MotionFiles, Out, Repeat


def drive_girdle(
    motions: MotionFiles,
    out: Out,
    model: Annotated[str, typer.Option(help="Name of a parameter set or a TOML file.")] = DEFAULT_MODEL,
    inverse: Annotated[
        bool, typer.Option("--inverse", help="Compute the coordinates of the girdle at measured angles instead.")
    ] = False,
    repeat: Repeat = None,
) -> None:
    """Drive the girdle to postures by its three free coordinates, y and z of AC and x of TS (thesis 3.2.2).

    Takes motion files with positions of AC and TS, or CSV files with the columns AC_y_mm, AC_z_mm and TS_x_mm (thorax
    frame, right shoulder) and optionally subject, motion, posture and humerus_elevation_deg. Among several solutions,
    the posture nearest to the measured angles is taken; without measured angles, the posture nearest to the hanging
    arm.

    Writes driven.csv (one row per posture: coordinates, six angles, constraint residuals A1-A3, status), motions.csv
    (the postures that were reached as a motion file) and run.json. The status of a posture out of reach names the part
    that cannot follow: unreachable_AC, _TS, _AI or _conoid.

    With --inverse, reads motion files and writes the coordinates of the girdle at the six angles into driven.csv; A1-A3
    then say how far these angles are from closing the chain.
    """
    from adapt.cli.commands.drive_run import drive_motions  # slow import: JAX and pandas

    drive_motions(motions, out, model, inverse)
