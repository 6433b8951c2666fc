"""Options that several commands share, with their help; the consoles; and options taken from a record."""

from pathlib import Path
from typing import Annotated

import typer

from adapt.cli.choices import (
    CLAVICLE_Z,
    DEFAULT_MODEL,
    EFFECT_OPTION,
    FULL_ELEVATION_DEG,
    GH_OFFSETS,
    OBJECTIVES,
    OFFSETS,
    ROTATIONS,
    UNITS_MM,
)
from adapt.cli.terminal.console import PlainConsole

THORAX_OPTION = "--thorax-downweighting"

EFFECTS_OF_OPTION = "--effects-of"

console = PlainConsole()
errors = PlainConsole(stderr=True)

MotionFiles = Annotated[
    list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files, one or many subjects each.")
]
Models = Annotated[
    list[str],
    typer.Option(
        "--model",
        help="Name of a parameter set (see `girdle models`) or a TOML file; repeatable.",
        show_default=DEFAULT_MODEL,
    ),
]
ModelsOf = Annotated[
    list[Path],
    typer.Option(
        "--models-of",
        metavar="FOLDER",
        help="Folder with a parameter set of each subject, by its name (see `girdle model`); repeatable, also beside "
        "--model.",
        show_default=False,
    ),
]
Out = Annotated[Path, typer.Option("--out", help="Folder for the results; made if it is not there.")]


def _take_from_record(context: typer.Context, path: Path | None) -> None:
    """Make the options of the record the default values of the command's parameters."""
    if path is None:
        return
    from adapt.output.repeat import other_versions, read_record, recorded_arguments  # slow import: pandas

    parameters = {one.name: one for one in context.command.params if one.name}
    options = set(parameters) - {"motions", "model", "models_of", "out", "repeat"}
    record = read_record(path)
    recorded = recorded_arguments(record, path, str(context.command.name), options)
    if not parameters["model"].multiple:
        recorded["model"] = recorded["model"][0]
    context.default_map = recorded
    if different := other_versions(record):
        errors.print(f"note: the last digits may differ: {', '.join(different)}", soft_wrap=True)


def _checked(weight: float) -> float:
    from adapt.solvers.objective import check_weight  # slow import: JAX

    check_weight(weight, "--weight")
    return weight


Weight = Annotated[
    float,
    typer.Option(min=0.0, metavar="W", callback=_checked, help="w of E = D + w mean(J), thesis Eq. 6.5."),
]

Objective = Annotated[
    str,
    typer.Option(
        "--objective",
        "--reading",  # former name, still accepted
        help=f"Units of D and J in E: {', '.join(OBJECTIVES)}. The last one also takes measured positions of TS and "
        "AI; use it with a person's own parameter set only.",
    ),
]

Angles = Annotated[
    str,
    typer.Option(
        metavar="six|five",
        help="Angles in J: six, or five without the axial rotation of the clavicle, which is an estimate where only "
        "two landmarks were measured on it. With five, ignore the simulated axial rotation: two values close the "
        "conoid equally well.",
    ),
]

Float32 = Annotated[
    bool,
    typer.Option(
        "--float32",
        help="Iterate in float32, and in float64 where that does not converge: a little faster for a thousand subjects "
        "and more. Angles change by less than 0.001 degrees, parameters by less than 0.1 mm.",
    ),
]

KnownEffects = Annotated[
    list[str],
    typer.Option(
        EFFECT_OPTION,
        metavar="NAME=A,B,C",
        help="Known effect, active in every subject, as in thorax_tilt=0,5,0: one amplitude per direction (see `girdle "
        f"effects`), at {FULL_ELEVATION_DEG:g} degrees of elevation if the effect grows with elevation. "
        "NAME=0,5,0~2,2,2 adapts the amplitudes of each subject too, about these means: a deviation of 2 counts as "
        "one degree in one angle of one posture. sc_translation=measured and ac_translation=measured take the "
        "movement from the positions in the motion file. Repeatable; always in float64.",
        show_default=False,
    ),
]

ThoraxDownweighting = Annotated[
    float,
    typer.Option(
        THORAX_OPTION,
        metavar="K",
        help="Let the thorax points of the set, where they are another person's, count 1/K in E. A w that is K times "
        "as large does the same.",
    ),
]

OwnBones = Annotated[
    bool,
    typer.Option(
        "--own-bones",
        help="Adapt bones and frames of each person's own beside the six parameters, as far as people differ, in place "
        "of E within bounds.",
    ),
]

EffectsOf = Annotated[
    Path | None,
    typer.Option(
        EFFECTS_OF_OPTION,
        metavar="FOLDER",
        help="Adapt with the causes that `girdle diagnose` has written into this folder, with their amplitudes "
        "(diagnosis.json); --effect adds others.",
        show_default=False,
    ),
]

ShowTables = Annotated[
    bool, typer.Option("--tables", help="Print the tables too; the files of the run have them in any case.")
]

Repeat = Annotated[
    Path | None,
    typer.Option(
        "--repeat",
        metavar="run.json",
        help="Repeat an earlier run with the motion files, models and options of its record; options given here "
        "replace the recorded ones. The files must be unchanged.",
        callback=_take_from_record,
        is_eager=True,
        show_default=False,
    ),
]

Names = Annotated[
    Path | None, typer.Option("--map", help="TOML file with your names of markers and angles, and the unit.")
]

Shoulder = Annotated[str, typer.Option(help="Shoulder: right or left.")]

AaToAc = Annotated[
    str, typer.Option(help=f"Mean rotation for a scapula with AA but without AC: {', '.join(ROTATIONS)}.")
]

ScFromIj = Annotated[
    str, typer.Option(help=f"Offset that places SC from IJ, where nobody marked it: {', '.join(OFFSETS)}.")
]

GhFromAc = Annotated[
    str, typer.Option(help=f"Offset that places GH from AC, where nobody marked it: {', '.join(GH_OFFSETS)}.")
]

ClavicleZ = Annotated[
    str,
    typer.Option(
        metavar="|".join(CLAVICLE_Z),
        help="The y axis to which the clavicle's z axis is normal with the arm lowest: the thorax's, so that the "
        "estimated axial rotation begins at 0, or the global one (Appendix A), which needs `global` in --map.",
    ),
]

SurfaceUnit = Annotated[
    str, typer.Option(help=f"Unit of the surfaces, which their files do not say: {', '.join(UNITS_MM)}.")
]


def asked_models(model: list[str], models_of: list[Path]) -> list[str]:
    """Return the models asked for, with folders of sets among them as in run.json, else the default model."""
    return [*model, *(str(folder.absolute()) for folder in models_of)] or [DEFAULT_MODEL]
