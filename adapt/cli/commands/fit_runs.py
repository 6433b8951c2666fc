"""Runs of ``girdle fit`` and ``girdle adapt``."""

import gc
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from adapt.api import check_own_bones, fit_postures
from adapt.cli.choices import SIX
from adapt.cli.commands.known_effects import Known, read_known, say_known
from adapt.cli.ending import finish, say_report
from adapt.cli.inputs import (
    check_angles,
    load_models,
    not_empty,
    read_inputs,
    subjects_without_set,
    with_angles,
    without_subjects,
)
from adapt.cli.options import console, errors
from adapt.cli.terminal.console import progress
from adapt.cli.terminal.print_tables import (
    print_heldout,
    print_own_bones,
    print_parameters,
    print_summary,
    print_without_landmarks,
)
from adapt.cli.terminal.print_verdict import print_verdicts
from adapt.evaluation.held_out import sample
from adapt.output.adapted_models import OWN_BONES, write_adapted_models
from adapt.output.large_runs.chunked_run import LANES, MOST_SHOWN, ChunkFiles, Merged, Work, failed_subjects
from adapt.output.large_runs.dask_cluster import on_cluster
from adapt.output.large_runs.local_processes import on_this_machine
from adapt.output.result_files import write_fits, write_report
from adapt.output.run_files import inputs_record, results_folder, run_key, transaction, write_run
from adapt.own_bones.own_adaptation import People, learn_people
from adapt.own_bones.own_adaptation import sample as own_sample
from adapt.solvers.objective import OBJECTIVES, check_objective
from adapt.solvers.rows import posture_rows
from models.effects.amplitudes import OPTION, described, warn_of_sizes
from models.person.family import AnyModel
from motions import InputError, MotionStream
from motions.table import Motions, warn_of_alike_motions


def fit_motions(
    motions: list[Path], out: Path, models: list[str], float32: bool, angles: str, effect: list[str]
) -> None:
    """Fit every posture without adaptation, write the files of ``girdle fit`` and print the summary."""
    effects = read_known(effect).effects  # only an adaptation uses the thorax points
    table, sets, record = read_inputs(motions, models, angles)
    with results_folder(out, record, "fit") as folder:
        with progress(errors) as report:
            result = fit_postures(table, sets, report, np.float32 if float32 else np.float64, effects)
        with transaction(folder) as staged:
            write_fits(staged, result)
            options = {"float32": float32, "angles": angles, "effect": effect}
            write_run(staged, "fit", record, options, table.rejected)
    print_summary(console, result.summary, len(table.subjects))
    say_known(Known(effects))
    finish(table, failed_subjects(result.fits))


@dataclass(frozen=True)
class AdaptOptions:
    """Options of ``girdle adapt`` that run.json records, under the same names."""

    weight: float
    objective: str
    float32: bool
    angles: str
    effect: list[str]
    thorax_downweighting: float
    own_bones: bool


def adapt_motions(
    motions: list[Path],
    out: Path,
    named: list[str],
    asked: AdaptOptions,
    chunk: int | None = None,
    dask: str = "",
    tables: bool = False,
) -> None:
    """Adapt the models to each subject, write the files of ``girdle adapt`` and print a verdict per parameter set.

    ``named``: the models, as given by ``--model`` and ``--models-of``. ``chunk``: number of subjects worked on at a
    time. ``dask``: address of a scheduler. ``tables``: True to print the tables too.
    """
    gc.freeze()  # keeps objects of the imports out of every garbage collection, which saves a tenth of a short run
    check_objective(asked.objective, "--objective")
    check_angles(asked.angles)
    known = read_known(asked.effect, asked.thorax_downweighting, asked.weight)
    warn_of_sizes(known.effects, OPTION)
    record, models, files = inputs_record(motions, named), load_models(named), MotionStream(*motions)
    missing = subjects_without_set(models, files.subjects)
    subjects = tuple(name for name in files.subjects if name not in missing)
    size = chunk or max(1, LANES // len(models))
    shown = frozenset(subjects) if len(subjects) <= size else sample(subjects, MOST_SHOWN)
    held_out, less = sample(subjects), known.thorax_downweighting
    people = None
    if asked.own_bones:
        check_own_bones(known.effects, asked.objective, less, asked.weight)
        people = _people(files, missing, subjects, models, known, asked.angles)
    work = Work(
        tuple(models), asked.weight, asked.objective, shown, held_out, asked.float32, known.effects, less, people
    )
    maker = on_cluster(dask) if dask else on_this_machine(len(subjects) // size)
    chunks = _chunks(files, missing, asked.angles, size)  # finds bad input before the folder of the results is made
    options: dict[str, object] = asdict(asked)
    with results_folder(out, record, "adapt") as folder:
        chunk_files = ChunkFiles(folder, run_key(record, options | {"chunk": size}))
        with progress(errors) as report:
            table = chunk_files.make(work, chunks, maker, report)
            report("writing")
            with transaction(folder) as staged:
                result = chunk_files.merge(staged, work)
                write_adapted_models(staged, models, result.parameters, _in_words(work, asked.angles, known))
                table = replace(table, rejected=(*files.rejected, *missing.values()))
                write_run(staged, "adapt", record, options, table.rejected)
                wrong = write_report(
                    staged,
                    table,
                    models,
                    result.shown,
                    result.failed,
                    sampled_from=len(subjects),
                    active_effects=described(known.effects),
                    thorax_downweighting=less,
                    flat=result.flat,
                )
        _print_results(result, work, known, tables=tables)
        say_report(folder, wrong)
    finish(table, result.failed)


def _chunks(files: MotionStream, missing: dict[str, InputError], angles: str, size: int) -> Iterator[Motions]:
    """Read ``size`` subjects at a time, the first chunk immediately."""
    every = (without_subjects(one, missing) for one in files.in_chunks(size))
    chunks = (one for one in (with_angles(each, angles) for each in every) if len(one.posture))
    first = not_empty(next(chunks, None), angles)
    warn_of_alike_motions(first, "the motions")
    return chain([first], chunks)


def _in_words(work: Work, angles: str, known: Known) -> str:
    """Describe in words how the models were adapted."""
    of_angles = [] if angles == SIX else [f"{angles} angles"]
    own_bones = [] if work.people is None else [OWN_BONES]
    return ", ".join([f"w = {work.weight:g}", f"objective {work.objective}", *of_angles, *own_bones, *known.texts])


def _print_results(result: Merged, work: Work, known: Known, *, tables: bool) -> None:
    if tables:
        _print_tables(result)
    if work.people is not None:
        print_own_bones(console, result.parameters)
    say_known(known)
    if OBJECTIVES[work.objective].landmarks:
        print_without_landmarks(console, result.parameters)
    print_verdicts(console, result.parameters, result.heldout, result.summary)


def _people(
    files: MotionStream,
    missing: dict[str, InputError],
    subjects: Sequence[str],
    models: list[AnyModel],
    known: Known,
    angles: str,
) -> People:
    """Learn how the persons of the whole run differ, so that no result depends on the number of chunks."""
    chosen = list(own_sample(subjects))
    every = (without_subjects(one, missing) for one in files.in_chunks(LANES))
    motions = with_angles(Motions.concatenate([one.select(np.isin(one.subject, chosen)) for one in every]), angles)
    with progress(errors) as report:
        report("how persons differ")
        return learn_people(posture_rows(motions, known.effects), models)


def _print_tables(result: Merged) -> None:
    subjects = len(set(result.parameters["subject"]))
    print_summary(console, result.summary, subjects)
    print_parameters(console, result.parameters)
    print_heldout(console, result.heldout, subjects)
