"""``girdle fit`` and ``girdle adapt``."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import Annotated

import numpy as np
import typer

from adapt.api import check_own_bones, fit_postures
from adapt.cli.commands.known_effects import Known, effects_of, read_known, say_known
from adapt.cli.ending import finish, say_report
from adapt.cli.inputs import (
    SIX,
    asked_models,
    check_angles,
    load_models,
    not_empty,
    read_inputs,
    subjects_without_set,
    with_angles,
    without_subjects,
)
from adapt.cli.options import (
    Angles,
    EffectsOf,
    Float32,
    KnownEffects,
    Models,
    ModelsOf,
    MotionFiles,
    Objective,
    Out,
    OwnBones,
    Repeat,
    ShowTables,
    ThoraxDownweighting,
    Weight,
    console,
    errors,
)
from adapt.cli.terminal.print_tables import (
    print_heldout,
    print_own_bones,
    print_parameters,
    print_summary,
    print_without_landmarks,
    progress,
)
from adapt.cli.terminal.print_verdict import print_verdicts
from adapt.evaluation.held_out import sample
from adapt.output.adapted_models import OWN_BONES, write_adapted_models
from adapt.output.large_runs.dask_cluster import on_cluster
from adapt.output.large_runs.local_processes import on_this_machine
from adapt.output.large_runs.parts import LANES, MOST_SHOWN, Parts, Work, failed_subjects
from adapt.output.result_files import write_fits, write_report
from adapt.output.run_files import inputs_record, results_folder, run_key, transaction, write_run
from adapt.own_bones.own_adaptation import People, learn_people
from adapt.own_bones.own_adaptation import sample as own_sample
from adapt.solvers.objective import DEFAULT_OBJECTIVE, OBJECTIVES, WEIGHT
from adapt.solvers.rows import posture_rows
from adapt.tables.results import Tables
from models.effects.amplitudes import described
from models.person.family import AnyModel
from motions import InputError, MotionStream
from motions.table import Motions, warn_of_alike_motions


def fit(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    float32: Float32 = False,
    angles: Angles = SIX,
    effect: KnownEffects = [],  # noqa: B006
    effects_of_folder: EffectsOf = None,
    repeat: Repeat = None,
) -> None:
    """Fit every posture with the models as they are (Tables 6.1 and 6.2).

    Writes fits.csv (one row a posture), summary.csv (subjects by angles) and run.json.
    """
    effect = [*effects_of(effects_of_folder), *effect]
    effects = read_known(effect).effects  # without adaptation there are no thorax points to weigh
    table, models, record = read_inputs(motions, asked_models(model, models_of), angles)
    with results_folder(out) as folder:
        with progress(errors) as report:
            result = fit_postures(table, models, report, np.float32 if float32 else np.float64, effects)
        with transaction(folder) as part:
            write_fits(part, result)
            options = {"float32": float32, "angles": angles, "effect": effect}
            write_run(part, "fit", record, options, table.rejected)
    print_summary(console, result.summary)
    say_known(Known(effects))
    finish(table, failed_subjects(result.fits))


def adapt(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    reading: Objective = DEFAULT_OBJECTIVE,
    chunk: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="SUBJECTS",
            help=f"Subjects worked on at a time; results do not depend on it. Default: {LANES} by number of models.",
            show_default=False,
        ),
    ] = None,
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster that does the work, as tcp://host:8786.")
    ] = "",
    float32: Float32 = False,
    angles: Angles = SIX,
    effect: KnownEffects = [],  # noqa: B006
    effects_of_folder: EffectsOf = None,
    thorax_downweighting: ThoraxDownweighting = 1.0,
    own_bones: OwnBones = False,
    tables: ShowTables = False,
    repeat: Repeat = None,
) -> None:
    """Adapt thorax ellipsoid and conoid to each subject, over all its motions together (Tables 6.1-6.6).

    Writes fits.csv (before and after), parameters.csv (one row a subject), summary.csv, heldout.csv (the gap on each
    motion, adapted without it), run.json, report.html (the page to look at) and, in models/, each adapted model as a
    TOML file that --model takes. Where positions of SC, AC, TS, AI or AA were measured, positions.csv too.

    Any number of subjects is worked on in parts, in bounded memory; a run that was stopped goes on where it was.
    """
    _check_objective(reading)
    check_angles(angles)
    effect = [*effects_of(effects_of_folder), *effect]
    known = read_known(effect, thorax_downweighting)
    named = asked_models(model, models_of)
    record, models, files = inputs_record(motions, named), load_models(named), MotionStream(*motions)
    options: dict[str, object] = {
        "weight": weight,
        "reading": reading,
        "float32": float32,
        "angles": angles,
        "effect": effect,
        "thorax_downweighting": thorax_downweighting,
        "own_bones": own_bones,
    }
    missing = subjects_without_set(models, files.subjects)
    subjects = tuple(name for name in files.subjects if name not in missing)
    size = chunk or max(1, LANES // len(models))
    shown = frozenset(subjects) if len(subjects) <= size else sample(subjects, MOST_SHOWN)
    held_out, less = sample(subjects), known.thorax_downweighting
    people = None
    if own_bones:
        check_own_bones(known.effects, reading, less)
        people = _people(files, missing, subjects, models, known, angles)
    work = Work(tuple(models), weight, reading, shown, held_out, float32, known.effects, less, people)
    maker = on_cluster(dask) if dask else on_this_machine(len(subjects) // size)
    chunks = _chunks(files, missing, angles, size)  # bad input is found before a folder is made for it
    with results_folder(out) as folder:
        parts = Parts(folder, run_key(record, options | {"chunk": size}))
        with progress(errors) as report:
            table = parts.make(work, chunks, maker, report)
            report("writing")
            with transaction(folder) as part:
                result, failed = parts.merge(part, work)
                write_adapted_models(part, models, result.parameters, _in_words(work, angles, known))
                table = replace(table, rejected=(*files.rejected, *missing.values()))
                write_run(part, "adapt", record, options, table.rejected)
                wrong = write_report(
                    part,
                    table,
                    models,
                    result.select(table.subjects),
                    failed,
                    sampled_from=len(subjects),
                    active_effects=described(known.effects),
                    thorax_downweighting=less,
                )
        _print_results(result, work, known, tables=tables)
        say_report(folder, wrong)
    finish(table, failed)


def _check_objective(reading: str) -> None:
    if reading not in OBJECTIVES:
        raise InputError("--objective", None, f"unknown variant '{reading}'", f"Use one of {', '.join(OBJECTIVES)}")


def _chunks(files: MotionStream, missing: dict[str, InputError], angles: str, size: int) -> Iterator[Motions]:
    """Read so many subjects at a time, the first at once."""
    parts = (without_subjects(part, missing) for part in files.in_chunks(size))
    chunks = (one for one in (with_angles(part, angles) for part in parts) if len(one.posture))
    first = not_empty(next(chunks, None), angles)
    warn_of_alike_motions(first, "the motions")
    return chain([first], chunks)


def _in_words(work: Work, angles: str, known: Known) -> str:
    """How the models were adapted."""
    of_angles = [] if angles == SIX else [f"{angles} angles"]
    own_bones = [] if work.people is None else [OWN_BONES]
    return ", ".join([f"w = {work.weight:g}", f"objective {work.reading}", *of_angles, *own_bones, *known.texts])


def _print_results(result: Tables, work: Work, known: Known, *, tables: bool) -> None:
    if tables:
        _print_tables(result)
    if work.people is not None:
        print_own_bones(console, result.parameters)
    say_known(known)
    if OBJECTIVES[work.reading].landmarks:
        print_without_landmarks(console, result.parameters)
    print_verdicts(console, result)


def _people(
    files: MotionStream,
    missing: dict[str, InputError],
    subjects: Sequence[str],
    models: list[AnyModel],
    known: Known,
    angles: str,
) -> People:
    """Learn how the persons of the whole run differ, so that no part depends on how many there are."""
    chosen = list(own_sample(subjects))
    parts = (without_subjects(part, missing) for part in files.in_chunks(LANES))
    motions = with_angles(Motions.concatenate([part.select(np.isin(part.subject, chosen)) for part in parts]), angles)
    with progress(errors) as report:
        report("how persons differ")
        return learn_people(posture_rows(motions, known.effects), models)


def _print_tables(result: Tables) -> None:
    print_summary(console, result.summary)
    print_parameters(console, result.parameters)
    print_heldout(console, result.heldout, len(set(result.parameters["subject"])))
