"""``girdle diagnose``, ``girdle trust`` and ``girdle muscles``: what to think of an adaptation."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from adapt.api import adapt_subjects, adapt_with_every_fold
from adapt.cli.ending import finish, say_report
from adapt.cli.inputs import asked_models, read_inputs
from adapt.cli.options import (
    EFFECTS_OF_OPTION,
    Models,
    ModelsOf,
    MotionFiles,
    Out,
    OwnBones,
    Repeat,
    ShowTables,
    Weight,
    console,
    errors,
)
from adapt.cli.terminal.print_diagnosis import print_diagnosis
from adapt.cli.terminal.print_muscles import print_muscles
from adapt.cli.terminal.print_tables import progress
from adapt.cli.terminal.print_trust import print_trust
from adapt.diagnosis import Diagnoses, diagnose
from adapt.diagnosis.fit.noise import LEAST_DEG
from adapt.diagnosis.position_findings import USES, check_use
from adapt.diagnosis.texts.json_form import as_json
from adapt.evaluation.held_out import sample
from adapt.output.large_runs.parts import not_adapted
from adapt.output.result_files import write_adaptations, write_figures, write_positions, write_report
from adapt.output.run_files import results_folder, transaction, write_json, write_run, write_table
from adapt.solvers.objective import WEIGHT
from adapt.tables.held_out import fewest_parts
from adapt.tables.muscle_tables import BODY_MASS_KG, muscle_tables
from adapt.trust.assessment import assess_trust
from models.muscles.muscle_lines import muscle_lines_of
from motions import InputError
from motions.landmarks.humerus_pose import humerus_pose

MOST_NOISE_DEG = 20.0
"""Noise beyond this, or below what a diagnosis can estimate, is a slip of the pen: every posture would be within it, or
none."""

HEAVIEST_LOAD_KG = 100.0
"""Nobody holds more with a straight arm: it is a slip of the pen."""

HEAVIEST_KG = 700.0
"""The heaviest person on record had some 635 kg (Guinness World Records): more is a slip of the pen, or no number."""


def diagnose_gap(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    noise_deg: Annotated[
        float | None,
        typer.Option(
            help="SD of the noise on one measured angle, degrees, if you know it, say from repeated measurements. "
            "Default: estimated from what no smooth effect could cause.",
            show_default=False,
        ),
    ] = None,
    positions: Annotated[
        str,
        typer.Option(
            metavar="|".join(USES),
            help="Positions of landmarks in the motion files: use them; check the diagnosis by them, which does not "
            "see them; or ignore them.",
        ),
    ] = USES[0],
    position_noise_mm: Annotated[
        float | None,
        typer.Option(
            help="SD of the noise on one measured coordinate of a landmark, mm, if you know it. Default: estimated.",
            show_default=False,
        ),
    ] = None,
    tables: ShowTables = False,
    repeat: Repeat = None,
) -> None:
    """Say why the adapted model and the measurements still differ: what gap is left, where, and what causes it.

    Looks for the causes of `girdle effects`, several at once, that predict motions and persons that were not fitted.
    The answer is **none** (nothing beyond noise), **effect** (one cause or more, each with the names that these data
    cannot tell apart) or **unknown** (no candidate predicts better). With it come the size of each cause, what it was
    tested on, what to measure next, and the command that adapts with the causes. --tables adds the inclusion
    probabilities and the gap budget (what adaptation, each cause and noise take of the gap on held-out motions).

    More subjects and more kinds of motion help most: the same causes are sought in all of them. A subject with fewer
    than four postures is left out.

    Writes diagnosis.json (everything), budget.svg (what takes the gap away), inclusion.svg (how probably each candidate
    is active), gap_heatmap.svg (where the gap is), gaps.svg (how far it shrinks), positions.csv (where landmarks
    are simulated and were measured), the tables of `girdle adapt`, run.json and report.html (the page to look at).
    With several models the figures are those of the model with the smallest gap after adaptation.
    """
    if noise_deg is not None and not LEAST_DEG <= noise_deg <= MOST_NOISE_DEG:
        cause = f"{noise_deg:g} is not between {LEAST_DEG:g} and {MOST_NOISE_DEG:g} degrees"
        raise InputError("--noise-deg", None, cause, "Give the SD of one angle in degrees, or leave it to be estimated")
    check_use(positions, position_noise_mm)
    asked = asked_models(model, models_of)
    table, models, record = read_inputs(motions, asked)
    with results_folder(out) as folder:
        with progress(errors) as report:
            result = adapt_with_every_fold(table, models, progress=report)
            given = {"noise_deg": noise_deg, "positions": positions, "position_noise_mm": position_noise_mm}
            diagnoses = Diagnoses(diagnose(table, models, progress=report, adaptations=result, **given))
            result = replace(result, heldout=fewest_parts(result.heldout, sample(table.subjects)))
            report("figures")
            with transaction(folder) as part:
                write_figures(part, diagnoses.closest)
                write_json(as_json(diagnoses), part / "diagnosis.json")
                write_adaptations(part, result)
                write_positions(part, diagnoses)
                write_run(part, "diagnose", record, given, table.rejected)
                failed = not_adapted(result) | diagnoses.closest.left_out
                wrong = write_report(part, table, models, result, failed, diagnoses=diagnoses)
        sets = {one.name: name for one, name in zip(models, asked, strict=True)}
        print_diagnosis(console, diagnoses, tables, _next_command(diagnoses, motions, sets, out))
        say_report(folder, wrong)
    finish(table, failed)


def _next_command(diagnoses: Diagnoses, motions: Sequence[Path], sets: Mapping[str, str], out: Path) -> str:
    """Write the command that adapts the same motions with own bones and, where there are any, with the causes."""
    asked = sets[diagnoses.closest.model]
    model = ("--models-of" if Path(asked).is_dir() else "--model", asked)
    causes = (EFFECTS_OF_OPTION, str(out)) if diagnoses.closest.options else ()
    to = str(out.with_name(f"{out.name}_adapted"))
    return shlex.join(["girdle", "adapt", *map(str, motions), *model, "--own-bones", *causes, "--out", to])


def trust_results(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    choose_weight: Annotated[
        bool, typer.Option("--choose-weight", help="Try other w too, and say which is best on held-out motions.")
    ] = False,
    own_bones: OwnBones = False,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and say how far the result can be trusted.

    Writes trust.csv (one row a subject: gaps in sample and held out, flat directions, warnings), uncertainty.csv (an
    interval for each parameter), heldout.csv (the gap on each motion and third of the postures, adapted without them),
    plausibility.csv (are size and place a thorax's; do contact and conoid keep their directions, the serratus its
    arms?), contact.csv (directions and arms of contact and conoid in each posture), with --choose-weight weights.csv,
    the tables of `girdle adapt` and run.json.
    """
    table, models, record = read_inputs(motions, asked_models(model, models_of))
    with results_folder(out) as folder:
        with progress(errors) as report:
            found = assess_trust(table, models, weight, choose_weight, report, own_bones)
        with transaction(folder) as part:
            write_adaptations(part, found.adaptations)
            for name in ("uncertainty", "plausibility", "contact"):
                write_table(getattr(found, name), part / f"{name}.csv")
            write_table(found.subjects, part / "trust.csv")
            if found.weights is not None:
                write_table(found.weights, part / "weights.csv")
            options = {"weight": weight, "choose_weight": choose_weight, "own_bones": own_bones}
            write_run(part, "trust", record, options, table.rejected)
    print_trust(console, found)
    finish(table, not_adapted(found.adaptations))


