"""The command line: ``girdle fit | adapt | diagnose | trust | muscles | convert | model | simulate | ...``."""

import gc
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from adapt.api import adapt_subjects, fit_postures
from adapt.assessment import assess_trust
from adapt.cli.options import (
    DEFAULT_MODEL,
    AaToAc,
    Float32,
    KnownEffects,
    Models,
    ModelsOf,
    MotionFiles,
    Names,
    Out,
    Reading,
    Repeat,
    ScFromIj,
    Shoulder,
    Weight,
    console,
    errors,
)
from adapt.cli.print_diagnosis import print_diagnosis
from adapt.cli.print_muscles import print_muscles
from adapt.cli.print_tables import (
    print_heldout,
    print_parameters,
    print_summary,
    print_without_landmarks,
    progress,
)
from adapt.cli.print_trust import print_trust
from adapt.diagnosis import Diagnoses, diagnose
from adapt.diagnosis.fit.noise import LEAST_DEG
from adapt.diagnosis.json_form import as_json
from adapt.engine.compilation_cache import keep_compiled
from adapt.large_runs.dask_cluster import on_cluster
from adapt.large_runs.parts import (
    LANES,
    MOST_SHOWN,
    Parts,
    Work,
    failed_subjects,
    not_adapted,
    one_after_another,
)
from adapt.model_subjects import simulate_model_subjects
from adapt.output.adapted_models import remove_models_of_failed, write_adapted_models
from adapt.output.muscle_files import write_muscles
from adapt.output.result_files import raise_without_report, write_adaptations, write_figures, write_fits, write_report
from adapt.output.run_files import (
    Files,
    inputs_record,
    results_folder,
    run_key,
    transaction,
    write_json,
    write_run,
    write_table,
)
from adapt.solvers.objective import DEFAULT_READING, READINGS, WEIGHT
from adapt.tables.muscle_tables import BODY_MASS_KG, muscle_tables
from adapt.tables.results import Tables
from adapt.trust.held_out import sample
from models import load_model, model_names
from models.effects import EFFECTS
from models.effects.known import OPTION, THORAX_POINTS, THORAX_POINTS_WHAT, described, effect_named, read_amplitudes
from models.muscles.muscle_lines import muscle_lines_of
from models.person.contours.band import HALF_WIDTH_PX, INSIDE, VECTOR_PX, Settings
from models.person.family import AnyModel, load_any_model, without_set
from motions import InputError, Motions, MotionStream, read_motions, write_motions
from motions.landmarks.acromion import acromion_rotation
from motions.landmarks.mapping import read_mapping
from motions.landmarks.sampled_postures import Labels, marked_slips
from motions.landmarks.stand_ins import sternoclavicular_offset
from motions.motion_csv.cells import SIDES

EXIT_BAD_INPUT = 2
EXIT_SOME_NOT_HANDLED = 3
EXIT_INTERRUPTED = 130

NO_EFFECT = "none"

MOST_NOISE_DEG = 20.0
"""Noise beyond this, or below what a diagnosis can estimate, is a slip of the pen: every posture would be within it, or
none."""

MANY_FRAMES = 50
"""More postures than a palpator records: this is a trial, which is better sampled."""

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Fit the shoulder girdle model to measured motions, adapt it to each person, and say why they still differ.

A motion file is a CSV with one row a posture: subject, motion, posture, humerus_elevation_deg and the six
Cardan angles clavicle_y_deg ... scapula_x_deg (right shoulder, thorax frame, degrees).

