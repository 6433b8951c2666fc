"""Options and help of ``girdle compare`` and ``girdle questions``."""

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
    """Make Tables 3.4, 3.5 and 6.1-6.6 of the thesis from your motions and sets, beside the printed ones.

    Tables 6.1-6.6: every set is adapted to abduction and flexion of a subject together; the gaps are those in
    abduction. Tables 3.4 and 3.5: mean motions (--mean), with the sets as they are. Printed numbers are there for R2,
    R4 and R6.

    Writes comparison.csv (one row per number: table, source (thesis or girdle), model, row (subject or statistic),
    quantity, unit, value, sd) and run.json.
    """
    from adapt.cli.commands.thesis_runs import compare_with_thesis  # slow import: JAX and pandas

    compare_with_thesis(motions, out, asked_models(model, models_of), mean, abduction, flexion, angles)


def questions(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    mean: Means = [],  # noqa: B006
    repeat: Repeat = None,
) -> None:
    """Answer the questions of the thesis's chapter 7 from measured motions.

    Do TS and AI keep a constant distance to the thorax? Is a scapulo-humeral rhythm enough, or should scapula and
    clavicle be measured? Does each posture need its own ellipsoid? Postures need all six angles and an elevation of the
    arm. Intervals are 95 % t intervals over persons; left and right shoulder of one person count as one.

    Writes questions.csv (one row per number: question, model, case, quantity, unit, who (persons, or the group mean),
    value, low, high) and run.json.
    """
    from adapt.cli.commands.thesis_runs import answer_questions  # slow import: JAX and pandas

    answer_questions(motions, out, asked_models(model, models_of), mean)
