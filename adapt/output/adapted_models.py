# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Adapted girdles as parameter sets that ``--model`` accepts: one TOML file per model and subject."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import jax
import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt.output.run_files import prepare_folder
from adapt.own_bones.own_adaptation import HERE, WORDS
from adapt.solvers import status
from adapt.tables.results import OWN_WORD
from models.adapted_parameters import ADAPTED, ADAPTED_PARAMETERS, HALF_WIDTHS_MM
from models.export.toml import parameters_toml
from models.girdle import Girdle
from models.person.family import AnyModel
from models.person.own_bones import NO_SDS, SIZES, with_own_sizes
from models.sets.number_sources import ADAPTED_TO
from motions.files import file_names, printable

FOLDER = "models"
"""Name of the folder below the results."""

_KEY_OF = {
    f"{section}.{field}": tuple(one.name for one in ADAPTED_PARAMETERS if one.field == field)
    for section, field in (
        ("thorax", "centre_mm"),
        ("thorax", "semi_axes_mm"),
        ("constraint", "conoid_length_mm"),
    )
}
"""Keys of a parameter set that an adaptation changes, and the adapted parameters in each."""


OWN_BONES = "own bones"
"""Words for own bones in the [source] lines; where the plain adaptation was kept, the lines say "plain"."""

_OWN_KEYS = (
    *("clavicle.sc_mm", "clavicle.length_mm", "clavicle.ac_mm", "clavicle.conoid_mm", "scapula.ts_mm"),
    *("scapula.ai_mm", "scapula.conoid_mm", "constraint.ts_distance_mm", "constraint.ai_distance_mm"),
)
"""Keys of a parameter set that own bones change in addition."""


def write_adapted_models(folder: Path, models: Sequence[AnyModel], parameters: pd.DataFrame, how: str) -> None:
    """Write ``models/MODEL_SUBJECT.toml`` for each row of parameters.csv that is ``ok``.

    ``how``: the options of the adaptation, for the [source] lines. ``folder`` comes from
    ``adapt.output.run_files.transaction``.
    """
    prepare_folder(folder / FOLDER)
    of_name = {model.name: model for model in models}
    theta_mm = parameters[[f"{name}_mm" for name in ADAPTED]].to_numpy(float)
    at_bound = parameters[[f"{name}_mm_at_bound" for name in ADAPTED]].to_numpy(bool)
    own = parameters[[size.key for size in SIZES[len(ADAPTED) :] if size.key in parameters]]
    for number, (model, subject, word, path) in enumerate(_files(folder, parameters)):
        if word != status.OK:
            continue
        flags = dict(zip(ADAPTED, at_bound[number].tolist(), strict=True))
        is_own = OWN_WORD in parameters and parameters[OWN_WORD].iloc[number] == WORDS[HERE]
        sizes, why = (own.iloc[number].to_dict(), how) if is_own else ({}, how.replace(OWN_BONES, "plain"))
        text = adapted_toml(of_name[model], subject, theta_mm[number], flags, why, sizes)
        path.write_bytes(text.encode())  # no atomic write: the folder is published as a whole


def _files(folder: Path, parameters: pd.DataFrame) -> Iterator[tuple[str, str, str, Path]]:
    """Yield model, subject, status and file of each row."""
    rows = [parameters[one] for one in ("model", "subject", "status")]  # iterated: a list has ten times their memory
    names = file_names(f"{model}_{subject}" for model, subject, _ in zip(*rows, strict=True))
    for name, model, subject, word in zip(names, *rows, strict=True):
        yield model, subject, word, folder / FOLDER / f"{name}.toml"


def adapted_toml(
    family: AnyModel,
    subject: str,
    theta_mm: Float[np.ndarray, " adapted"],
    at_bound: Mapping[str, bool],
    how: str,
    own_sizes: Mapping[str, float] = NO_SDS,
) -> str:
    """Format the parameter set of one subject as the text of a TOML file.

    Numbers that were not adapted keep the source that they have in the model. ``own_sizes``: sizes of the person's own
    bones and frames (``OwnSize.key``).
    """
    model = family.of(subject)
    own = jax.tree.map(np.asarray, model.girdle)  # numpy: calls of JAX would take longer than the adaptation
    girdle = (with_own_sizes(own, own_sizes) if own_sizes else own).with_adapted(theta_mm)
    source = {key: f"of {model.name}: {words}" for key, words in model.source.items()}
    for key in _OWN_KEYS if own_sizes else ():
        source[key] = f"{ADAPTED_TO}{subject}, from {model.name} ({how})"
    for key, names in _KEY_OF.items():
        bound = ", ".join(name for name in names if at_bound[name])
        flag = f"; at its bound: {bound}" if bound else ""
        source[key] = f"{ADAPTED_TO}{subject}, from {model.name} ({how}){flag}"
    comment = (
        f"{model.name} adapted to {subject}.\n"
        "Written by girdle adapt. Right shoulder, mm; frames as in the thesis, Appendix A."
    )
    comment = printable(comment)  # TOML allows no control characters in a comment
    name = f"{family.name}_{subject}"
    return parameters_toml(name, comment, girdle, model.points_mm, source, _own_bounds(model.bounds_mm[1], own))


def _own_bounds(upper_mm: Float[np.ndarray, " adapted"], own: Girdle) -> dict[str, float] | None:
    """Return the half widths of a model with its own bounds, else None: upper bound minus own value, as a lower bound
    may be cut at 1 mm."""
    widths = dict(zip(HALF_WIDTHS_MM, (upper_mm - own.adapted_mm).tolist(), strict=True))
    default = all(math.isclose(widths[key], HALF_WIDTHS_MM[key]) for key in widths)
    return None if default else widths
