"""Run `girdle adapt` on all motion files (*.csv) of a folder, with the same tables, files and exit statuses."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from adapt.cli import app as cli
from adapt.cli import options
from adapt.cli.commands.fit_commands import adapt
from adapt.cli.ending import EXIT_SOME_NOT_HANDLED
from adapt.solvers.objective import DEFAULT_OBJECTIVE, WEIGHT
from motions import InputError

app = typer.Typer(add_completion=False)


@app.command()
def batch(
    folder: Annotated[Path, typer.Argument(help="Folder of the subjects' motion files, *.csv.")],
    out: options.Out,
    model: options.Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: options.ModelsOf = [],  # noqa: B006
    weight: options.Weight = WEIGHT,
    objective: options.Objective = DEFAULT_OBJECTIVE,
    float32: options.Float32 = False,
    effect: options.KnownEffects = [],  # noqa: B006
) -> None:
    """Adapt the models to every subject in a folder. A file that cannot be read is named and left out."""
    found = sorted(folder.glob("*.csv"))
    files = [path for path in found if path.is_file()]
    if not files:
        raise InputError(str(folder), None, "there is no motion file (*.csv) here", "Name the folder that holds them")
    if out.exists() and out.samefile(folder):
        cause = "the results would be taken for motion files the next time"
        raise InputError(str(out), None, cause, "Give another folder with --out")
    unreachable = [path for path in found if not path.is_file()]
    for path in unreachable:
        print(f"left out: {path}: there is no file behind this name. Remove it.", file=sys.stderr)
    adapt(files, out, model, models_of, weight, objective, float32=float32, effect=effect)
    if unreachable:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)


if __name__ == "__main__":
    cli.main(app)
