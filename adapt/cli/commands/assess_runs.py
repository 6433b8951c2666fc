"""Runs of ``girdle diagnose``, ``girdle trust`` and ``girdle muscles``."""

import gc
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from adapt.api import adapt_subjects, adapt_with_every_fold
from adapt.cli.choices import SIX
from adapt.cli.ending import finish, say_report
from adapt.cli.inputs import read_inputs
from adapt.cli.options import EFFECTS_OF_OPTION, console, errors
from adapt.cli.terminal.console import progress
from adapt.cli.terminal.print_diagnosis import print_diagnosis
from adapt.cli.terminal.print_muscles import print_muscles
from adapt.cli.terminal.print_trust import print_trust
from adapt.diagnosis import Diagnoses
from adapt.diagnosis.fit.noise import LEAST_DEG
from adapt.diagnosis.position_findings import check_there, check_use
from adapt.diagnosis.texts.json_form import as_json
from adapt.evaluation.held_out import sample
from adapt.output.large_runs.chunked_run import not_adapted
from adapt.output.large_runs.side_by_side import diagnose_side_by_side
from adapt.output.result_files import write_adaptations, write_figures, write_positions, write_report
from adapt.output.run_files import results_folder, transaction, write_json, write_run, write_table
from adapt.tables.held_out import fewest_folds
from adapt.tables.muscle_tables import muscle_tables
from adapt.trust.assessment import assess_trust
from models.muscles.muscle_lines import muscle_lines_of
from motions import InputError
from motions.landmarks.humerus_pose import humerus_pose

MOST_NOISE_DEG = 20.0
"""Largest noise, degrees. A larger number, or one below what a diagnosis can estimate, is a typing error: every posture
would be within the noise, or none."""


def diagnose_motions(
    motions: list[Path],
    out: Path,
    asked: list[str],
    noise_deg: float | None,
    positions: str,
    position_noise_mm: float | None,
    angles: str,
    tables: bool,
) -> None:
    """Diagnose the gap, write the files of ``girdle diagnose`` and print the diagnosis.

    ``asked``: the models, as given by ``--model`` and ``--models-of``.
    """
    if noise_deg is not None and not LEAST_DEG <= noise_deg <= MOST_NOISE_DEG:
        cause = f"{noise_deg:g} is not between {LEAST_DEG:g} and {MOST_NOISE_DEG:g} degrees"
        raise InputError("--noise-deg", None, cause, "Give the SD of one angle in degrees, or leave it to be estimated")
    check_use(positions, position_noise_mm)
    gc.freeze()  # keeps objects of the imports out of every garbage collection, which saves a tenth of a short run
    table, models, record = read_inputs(motions, asked, angles)
    check_there(table, positions, position_noise_mm)
    with results_folder(out, record, "diagnose") as folder:
        with progress(errors) as report:
            result = adapt_with_every_fold(table, models, progress=report)
            given = {"noise_deg": noise_deg, "positions": positions, "position_noise_mm": position_noise_mm}
            diagnoses = Diagnoses(diagnose_side_by_side(table, models, report, result, **given))
            result = replace(result, heldout=fewest_folds(result.heldout, sample(table.subjects)))
            report("figures")
            with transaction(folder) as staged:
                write_figures(staged, diagnoses.closest)
                write_json(as_json(diagnoses), staged / "diagnosis.json")
                write_adaptations(staged, result)
                write_positions(staged, diagnoses)
                options: dict[str, object] = {**given, "angles": angles}
                write_run(staged, "diagnose", record, options, table.rejected)
                failed = not_adapted(result) | diagnoses.closest.left_out
                wrong = write_report(staged, table, models, result, failed, diagnoses=diagnoses)
        sets = {one.name: name for one, name in zip(models, asked, strict=True)}
        print_diagnosis(console, diagnoses, tables, _next_command(diagnoses, motions, sets, out, angles))
        say_report(folder, wrong)
    finish(table, failed)


def _next_command(
    diagnoses: Diagnoses, motions: Sequence[Path], sets: Mapping[str, str], out: Path, angles: str
) -> str:
    """Write the command that adapts the same motions with own bones and, if there are any, with the causes."""
    asked = sets[diagnoses.closest.model]
    model = ("--models-of" if Path(asked).is_dir() else "--model", asked)
    causes = (EFFECTS_OF_OPTION, str(out)) if diagnoses.closest.options else ()
    fewer = () if angles == SIX else ("--angles", angles)
    to = str(out.with_name(f"{out.name}_adapted"))
    return shlex.join(["girdle", "adapt", *map(str, motions), *model, *fewer, "--own-bones", *causes, "--out", to])


def assess_motions(
    motions: list[Path], out: Path, models: list[str], weight: float, choose_weight: bool, own_bones: bool, angles: str
) -> None:
    """Adapt, write the files of ``girdle trust`` and print how far the result can be trusted."""
    table, sets, record = read_inputs(motions, models, angles)
    with results_folder(out, record, "trust") as folder:
        with progress(errors) as report:
            found = assess_trust(table, sets, weight, choose_weight, report, own_bones)
        with transaction(folder) as staged:
            write_adaptations(staged, found.adaptations)
            for name in ("uncertainty", "plausibility", "contact"):
                write_table(getattr(found, name), staged / f"{name}.csv")
            write_table(found.subjects, staged / "trust.csv")
            if found.weights is not None:
                write_table(found.weights, staged / "weights.csv")
            options = {"weight": weight, "choose_weight": choose_weight, "own_bones": own_bones, "angles": angles}
            write_run(staged, "trust", record, options, table.rejected)
    print_trust(console, found)
    finish(table, not_adapted(found.adaptations))


def compare_muscles(
    motions: list[Path],
    out: Path,
    models: list[str],
    weight: float,
    body_mass_kg: float,
    load_kg: float,
    angles: str,
) -> None:
    """Adapt, write the files of ``girdle muscles`` and print moment arms and forces before and after adaptation."""
    from adapt.output.muscle_files import write_muscles  # matplotlib takes half a second to load: not for every command

    table, sets, record = read_inputs(motions, models, angles)
    for one in sets:
        muscle_lines_of(one, table.subjects)  # raises for a set without landmarks before anything is fitted
    humerus_pose(table)  # raises for a column without numbers
    with results_folder(out, record, "muscles") as folder:
        with progress(errors) as report:
            result = adapt_subjects(table, sets, weight, progress=report)
            report("muscles")
            found = muscle_tables(sets, result.fits, result.parameters, body_mass_kg, load_kg, table)
            report("writing")
            with transaction(folder) as staged:
                write_adaptations(staged, result)
                write_muscles(staged, found)
                options = {"weight": weight, "body_mass_kg": body_mass_kg, "load_kg": load_kg, "angles": angles}
                write_run(staged, "muscles", record, options, table.rejected)
                wrong = write_report(staged, table, sets, result, not_adapted(result), muscles=found)
        print_muscles(console, found)
        say_report(folder, wrong)
    finish(table, not_adapted(result))