Exit status: 0 every subject was handled, 3 some were not (named on stderr and in the files), 2 bad input, 130
interrupted (what was there is as it was).""",
)


@app.command()
def fit(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    float32: Float32 = False,
    effect: KnownEffects = [],  # noqa: B006
    repeat: Repeat = None,
) -> None:
    """Fit every posture with the models as they are (Tables 6.1 and 6.2).

    Writes fits.csv (one row a posture), summary.csv (subjects by angles) and run.json.
    """
    effects = read_amplitudes(effect)
    table, models, record = _inputs(motions, _names(model, models_of))
    with results_folder(out) as folder:
        with progress(errors) as report:
            result = fit_postures(table, models, report, np.float32 if float32 else np.float64, effects)
        with transaction(folder) as part:
            write_fits(part, result)
            write_run(part, "fit", record, {"float32": float32, "effect": effect}, table.rejected)
    print_summary(console, result.summary)
    _say_known(described(effects))
    _finish(table, failed_subjects(result.fits))


@app.command()
def adapt(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    reading: Reading = DEFAULT_READING,
    chunk: Annotated[
        int | None,
        typer.Option(
            min=1,
            help=f"Subjects worked on at a time; results do not depend on it. Default: {LANES} by number of models.",
            show_default=False,
        ),
    ] = None,
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster that does the work, as tcp://host:8786.")
    ] = "",
    float32: Float32 = False,
    effect: KnownEffects = [],  # noqa: B006
    repeat: Repeat = None,
) -> None:
    """Adapt thorax ellipsoid and conoid to each subject, over all its motions together (Tables 6.1-6.6).

    Writes fits.csv (before and after), parameters.csv (one row a subject), summary.csv, heldout.csv (the gap on each
    motion, adapted without it), run.json, report.html (the page to look at) and, in models/, each adapted model as a
    TOML file that --model takes.

    Any number of subjects is worked on in parts, in bounded memory; a run that was stopped goes on where it was.
    """
    if reading not in READINGS:
        raise InputError("--reading", None, f"unknown reading '{reading}'", f"Use one of {', '.join(READINGS)}")
    effects = read_amplitudes(effect)
    known = described(effects)
    how = f"w = {weight:g}, reading {reading}" + (f", with {known}" if known else "")
    named = _names(model, models_of)
    record, models, files = inputs_record(motions, named), _models(named), MotionStream(*motions)
    options: dict[str, object] = {"weight": weight, "reading": reading, "float32": float32, "effect": effect}
    missing = _no_set(models, files.subjects)
    subjects = tuple(name for name in files.subjects if name not in missing)
    size = chunk or max(1, LANES // len(models))
    shown = frozenset(subjects) if len(subjects) <= size else sample(subjects, MOST_SHOWN)
    work = Work(tuple(models), weight, reading, shown, sample(subjects), float32, effects)
    maker = on_cluster(dask) if dask else one_after_another
    chunks = (one for one in (_of_others(part, missing) for part in files.in_chunks(size)) if len(one.posture))
    chunks = chain([next(chunks)], chunks)  # bad input is found before a folder is made for it
    with results_folder(out) as folder:
        parts = Parts(folder, run_key(record, options | {"chunk": size}))
        with progress(errors) as report:
            table = parts.make(work, chunks, maker, report)
            report("writing")
            with transaction(folder) as part:
                result, failed = parts.merge(part, models)
                write_adapted_models(part, models, result.parameters, how)
                rejected = (*files.rejected, *missing.values())
                write_run(part, "adapt", record, options, rejected)
                table = replace(table, rejected=rejected)
                drawn = result.select(table.subjects)
                wrong = write_report(
                    part, table, models, drawn, failed, sampled_from=len(subjects), active_effects=known
                )
        parts.remove()
        remove_models_of_failed(folder, result.parameters)
        _print_tables(result, len(subjects))
        _say_known(known)
        if READINGS[reading].landmarks:
            print_without_landmarks(console, result.parameters)
        raise_without_report(folder, wrong)
    _finish(table, failed)


@app.command("diagnose")
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
    repeat: Repeat = None,
) -> None:
    """Say why the adapted model and the measurements still differ: what gap is left, where, and what causes it.

    Looks for the causes of `girdle effects`, several at once, that predict motions and persons that were not fitted.
    The answer is **none** (nothing beyond noise), **effect** (one cause or more, each with the names that these data
    cannot tell apart) or **unknown** (no candidate predicts better). With it come the probability of each candidate of
    being at work, the gap budget (what adaptation, each cause and noise take of the gap on unseen motions), the size of
    each cause, and the measurement that would tell most.

    More subjects and more kinds of motion help most: the same causes are sought in all of them. A subject with fewer
    than four postures is left out.

    Writes diagnosis.json (everything), budget.svg (what takes the gap away), inclusion.svg (how probably each candidate
    is at work), gap_heatmap.svg (where the gap is), gaps.svg (how far it shrinks), the tables of `girdle adapt`,
    run.json and report.html (the page to look at).
    With several models the figures are those of the model with the smallest gap after adaptation.
    """
    if noise_deg is not None and not LEAST_DEG <= noise_deg <= MOST_NOISE_DEG:
        cause = f"{noise_deg:g} is not between {LEAST_DEG:g} and {MOST_NOISE_DEG:g} degrees"
        raise InputError("--noise-deg", None, cause, "Give the SD of one angle in degrees, or leave it to be estimated")
    table, models, record = _inputs(motions, _names(model, models_of))
    with results_folder(out) as folder:
        with progress(errors) as report:
            diagnoses = Diagnoses(diagnose(table, models, noise_deg, progress=report))
            result = adapt_subjects(table, models, progress=report)
            report("figures")
            with transaction(folder) as part:
                write_figures(part, diagnoses.closest)
                write_json(as_json(diagnoses), part / "diagnosis.json")
                write_adaptations(part, result)
                write_run(part, "diagnose", record, {"noise_deg": noise_deg}, table.rejected)
                failed = not_adapted(result) | diagnoses.closest.left_out
                wrong = write_report(part, table, models, result, failed, diagnoses)
        print_diagnosis(console, diagnoses)
        raise_without_report(folder, wrong)
    _finish(table, failed)


@app.command("trust")
def trust_results(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    choose_weight: Annotated[
        bool, typer.Option("--choose-weight", help="Try other w too, and say which is best on held-out motions.")
    ] = False,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and say how far the result can be trusted.

    Writes trust.csv (one row a subject: gaps seen and unseen, flat directions, warnings), uncertainty.csv (an interval
    for each parameter), heldout.csv (the gap on each motion and third of the postures, adapted without them),
    plausibility.csv (are size and place a thorax's; do contact and conoid keep their directions, the serratus its
    arms?), contact.csv (directions and arms of contact and conoid in each posture), with --choose-weight weights.csv,
    the tables of `girdle adapt` and run.json.
    """
    table, models, record = _inputs(motions, _names(model, models_of))
    with results_folder(out) as folder:
        with progress(errors) as report:
            found = assess_trust(table, models, weight, choose_weight, report)
        with transaction(folder) as part:
            write_adaptations(part, found.adaptations)
            for name in ("uncertainty", "plausibility", "contact"):
                write_table(getattr(found, name), part / f"{name}.csv")
            write_table(found.subjects, part / "trust.csv")
            if found.weights is not None:
                write_table(found.weights, part / "weights.csv")
            options = {"weight": weight, "choose_weight": choose_weight}
            write_run(part, "trust", record, options, table.rejected)
    print_trust(console, found)
    _finish(table, not_adapted(found.adaptations))