def muscle_results(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    body_mass_kg: Annotated[
        float, typer.Option(min=1.0, max=HEAVIEST_KG, help="Of the persons: an arm weighs a twentieth of it.")
    ] = BODY_MASS_KG,
    load_kg: Annotated[
        float, typer.Option(min=0.0, max=HEAVIEST_LOAD_KG, help="Held in the hand, with the elbow straight.")
    ] = 0.0,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and compare muscle arms and the forces that hold the arm before and after.

    About SC, AC and GH. Needs how the humerus was held: from GH, EM and EL in the motion file, its columns
    humerus_plane_deg and humerus_axial_deg, or, assumed, from the name of the motion; balance.csv says which.

    Writes muscle_arms.csv (one row a subject and muscle), muscles.csv and balance.csv (one row a posture),
    muscle_lines.csv (one row a posture and line), muscle_arms.svg, the tables of `girdle adapt`, run.json and
    report.html (the page to look at: lines on the ellipsoid, arms over elevation).
    """
    from adapt.output.muscle_files import write_muscles  # matplotlib takes half a second to load: not for every command

    table, models, record = read_inputs(motions, asked_models(model, models_of))
    for one in models:
        muscle_lines_of(one, table.subjects)  # refuses a set without landmarks before anything is fitted
    humerus_pose(table)  # and a column without numbers
    with results_folder(out) as folder:
        with progress(errors) as report:
            result = adapt_subjects(table, models, weight, progress=report)
            report("muscles")
            found = muscle_tables(models, result.fits, result.parameters, body_mass_kg, load_kg, table)
            report("writing")
            with transaction(folder) as part:
                write_adaptations(part, result)
                write_muscles(part, found)
                options: dict[str, object] = {"weight": weight, "body_mass_kg": body_mass_kg, "load_kg": load_kg}
                write_run(part, "muscles", record, options, table.rejected)
                wrong = write_report(part, table, models, result, not_adapted(result), muscles=found)
        print_muscles(console, found)
        say_report(folder, wrong)
    finish(table, not_adapted(result))
