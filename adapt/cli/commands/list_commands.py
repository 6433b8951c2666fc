"""``girdle models``, ``girdle effects`` and ``girdle simulate``: what there is, and subjects made of it."""

from typing import Annotated

import numpy as np
import typer

from adapt.cli.options import Out, Repeat, console, errors
from adapt.cli.terminal.print_tables import progress
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.output.run_files import inputs_record, results_folder, transaction, write_run, write_table
from models import load_model, model_names
from models.effects import EFFECTS, Effect
from models.effects.amplitudes import OPTION, effect_named
from models.effects.course import FULL_ELEVATION_DEG, OverElevation
from motions import write_motions

NO_EFFECT = "none"

NO_UNIT = "1"
"""Of an effect that has none."""


def list_models() -> None:
    """List the parameter sets, one line each."""
    for name in model_names():
        girdle = load_model(name).girdle
        axes = ", ".join(f"{a:.0f}" for a in girdle.semi_axes_mm)
        console.print(
            f"{name:22} clavicle {float(np.linalg.norm(girdle.ac_mm)):.0f} mm, semi-axes ({axes}) mm, "
            f"conoid {float(girdle.conoid_length_mm):.1f} mm",
            soft_wrap=True,
        )


def simulate(
    out: Out,
    model: Annotated[str, typer.Option(help="Name of a parameter set or a TOML file.")] = "R2",
    effect: Annotated[str, typer.Option(help="An effect of `girdle effects`, or none.")] = "none",
    subjects: Annotated[int, typer.Option(min=1, help="How many subjects.")] = 10,
    noise_deg: Annotated[float, typer.Option(min=0.0, max=90.0, help="SD of the noise on each angle, degrees.")] = 1.5,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same subjects.")] = 0,
    repeat: Repeat = None,
) -> None:
    """Simulate subjects with the model, an active unmodelled effect, and noise.

    Writes motions.csv (what a laboratory would have measured; every row says it is simulated), truth.csv (the
    parameters and amplitudes behind it, one row a subject) and run.json.
    """
    hidden = None if effect == NO_EFFECT else effect_named(effect, OPTION, NO_EFFECT)
    record, parameters = inputs_record([], [model]), load_model(model)
    options = {"effect": effect, "subjects": subjects, "noise_deg": noise_deg, "seed": seed}
    with results_folder(out) as folder:
        with progress(errors) as report:
            report("simulating")
            result = simulate_model_subjects(parameters, hidden, subjects, noise_deg, seed)
        with transaction(folder) as part:
            write_motions(result.motions, part / "motions.csv")
            write_table(result.truth, part / "truth.csv")
            write_run(part, "simulate", record, options)
    console.print(
        f"{len(result.motions.posture)} simulated postures of {subjects} subjects in {folder / 'motions.csv'}"
    )


def list_effects() -> None:
    """List the candidate effects, one line each: what it changes, its typical size, and what --effect takes.

    The size is the SD, before any data, of the root mean square over the postures of what it does beyond a constant.
    --effect takes an amplitude for each direction, in this order; of one over elevation that at 150 degrees.
    """
    for one in EFFECTS.values():
        scale = " / ".join(f"{value:.2g}" for value in one.prior.scale)
        option = f"{OPTION} {one.name}={_places(one)} in {_unit(one)}"
        size = scale if one.size_unit == NO_UNIT else f"{scale} {one.size_unit}"
        console.print(f"{one.name:28} {one.what}; size {size}; {option}", soft_wrap=True)


def _places(effect: Effect) -> str:
    """Where the amplitude of each direction stands: 'ALONG,UP,BACK'."""
    return ",".join(direction.upper().replace(" ", "_") for direction in effect.directions)


def _unit(effect: Effect) -> str:
    """The unit of an amplitude in words; of an effect over elevation, where it holds."""
    over = isinstance(effect.course, OverElevation)
    if effect.unit == NO_UNIT:
        return "no unit"
    if effect.unit.startswith("of "):
        return f"parts {effect.unit}"
    return f"{effect.unit}, at {FULL_ELEVATION_DEG:g} degrees of elevation" if over else effect.unit
