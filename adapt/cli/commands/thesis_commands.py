"""``girdle compare`` and ``girdle questions``: their options and help."""

from typing import Annotated

import typer

from adapt.cli.choices import SIX
from adapt.cli.options import Angles, Models, ModelsOf, MotionFiles, Out, Repeat, asked_models

Means = Annotated[
    list[str],
    typer.Option("--mean", help="Subject that is a group mean and no person; repeatable.", show_default=False),
]


def compare(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    mean: Means = [],  # noqa: B006
    abduction: Annotated[
        str, typer.Option(help="Motion of Tables 3.4 and 6.1-6.4. Default: abduction or frontal_elevation.")
    ] = "",
    flexion: Annotated[
        str,
        typer.Option(
            help="Motion of Table 3.5, the other that is adapted to. Default: forward_flexion or sagittal_elevation."
        ),
    ] = "",
    angles: Angles = SIX,
    repeat: Repeat = None,
) -> None:
    """Make Tables 3.4, 3.5 and 6.1-6.6 of the thesis of your motions and sets, beside the printed ones.

    Tables 6.1-6.6: every set adapted to abduction and flexion of a subject together, and looked at in abduction. Tables
    3.4 and 3.5: mean motions (--mean), the sets as they are. Printed numbers stand beside those of R2, R4 and R6.

    Writes comparison.csv, one row a number: table, source (thesis or girdle), model, row (subject or statistic),
    quantity, unit, value, sd; and run.json.
    """
    from adapt.cli.commands.thesis_runs import compare_with_thesis  # JAX and pandas: not for --help

    compare_with_thesis(motions, out, asked_models(model, models_of), mean, abduction, flexion, angles)


def questions(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    mean: Means = [],  # noqa: B006
    repeat: Repeat = None,
) -> None:
    """Ask measured motions the questions of the thesis's chapter 7.

    Do TS and AI keep a constant distance to the thorax? A scapulo-humeral rhythm, or scapula and clavicle measured? An
    ellipsoid for each posture? Postures need all six angles and an elevation of the arm. Intervals are 95 % t intervals
    over persons; left and right of one person are one.

    Writes questions.csv, one row a number: question, model, case, quantity, unit, who (persons, or the group mean),
    value, low, high; and run.json.
    """
    from adapt.cli.commands.thesis_runs import answer_questions  # JAX and pandas: not for --help

    answer_questions(motions, out, asked_models(model, models_of), mean)
