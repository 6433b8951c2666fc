"""``girdle diagnose``, ``girdle trust`` and ``girdle muscles``: their options and help."""

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
            metavar="|".join(POSITION_USES),
            help="Positions of landmarks in the motion files: use them; check the diagnosis by them, which does not "
            "see them; or ignore them.",
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
    """Say why the adapted model and the measurements still differ: what gap is left, where, and what causes it.

    Looks for the causes of `girdle effects`, several at once, that predict motions and persons that were not fitted.
    The answer is **none** (nothing beyond noise), **effect** (one cause or more, each with the names that these data
    cannot tell apart) or **unknown** (no listed cause explains the rest). With it come the size of each cause, what it
    was tested on, what to measure next, and the command that adapts with the causes. --tables adds the inclusion
    probabilities and the gap budget (what adaptation, each cause and noise take of the gap on held-out motions).

    More subjects and more kinds of motion help most: the same causes are sought in all of them. A subject with fewer
    than four postures is left out.

    Writes diagnosis.json (everything), budget.svg (what takes the gap away), inclusion.svg (how probably each candidate
    is active), gap_heatmap.svg (where the gap is), gaps.svg (how far it shrinks), positions.csv (where landmarks
    are simulated and were measured), the tables of `girdle adapt`, run.json and report.html (the page to look at).
    With several models the figures are those of the model with the smallest gap after adaptation.
    """
    from adapt.cli.commands.assess_runs import diagnose_motions  # JAX and pandas: not for --help

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

    Writes trust.csv (one row a subject: gaps in sample and held out, flat directions, warnings), uncertainty.csv (an
    interval for each parameter), heldout.csv (the gap on each motion and third of the postures, adapted without them),
    plausibility.csv (are size and place a thorax's; do contact and conoid keep their directions, the serratus its
    arms?), contact.csv (directions and arms of contact and conoid in each posture), with --choose-weight weights.csv,
    the tables of `girdle adapt` and run.json.
    """
    from adapt.cli.commands.assess_runs import assess_motions  # JAX and pandas: not for --help

    assess_motions(motions, out, asked_models(model, models_of), weight, choose_weight, own_bones, angles)


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
    angles: Angles = SIX,
    repeat: Repeat = None,
) -> None:
    """Adapt as `girdle adapt` does, and compare muscle arms and the forces that hold the arm before and after.

    About SC, AC and GH. Needs how the humerus was held: from GH, EM and EL in the motion file, its columns
    humerus_plane_deg and humerus_axial_deg, or, assumed, from the name of the motion; balance.csv says which.

    Writes muscle_arms.csv (one row a subject and muscle), muscles.csv and balance.csv (one row a posture),
    muscle_lines.csv (one row a posture and line), muscle_arms.svg, the tables of `girdle adapt`, run.json and
    report.html (the page to look at: lines on the ellipsoid, arms over elevation).
    """
    from adapt.cli.commands.assess_runs import compare_muscles  # JAX and pandas: not for --help

    compare_muscles(motions, out, asked_models(model, models_of), weight, body_mass_kg, load_kg, angles)
