"""Command line: ``girdle fit | adapt | diagnose | trust | muscles | convert | model | simulate | ...``."""

import sys
import warnings
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand

from adapt.cli.commands.app_command import open_app
from adapt.cli.commands.assess_commands import diagnose_gap, muscle_results, trust_results
from adapt.cli.commands.drive_command import drive_girdle
from adapt.cli.commands.fit_commands import adapt, fit
from adapt.cli.commands.list_commands import doctor, list_effects, list_models, simulate
from adapt.cli.commands.thesis_commands import compare, questions
from adapt.cli.ending import EXIT_BAD_INPUT, EXIT_INTERRUPTED, is_out_of_memory, out_of_memory, watch_stdin
from adapt.cli.landmarks.check_command import check
from adapt.cli.landmarks.landmark_commands import contours_of_slices, convert_file, model_of_person
from adapt.cli.landmarks.transfer_command import transfer
from adapt.cli.options import console, errors
from adapt.engine.compilation_cache import keep_compiled
from motions import InputError
from motions.errors import InputWarning

FIRST_LINES = """\
girdle convert TRIAL.trc motions.csv       # landmarks of your laboratory to angles of clavicle and scapula
girdle adapt motions.csv --out results     # the model fitted to each person: open results/report.html
girdle diagnose motions.csv --out why      # why model and measurement still differ: open why/report.html
More: girdle --help, girdle COMMAND --help, girdle doctor"""
"""Text that ``girdle`` prints without a command: the main job in three lines."""


class OnceCommand(TyperCommand):
    """Command that refuses a repeated option with a single value, of which the last would win silently."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as typer does, after a check for repeated options, which typer does not make."""
        if not ctx.resilient_parsing:
            _, _, given = self.make_parser(ctx).parse_args(args=list(args))
            for one in given:
                single = not getattr(one, "multiple", True) and not getattr(one, "is_flag", False)
                if single and given.count(one) > 1:
                    ctx.fail(f"{one.opts[0]} is there {given.count(one)} times. Give it once.")
        return super().parse_args(ctx, args)


app = typer.Typer(
    rich_markup_mode="markdown",
    help="""Fit the shoulder girdle model to measured motions, adapt it to each person, and say why they still differ.

A motion file is a CSV with one row per posture: subject, motion, posture, humerus_elevation_deg and the six
Cardan angles clavicle_y_deg ... scapula_x_deg (right shoulder, thorax frame, degrees).

Exit status: 0 every subject was handled, 3 some were not (named on stderr and in the files), 2 bad input, 130
interrupted (earlier results are unchanged).""",
)

for name, command in {
    "fit": fit,
    "adapt": adapt,
    "diagnose": diagnose_gap,
    "trust": trust_results,
    "muscles": muscle_results,
    "convert": convert_file,
    "model": model_of_person,
    "contour": contours_of_slices,
    "transfer": transfer,
    "check": check,
    "models": list_models,
    "simulate": simulate,
    "drive": drive_girdle,
    "compare": compare,
    "questions": questions,
    "effects": list_effects,
    "app": open_app,
    "doctor": doctor,
}.items():
    app.command(name, cls=OnceCommand)(command)


def _say_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version  # would cost 30 ms at every start

        console.print(f"girdle {version('girdle')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def first_lines(
    context: typer.Context,
    _version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Print how to begin, where no command is given."""
    if context.invoked_subcommand is None:
        console.print(FIRST_LINES, soft_wrap=True)


def _show_warning(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """Print an ``InputWarning`` as one line; show any other warning as Python does."""
    if issubclass(category, InputWarning):
        errors.print(f"warning: {message}", soft_wrap=True)
    else:
        _python_shows(message, category, *where)


_python_shows = warnings.showwarning


def _refuse(error: InputError) -> NoReturn:
    errors.print(f"error: {error}", soft_wrap=True)
    sys.exit(EXIT_BAD_INPUT)


def main(application: typer.Typer = app) -> None:
    """Run the command line with the cache of compiled code; bad input gives one message and exit status 2."""
    watch_stdin()
    keep_compiled()
    try:
        with warnings.catch_warnings(action="always", category=InputWarning):
            warnings.showwarning = _show_warning
            application()
    except InputError as error:
        _refuse(error)
    except Exception as error:
        if not is_out_of_memory(error):
            raise
        _refuse(out_of_memory())
    except SystemExit as ended:
        if ended.code == EXIT_INTERRUPTED:  # typer's exit on Ctrl-C, which prints nothing
            errors.print("interrupted")
        raise
