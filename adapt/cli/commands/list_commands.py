"""``girdle models``, ``girdle effects``, ``girdle simulate`` and ``girdle doctor``: their options and help."""

from typing import Annotated

import typer

from adapt.cli.choices import DEFAULT_MODEL, NO_EFFECT
from adapt.cli.options import Out, Repeat


def list_models() -> None:
    """List the parameter sets, one line each."""
    from adapt.cli.commands.list_runs import print_models  # JAX: not for --help

    print_models()


def simulate(
    out: Out,
    model: Annotated[str, typer.Option(help="Name of a parameter set or a TOML file.")] = DEFAULT_MODEL,
    effect: Annotated[str, typer.Option(help="An effect of `girdle effects`, or none.")] = NO_EFFECT,
    subjects: Annotated[int, typer.Option(min=1, help="How many subjects.")] = 10,
    noise_deg: Annotated[float, typer.Option(min=0.0, max=90.0, help="SD of the noise on each angle, degrees.")] = 1.5,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same subjects.")] = 0,
    repeat: Repeat = None,
) -> None:
    """Simulate subjects with the model, an active unmodelled effect, and noise.

    Writes motions.csv (what a laboratory would have measured; every row says it is simulated), truth.csv (the
    parameters and amplitudes behind it, one row a subject) and run.json.
    """
    from adapt.cli.commands.list_runs import simulate_subjects  # JAX and pandas: not for --help

    simulate_subjects(out, model, effect, subjects, noise_deg, seed)


def list_effects() -> None:
    """List the candidate effects, one line each: what it changes, its typical size, and what --effect takes.

    The size is the SD, before any data, of the root mean square over the postures of what it does beyond a constant.
    --effect takes an amplitude for each direction, in this order; of one over elevation that at 150 degrees.
    """
    from adapt.cli.commands.list_runs import print_effects  # JAX: not for --help

    print_effects()


def doctor() -> None:
    """Say what is installed, what is kept between runs, and what is missing with the command that mends it.

    Exit status: 0 girdle can work, 1 something that it needs is missing.
    """
    from adapt.cli.doctor import print_findings  # it asks for every package: not for --help

    print_findings()
