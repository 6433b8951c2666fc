"""Options and help of ``girdle diagnose``, ``girdle trust`` and ``girdle muscles``."""

from typing import Annotated

import typer

from adapt.cli.choices import BODY_MASS_KG, POSITION_USES, SIX, WEIGHT
from adapt.cli.options import (
    Angles,
    Models,
    ModelsOf,
    MotionFiles,
    Out,
    OwnBones,
    Repeat,
    ShowTables,
    Weight,
    asked_models,
)

HEAVIEST_LOAD_KG = 100.0
"""Largest load, kg. Nobody holds more with a straight arm: a larger number is a typing error."""

HEAVIEST_KG = 700.0
"""Largest body mass, kg. The heaviest person on record had some 635 kg (Guinness World Records): a larger number is a
typing error, or infinite."""


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
            metavar="|".join(POSITION_USES),
            help="Positions of landmarks in the motion files: use them as data; only check the result against them; or "
            "ignore them.",
        ),
    ] = POSITION_USES[0],
    position_noise_mm: Annotated[
        float | None,
        typer.Option(
            help="SD of the noise on one measured coordinate of a landmark, mm, if you know it. Default: estimated.",
            show_default=False,
        ),
    ] = None,
    angles: Angles = SIX,
    tables: ShowTables = False,
    repeat: Repeat = None,
) -> None:
    """Say why the adapted model and the measurements still differ: the remaining gap, where it is, and its causes.

    Searches among the effects of `girdle effects`, several at once, for causes that predict held-out motions and
    persons. The answer is **none** (nothing beyond noise), **effect** (one or more causes, each with the names that
    these data cannot tell apart) or **unknown** (no listed cause explains the rest). The answer comes with the size of
    each cause, the held-out data it was tested on, what to measure next, and the command that adapts with the causes.
    --tables adds the inclusion probabilities and the gap budget (how much of the held-out gap adaptation, each cause
    and noise explain).

    More subjects and more kinds of motion help most, because the same causes are sought in all of them. Subjects with
    fewer than four postures are left out.

    Writes diagnosis.json (everything), budget.svg (the gap budget), inclusion.svg (the inclusion probability of each
    candidate), gap_heatmap.svg (where the gap is), gaps.svg (how far the gap shrinks), positions.csv (simulated and
    measured positions of landmarks), the tables of `girdle adapt`, run.json and report.html (the page to look at). With
    several models, the figures are those of the model with the smallest gap after adaptation.
    """
    from adapt.cli.commands.assess_runs import diagnose_motions  # slow import: JAX and pandas

    asked = asked_models(model, models_of)
    diagnose_motions(motions, out, asked, noise_deg, positions, position_noise_mm, angles, tables)


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
    angles: Angles = SIX,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and say how far the result can be trusted.

    Writes trust.csv (one row per subject: gaps in sample and held out, flat directions, warnings), uncertainty.csv (an
    interval for each parameter), heldout.csv (the gap on each motion and third of the postures, adapted without them),
    plausibility.csv (are size and place those of a thorax; do contact and conoid keep their directions, and the
    serratus its moment arms?), contact.csv (directions and moment arms of contact and conoid in each posture), with
    --choose-weight weights.csv, the tables of `girdle adapt` and run.json.
    """
    from adapt.cli.commands.assess_runs import assess_motions  # slow import: JAX and pandas

    assess_motions(motions, out, asked_models(model, models_of), weight, choose_weight, own_bones, angles)


def muscle_results(
    motions: MotionFiles,
    out: Out,
    model: Models = [],  # noqa: B006 (typer reads it, never changes it)
    models_of: ModelsOf = [],  # noqa: B006
    weight: Weight = WEIGHT,
    body_mass_kg: Annotated[
        float,
        typer.Option(min=1.0, max=HEAVIEST_KG, help="Body mass of the persons, kg; the arm has a twentieth of it."),
    ] = BODY_MASS_KG,
    load_kg: Annotated[
        float, typer.Option(min=0.0, max=HEAVIEST_LOAD_KG, help="Load in the hand, kg, with the elbow straight.")
    ] = 0.0,
    angles: Angles = SIX,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and compare muscle moment arms and forces that hold the arm, before and after.

    Moment arms are about SC, AC and GH. The orientation of the humerus comes from GH, EM and EL in the motion file,
    from its columns humerus_plane_deg and humerus_axial_deg, or is assumed from the name of the motion; balance.csv
    says which.

    Writes muscle_arms.csv (one row per subject and muscle), muscles.csv and balance.csv (one row per posture),
    muscle_lines.csv (one row per posture and line), muscle_arms.svg, the tables of `girdle adapt`, run.json and
    report.html (the page to look at: lines on the ellipsoid, moment arms over elevation).
    """
    from adapt.cli.commands.assess_runs import compare_muscles  # slow import: JAX and pandas

    compare_muscles(motions, out, asked_models(model, models_of), weight, body_mass_kg, load_kg, angles)