@app.command("muscles")
def muscle_results(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    body_mass_kg: Annotated[
        float, typer.Option(min=1.0, help="Of the persons: an arm weighs a twentieth of it.")
    ] = BODY_MASS_KG,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and compare muscle arms and the forces that balance the arm before and after.

    Writes muscle_arms.csv (one row a subject and muscle), muscles.csv and balance.csv (one row a posture),
    muscle_lines.csv (one row a posture and line), muscle_arms.svg, the tables of `girdle adapt`, run.json and
    report.html (the page to look at: lines on the ellipsoid, arms over elevation).
    """
    table, models, record = _inputs(motions, _names(model, models_of))
    for one in models:
        muscle_lines_of(one, table.subjects)  # refuses a set without landmarks before anything is fitted
    with results_folder(out) as folder:
        with progress(errors) as report:
            result = adapt_subjects(table, models, weight, progress=report)
            report("muscles")
            found = muscle_tables(models, result.fits, result.parameters, body_mass_kg)
            report("writing")
            with transaction(folder) as part:
                write_adaptations(part, result)
                write_muscles(part, found)
                write_run(part, "muscles", record, {"weight": weight, "body_mass_kg": body_mass_kg}, table.rejected)
                wrong = write_report(part, table, models, result, not_adapted(result), muscles=found)
        print_muscles(console, found)
        raise_without_report(folder, wrong)
    _finish(table, not_adapted(result))


@app.command("convert")
def convert_file(
    source: Annotated[Path, typer.Argument(metavar="IN", help="A file, or the folder of a Spartacus checkout.")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="A file, or a folder for .mot files.")],
    names: Names = None,
    subject: Annotated[str, typer.Option(help="Whose motion it is, if the file does not say; else its name.")] = "",
    motion: Annotated[str, typer.Option(help="What motion it is, if the file does not say; else its name.")] = "",
    side: Shoulder = "right",
    at: Annotated[
        str, typer.Option("--at", help="Elevations of the arm to sample a trial at, as in 30,60,90. Else every frame.")
    ] = "",
    aa_to_ac: AaToAc = "",
    sc_from_ij: ScFromIj = "",
    isb: Annotated[bool, typer.Option("--isb", help="Write .mot angles as ISB's alpha, beta, gamma.")] = False,
) -> None:
    """Bring files of your laboratory into this project's forms, and results into those of others.

    Landmarks (.c3d, .trc, .csv), angles (.mot, .sto) or a Spartacus checkout become a motion file (.csv), which the
    other commands take. A motion file, or fits.csv with its simulated motions, becomes one .mot or a folder of them; a
    parameter set, such as an adapted model, becomes an OpenSim model (.osim); any table becomes .parquet.
    """
    from adapt.cli.convert import convert  # readers of laboratories' files: not for every command

    labels = _labels(subject, motion, side, at, aa_to_ac, sc_from_ij)
    motions = convert(source, target, read_mapping(names), labels, isb)
    if motions is None:
        console.print(f"{target} written", soft_wrap=True)
        return
    subjects = len(motions.subjects)
    console.print(
        f"{len(motions.posture)} postures of {subjects} subject{'s' if subjects > 1 else ''} in {target}",
        soft_wrap=True,
    )
    if not labels.at_deg and source.suffix.lower() in (".c3d", ".trc") and len(motions.posture) > MANY_FRAMES:
        console.print("Every frame is a posture; --at 30,60,90 would sample the trial at elevations of the arm.")
    _say_slipped(motions)
    _finish(motions, {})


@app.command("model")
def model_of_person(
    source: Annotated[
        Path, typer.Argument(metavar="PERSON.csv", help="Landmarks (.c3d, .trc, .csv), or a motion file that has them.")
    ],
    out: Annotated[Path, typer.Option("--out", help="A file that ends in .toml; a folder for several subjects.")],
    model: Annotated[
        str, typer.Option(help="Parameter set that gives what was not measured: a name or a TOML file.")
    ] = "R2",
    points: Annotated[
        Path | None,
        typer.Option(help="CSV of points: surface (thorax, humeral_head, humeral_shaft, ...), x_mm, y_mm, z_mm."),
    ] = None,
    rest: Annotated[
        str, typer.Option(help="Posture in which the chain closes, by its name. Default: the arm lowest.")
    ] = "",
    names: Names = None,
    subject: Annotated[
        str, typer.Option(help="Whose landmarks they are, if the file does not say; else its name.")
    ] = "",
    side: Shoulder = "right",
    aa_to_ac: AaToAc = "",
    sc_from_ij: ScFromIj = "",
) -> None:
    """Make a parameter set of a person from landmarks, and from points if there are any (Chapters 4 and 5).

    Lengths are medians over the postures. The thorax is fitted to points on it. What was not measured is that of
    another set, carried to the person's bones. Every number has its source and its SD; `girdle adapt --model` takes
    the file, `--models-of` a folder of them.
    """
    from adapt.cli.person import write_person_sets  # readers of laboratories' files: not for every command
    from adapt.cli.print_person import print_persons

    labels = _labels(subject, "", side, "", aa_to_ac, sc_from_ij)
    written, rejected = write_person_sets(source, out, load_model(model), read_mapping(names), labels, rest, points)
    print_persons(console, written)
    for error in rejected:
        errors.print(f"left out: {error}", soft_wrap=True)
    if rejected:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)


@app.command("contour")
def contours_of_slices(
    slices: Annotated[list[Path], typer.Argument(metavar="SLICE...", help="DICOM or PNG files, or a folder of them.")],
    clicks: Annotated[Path, typer.Option(help="CSV of clicks: slice, x_px, y_px; use (draw, correct), surface.")],
    out: Annotated[Path, typer.Option("--out", help="CSV of points, which `girdle model --points` takes.")],
    click: Annotated[
        bool, typer.Option("--click", help="Take clicks in a window first, and add them to --clicks.")
    ] = False,
    surface: Annotated[
        str, typer.Option(help="Of the clicks in the window, as `girdle model --points` names it.")
    ] = "thorax",
    inside: Annotated[
        str, typer.Option(help="What the bone is beside what surrounds it: bright, dark, either.")
    ] = "either",
    half_width_px: Annotated[
        float, typer.Option(min=1.0, help="How far from the clicks, or the slice before, an edge is looked for.")
    ] = HALF_WIDTH_PX,
    vector_px: Annotated[
        float, typer.Option(min=0.0, help="How far the polygon of the points may be from the contour; 0 keeps all.")
    ] = VECTOR_PX,
    pixel_mm: Annotated[
        float | None, typer.Option(min=1e-3, help="Size of a pixel, of images that do not say.", show_default=False)
    ] = None,
    slice_mm: Annotated[
        float | None, typer.Option(help="Distance of slices, of images that do not say.", show_default=False)
    ] = None,
) -> None:
    """Find contours of bones in image slices from a few clicks, and write their points in mm (Chapter 2).

    Between clicks the contour follows the strongest edge near them. It is propagated to the other slices; where that
    fails, a correction of three clicks, or a new contour, puts it right. Needs the extra `contour` of the package.
    """
    from adapt.cli.contour import print_contours, write_contours  # readers of images: not for every command

    if inside not in INSIDE:
        raise InputError("--inside", None, f"there is no '{inside}'", f"Use one of {', '.join(INSIDE)}")
    if slice_mm == 0.0:
        raise InputError("--slice-mm", None, "slices 0 mm apart are one", "Give their distance")
    settings = Settings(inside, half_width_px)  # type: ignore[arg-type]
    done = write_contours(slices, clicks, out, settings, vector_px, (pixel_mm, slice_mm), surface if click else "")
    print_contours(console, done, out)


@app.command("models")
def list_models() -> None:
    """List the parameter sets, one line each."""
    for name in model_names():
        girdle = load_model(name).girdle
        axes = ", ".join(f"{a:.0f}" for a in girdle.semi_axes_mm)
        console.print(
            f"{name:22} clavicle {float(girdle.ac_mm[0]):.0f} mm, semi-axes ({axes}) mm, "
            f"conoid {float(girdle.conoid_length_mm):.1f} mm",
            soft_wrap=True,
        )


@app.command()
def simulate(
    out: Out,
    model: Annotated[str, typer.Option(help="Name of a parameter set or a TOML file.")] = "R2",
    effect: Annotated[str, typer.Option(help="An effect of `girdle effects`, or none.")] = "none",
    subjects: Annotated[int, typer.Option(min=1, help="How many subjects.")] = 10,
    noise_deg: Annotated[float, typer.Option(min=0.0, help="SD of the noise on each angle, degrees.")] = 1.5,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same subjects.")] = 0,
    repeat: Repeat = None,
) -> None:
    """Simulate subjects with the model, an unmodelled effect at work in them, and noise.

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


@app.command("effects")
def list_effects() -> None:
    """List the candidate unmodelled effects, one line each: what it changes, how large it is in which directions."""
    for one in EFFECTS.values():
        scale = " / ".join(f"{value:g}" for value in one.prior.scale)
        along = " / ".join(one.directions)
        console.print(f"{one.name:28} {one.what}; scale {scale} {one.unit} ({along})", soft_wrap=True)
    console.print(f"{THORAX_POINTS:28} {THORAX_POINTS_WHAT} (k)", soft_wrap=True)


def _labels(subject: str, motion: str, side: str, at: str, aa_to_ac: str, sc_from_ij: str) -> Labels:
    """What the options say of a file of landmarks."""
    if side not in SIDES:
        raise InputError("--side", None, f"the side is '{side}'", "Say left or right")
    rotation = acromion_rotation(aa_to_ac) if aa_to_ac else None
    offset = sternoclavicular_offset(sc_from_ij) if sc_from_ij else None
    return Labels(subject, motion, SIDES[side], _elevations(at), rotation, aa_to_ac, offset)


def _say_slipped(motions: Motions) -> None:
    """Name the landmarks that are not where their bone says."""
    for row, names in marked_slips(motions).items():
        where = f"{motions.subject[row]}, {motions.motion[row]} {motions.posture[row]}"
        console.print(f"{names} slipped: {where}", soft_wrap=True)


def _elevations(at: str) -> tuple[float, ...]:
    """The numbers of --at, each once, from low to high."""
    try:
        return tuple(sorted({float(word) for word in at.split(",") if word.strip()}))
    except ValueError:
        cause = f"'{at}' is not a list of elevations"
        raise InputError("--at", None, cause, "Give degrees separated by commas, as in --at 30,60,90") from None


def _inputs(motions: list[Path], models: list[str]) -> tuple[Motions, list[AnyModel], Files]:
    """The motions, the models, and what run.json says of their files."""
    record, sets = inputs_record(motions, models), _models(models)
    table = read_motions(*motions)
    missing = _no_set(sets, table.subjects)
    return _of_others(table, missing), sets, record


def _no_set(models: list[AnyModel], subjects: Sequence[str]) -> dict[str, InputError]:
    """Name who has no set of its own in a folder. InputError if nobody has."""
    remedy = "Make one with girdle model, or adapt this subject with --model"
    errors = {
        subject: InputError(folder, None, f"there is no parameter set of subject {subject!r}", remedy)
        for subject, folder in without_set(models, subjects).items()
    }
    if errors and len(errors) == len(subjects):
        raise next(iter(errors.values()))
    return errors


def _of_others(motions: Motions, missing: dict[str, InputError]) -> Motions:
    """The motions without those of the subjects who have no set; these are named among the rejected."""
    mine = tuple(error for subject, error in missing.items() if subject in motions.subjects)
    if not mine:
        return motions
    kept = motions.select(~np.isin(motions.subject, list(missing)))
    return replace(kept, rejected=(*motions.rejected, *mine))


def _names(model: list[str], models_of: list[Path]) -> list[str]:
    """What was asked for; the default where nothing was. A folder stands among the models, as run.json has it."""
    return [*model, *(str(folder.absolute()) for folder in models_of)] or [DEFAULT_MODEL]


def _models(models: list[str]) -> list[AnyModel]:
    sets = [load_any_model(name) for name in models]
    names = [one.name for one in sets]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("--model", None, f"two models are called '{twice}'", "Give each one a name of its own")
    return sets


def _print_tables(result: Tables, subjects: int) -> None:
    print_summary(console, result.summary)
    print_parameters(console, result.parameters)
    print_heldout(console, result.heldout, subjects)


def _say_known(effects: str) -> None:
    """What ``described`` says of them, if there are any."""
    if effects:
        console.print(f"With {effects} at work in every subject.", soft_wrap=True)


def _finish(motions: Motions, failed: dict[str, str]) -> None:
    """Name who was not handled on stderr and end with the exit status."""
    for error in motions.rejected:
        errors.print(f"left out: {error}", soft_wrap=True)
    for subject, why in failed.items():
        errors.print(f"not handled: {subject}: {why}", soft_wrap=True)
    if motions.rejected or failed:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)


def main(application: typer.Typer = app) -> None:
    """Run the command line: keep compiled code between runs; bad input is one message and exit status 2."""
    keep_compiled()
    gc.freeze()  # what the imports made stays: without it every collection looks through it, a tenth of a short run
    try:
        application()
    except InputError as error:
        errors.print(f"error: {error}", soft_wrap=True)
        sys.exit(EXIT_BAD_INPUT)
    except SystemExit as ended:
        if ended.code == EXIT_INTERRUPTED:  # typer ends so on Ctrl-C, without a word
            errors.print("interrupted")
        raise
