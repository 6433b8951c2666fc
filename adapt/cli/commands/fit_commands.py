"""Options and help of ``girdle fit`` and ``girdle adapt``."""

from typing import Annotated

import typer

from adapt.cli.choices import DEFAULT_OBJECTIVE, LANES, SIX, WEIGHT
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
    asked_models,
)


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
    """Fit every posture with the models as they are, without adaptation (Tables 6.1 and 6.2).

    Writes fits.csv (one row per posture), summary.csv (subjects by angles) and run.json.
    """
    from adapt.cli.commands.fit_runs import fit_motions  # slow import: JAX and pandas
    from adapt.cli.commands.known_effects import effects_of

    models = asked_models(model, models_of)
    effect = [*effects_of(effects_of_folder, models, out), *effect]
    fit_motions(motions, out, models, float32, angles, effect)


def adapt(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    objective: Objective = DEFAULT_OBJECTIVE,
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
    """Adapt thorax ellipsoid and conoid length to each subject, over all its motions together (Tables 6.1-6.6).

    Writes fits.csv (before and after), parameters.csv (one row per subject), summary.csv, heldout.csv (the gap on each
    motion, adapted without it), run.json, report.html (the page to look at) and, in models/, each adapted model as a
    TOML file for --model. positions.csv is added where positions of SC, AC, TS, AI or AA were measured.

    Any number of subjects is worked on in chunks, in bounded memory; a run that was stopped continues where it stopped.
    """
    from adapt.cli.commands.fit_runs import AdaptOptions, adapt_motions  # slow import: JAX and pandas
    from adapt.cli.commands.known_effects import effects_of

    models = asked_models(model, models_of)
    effect = [*effects_of(effects_of_folder, models, out), *effect]
    asked = AdaptOptions(weight, objective, float32, angles, effect, thorax_downweighting, own_bones)
    adapt_motions(motions, out, models, asked, chunk, dask, tables)
