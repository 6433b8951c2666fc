"""``girdle compare`` and ``girdle questions``: the thesis's tables and questions, of any motions and sets."""

from typing import Annotated

import typer

from adapt.cli.ending import finish
from adapt.cli.inputs import SIX, asked_models, read_inputs
from adapt.cli.options import Angles, Models, ModelsOf, MotionFiles, Out, Repeat, console, errors
from adapt.cli.terminal.print_tables import progress
from adapt.cli.terminal.print_thesis import print_answers, print_comparison
from adapt.output.large_runs.parts import not_adapted
from adapt.output.run_files import results_folder, transaction, write_run, write_table
from adapt.trust.questions.answers import answered, answers_table
from adapt.trust.thesis.comparison import MotionNames, comparison, lacking

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
    table, models, record = read_inputs(motions, asked_models(model, models_of), angles)
    names = MotionNames.of(table, abduction, flexion)
    with results_folder(out) as folder:
        with progress(errors) as report:
            found = comparison(table, models, names, mean, report)
        with transaction(folder) as part:
            write_table(found.table, part / "comparison.csv")
            options = {"mean": mean, "abduction": abduction, "flexion": flexion, "angles": angles}
            write_run(part, "compare", record, options, table.rejected)
    print_comparison(console, found.table)
    failed = {} if found.adaptations is None else not_adapted(found.adaptations)
    finish(table, lacking(table, names, mean) | failed)


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
    table, models, record = read_inputs(motions, asked_models(model, models_of))
    with results_folder(out) as folder:
        with progress(errors) as report:
            found = answered(table, models, mean, report)
        with transaction(folder) as part:
            write_table(answers_table(found), part / "questions.csv")
            write_run(part, "questions", record, {"mean": mean}, table.rejected)
    print_answers(console, found)
    finish(table, found.left_out)
