"""Options and help of ``girdle models``, ``girdle effects``, ``girdle simulate`` and ``girdle doctor``."""

from typing import Annotated

import typer

from adapt.cli.choices import DEFAULT_MODEL, NO_EFFECT
from adapt.cli.options import Out, Repeat


def list_models() -> None:
    """List the parameter sets, one line each."""
    from adapt.cli.commands.list_runs import print_models  # slow import: JAX

    print_models()


def simulate(
    out: Out,
    model: Annotated[str, typer.Option(help="Name of a parameter set or a TOML file.")] = DEFAULT_MODEL,
    effect: Annotated[str, typer.Option(help="An effect of `girdle effects`, or none.")] = NO_EFFECT,
    subjects: Annotated[int, typer.Option(min=1, help="Number of subjects.")] = 10,
    noise_deg: Annotated[float, typer.Option(min=0.0, max=90.0, help="SD of the noise on each angle, degrees.")] = 1.5,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same subjects.")] = 0,
    repeat: Repeat = None,
) -> None:
    """Simulate subjects with the model, an active effect that the model leaves out (or none), and noise.

    Writes motions.csv (what a laboratory would have measured; every row is marked as simulated), truth.csv (the true
    parameters and amplitudes, one row per subject) and run.json.
    """
    from adapt.cli.commands.list_runs import simulate_subjects  # slow import: JAX and pandas

    simulate_subjects(out, model, effect, subjects, noise_deg, seed)


def list_effects() -> None:
    """List the candidate effects, one line each: what it changes, its typical size, and its values for --effect.

    The typical size is the prior SD of the root mean square of the effect over the postures, beyond a constant.
    --effect takes an amplitude for each direction, in this order; for an effect over elevation, the amplitude at 150
    degrees.
    """
    from adapt.cli.commands.list_runs import print_effects  # slow import: JAX

    print_effects()


def doctor() -> None:
    """Check the installation: packages, caches between runs, and what is missing, with the command that repairs it.

    Exit status: 0 girdle can work, 1 something that girdle needs is missing.
    """
    from adapt.cli.doctor import print_findings  # looks up every package: not for --help

    raise typer.Exit(print_findings())
