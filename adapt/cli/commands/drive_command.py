"""``girdle drive``: its options and help."""

from typing import Annotated

import typer

from adapt.cli.choices import DEFAULT_MODEL
from adapt.cli.options import MotionFiles, Out, Repeat


def drive_girdle(
    motions: MotionFiles,
    out: Out,
    model: Annotated[str, typer.Option(help="Name of a parameter set or a TOML file.")] = DEFAULT_MODEL,
    inverse: Annotated[
        bool, typer.Option("--inverse", help="The way back: the coordinates that the girdle has at measured angles.")
    ] = False,
    repeat: Repeat = None,
) -> None:
    """Drive the girdle by y and z of AC and x of TS, its three free coordinates, to postures (thesis 3.2.2).

    Takes motion files with positions of AC and TS, or CSV files with the columns AC_y_mm, AC_z_mm and TS_x_mm (thorax
    frame, right shoulder) and, if need be, subject, motion, posture and humerus_elevation_deg. The posture is the one
    nearest to the measured angles where the file has them, else to the arm hanging.

    Writes driven.csv (one row a posture: coordinates, six angles, residuals of the constraints A1-A3, status),
    motions.csv (the postures that were reached as a motion file) and run.json. A posture out of reach says which part
    cannot follow: unreachable_AC, _TS, _AI or _conoid.

    With --inverse: motion files in, and in driven.csv the coordinates that the girdle has at the six angles; A1-A3
    then say how far these angles are from closing its chain.
    """
    from adapt.cli.commands.drive_run import drive_motions  # JAX and pandas: not for --help

    drive_motions(motions, out, model, inverse)
