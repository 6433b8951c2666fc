"""The options that several commands share, each with its help; the consoles; and how a record's options are taken."""

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
from motions.errors import InputError

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
    """What the record says becomes the default of the command's parameters."""
    if path is None:
        return
    from adapt.output.repeat import other_versions, read_record, recorded_arguments  # pandas: not for every command

    parameters = {one.name: one for one in context.command.params if one.name}
    options = set(parameters) - {"motions", "model", "models_of", "out", "repeat"}
    record = read_record(path)
    recorded = recorded_arguments(record, path, str(context.command.name), options)
    if not parameters["model"].multiple:
        recorded["model"] = recorded["model"][0]
    context.default_map = recorded
    if different := other_versions(record):
        errors.print(f"note: the last digits may differ: {', '.join(different)}", soft_wrap=True)


def _not_without_motions(weight: float) -> float:
    if weight == 0.0:
        cause = "with w = 0 the measured angles have no part in E, and nothing is adapted to them"
        raise InputError("--weight", None, cause, "Give a positive number, as 10, or use girdle fit")
    from adapt.solvers.objective import check_weight  # JAX: not for --help

    check_weight(weight, "--weight")
    return weight


Weight = Annotated[
    float,
    typer.Option(min=0.0, metavar="W", callback=_not_without_motions, help="w of E = D + w mean(J), thesis Eq. 6.5."),
]

Objective = Annotated[
    str,
    typer.Option(
        "--objective",
        "--reading",  # its earlier name
        help=f"Units of D and J in E: {', '.join(OBJECTIVES)}. The last one also takes measured positions of TS and "
        "AI; use it with a person's own parameter set only.",
    ),
]

Angles = Annotated[
    str,
    typer.Option(
        metavar="six|five",
        help="Angles in J: six, or five without the axial rotation of the clavicle, which is an estimate where two "
        "landmarks were measured on it. What is simulated of it then means nothing: two axial rotations close the "
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
        help="An effect known to be active in every subject, by the size of each of its directions (see `girdle "
        f"effects`), of one that grows with elevation that at {FULL_ELEVATION_DEG:g} degrees: "
        "thorax_tilt=0,5,0. With ~2,2,2 behind it the size of each subject is adapted too, about this mean: "
        "one that is 2 off counts as a degree in one angle of one posture. =measured, of "
        "sc_translation and ac_translation: as the positions in the motion file say. Repeatable; always in float64.",
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
        help="Repeat an earlier run: motion files, models and options are those of its record, but for what is given "
        "here. Its files must be as they were.",
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
        help="Whose y axis the clavicle's z axis is normal to with the arm lowest: the thorax's, so that the estimated "
        "axial rotation begins at 0, or the global one (Appendix A), which needs `global` in --map.",
    ),
]

SurfaceUnit = Annotated[
    str, typer.Option(help=f"Unit of the surfaces, which their files do not say: {', '.join(UNITS_MM)}.")
]


def asked_models(model: list[str], models_of: list[Path]) -> list[str]:
    """Return what was asked for, else the default. A folder stands among the models, as run.json has it."""
    return [*model, *(str(folder.absolute()) for folder in models_of)] or [DEFAULT_MODEL]
