"""Runs of ``girdle models``, ``girdle effects`` and ``girdle simulate``."""

from pathlib import Path

import numpy as np

from adapt.cli.choices import NO_EFFECT
from adapt.cli.options import console, errors
from adapt.cli.terminal.console import progress
from models import load_model, model_names
from models.effects import EFFECTS, Effect
from models.effects.amplitudes import OPTION, effect_named
from models.effects.basis import FULL_ELEVATION_DEG, OverElevation
from motions import write_motions

NO_UNIT = "1"
"""Unit of an effect that has none."""


def print_models() -> None:
    """Print the parameter sets, one line each."""
    for name in model_names():
        girdle = load_model(name).girdle
        axes = ", ".join(f"{a:.0f}" for a in girdle.semi_axes_mm)
        console.print(
            f"{name:22} clavicle {float(np.linalg.norm(girdle.ac_mm)):.0f} mm, semi-axes ({axes}) mm, "
            f"conoid {float(girdle.conoid_length_mm):.1f} mm",
            soft_wrap=True,
        )


def simulate_subjects(out: Path, model: str, effect: str, subjects: int, noise_deg: float, seed: int) -> None:
    """Simulate subjects and write the files of ``girdle simulate``."""
    from adapt.evaluation.model_subjects import simulate_model_subjects  # not for lists: the compiler and its solvers
    from adapt.output.run_files import inputs_record, results_folder, transaction, write_run, write_table

    hidden = None if effect == NO_EFFECT else effect_named(effect, OPTION, NO_EFFECT)
    record, parameters = inputs_record([], [model]), load_model(model)
    options = {"effect": effect, "subjects": subjects, "noise_deg": noise_deg, "seed": seed}
    with results_folder(out) as folder:
        with progress(errors) as report:
            report("simulating")
            result = simulate_model_subjects(parameters, hidden, subjects, noise_deg, seed)
        with transaction(folder) as staged:
            write_motions(result.motions, staged / "motions.csv")
            write_table(result.truth, staged / "truth.csv")
            write_run(staged, "simulate", record, options)
    console.print(
        f"{len(result.motions.posture)} simulated postures of {subjects} subjects in {folder / 'motions.csv'}"
    )


def print_effects() -> None:
    """Print the candidate effects, one line each."""
    for one in EFFECTS.values():
        scale = " / ".join(f"{value:.2g}" for value in one.prior.scale)
        option = f"{OPTION} {one.name}={amplitude_places(one)} in {amplitude_unit(one)}"
        size = scale if one.size_unit == NO_UNIT else f"{scale} {one.size_unit}"
        console.print(f"{one.name:28} {one.what}; size {size}; {option}", soft_wrap=True)


def amplitude_places(effect: Effect) -> str:
    """Write a placeholder for the amplitude of each direction: 'ALONG,UP,BACK'."""
    return ",".join(direction.upper().replace(" ", "_") for direction in effect.directions)


def amplitude_unit(effect: Effect) -> str:
    """Write the unit of an amplitude in words, with the elevation at which an amplitude over elevation holds."""
    over = isinstance(effect.basis, OverElevation)
    if effect.unit == NO_UNIT:
        return "no unit"
    if effect.unit.startswith("of "):
        return f"parts {effect.unit}"
    return f"{effect.unit}, at {FULL_ELEVATION_DEG:g} degrees of elevation" if over else effect.unit
