"""Parameter sets of several subjects under one name, one set per subject, as ``--models-of FOLDER`` reads them."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np

from models.girdle import Girdle
from models.parameter_sets import ParameterSet, load_model
from motions.errors import InputError

_MAKE = "Make the sets with girdle model, one for each subject"


@dataclass(frozen=True, eq=False)
class PersonalSets:
    """The parameter sets of several persons, by subject."""

    name: str
    by_subject: Mapping[str, ParameterSet]

    def of(self, subject: str) -> ParameterSet:
        """Return the set of a subject. KeyError where the subject has none."""
        return self.by_subject[subject]


AnyModel = ParameterSet | PersonalSets
"""Model with which subjects are fitted: ``of(subject)`` returns the set of one subject."""


def as_list(models: AnyModel | Sequence[AnyModel]) -> list[AnyModel]:
    """List the models; a single model becomes a list of one.

    InputError where there is no model, where a model is given as a mere name, or where two models have the same name.
    """
    alone = isinstance(models, AnyModel | str) or not isinstance(models, Iterable)
    every: list[AnyModel] = [models] if alone else list(models)  # type: ignore[list-item, arg-type]
    for one in every:
        if not isinstance(one, AnyModel):
            what = repr(one) if isinstance(one, str) else f"a {type(one).__name__}"
            raise InputError("models", None, f"{what} is no parameter set", "Load it: models.load_model(name or file)")
    names = [one.name for one in every]
    if not names:
        raise InputError("models", None, "there is none", "Give one at least: models.load_model(name or file)")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("models", None, f"two are called {twice!r}", "Give each a name of its own, or one only once")
    return every


def set_files(folder: str | os.PathLike[str]) -> list[Path]:
    """List the TOML files of a folder. InputError if there is none."""
    home = Path(folder)
    files = sorted(home.glob("*.toml"))
    if not files:
        cause = "there is no .toml file in it" if home.is_dir() else "this is no folder"
        raise InputError(str(folder), None, cause, _MAKE)
    return files


def load_personal_sets(folder: str | os.PathLike[str]) -> PersonalSets:
    """Load all parameter sets of a folder. The ``name`` of a set names its subject, the folder names them all.

    InputError where a file is no parameter set, or where two sets have the same name.
    """
    found: dict[str, tuple[Path, ParameterSet]] = {}
    for path in set_files(folder):
        one = load_model(path)
        if one.name in found:
            cause = f"its name {one.name!r} is also that of {found[one.name][0].name}"
            raise InputError(str(path), None, cause, "Give each file the name of its own subject")
        found[one.name] = path, one
    return PersonalSets(Path(folder).resolve().name, {name: one for name, (_, one) in found.items()})


def load_any_model(name: str) -> AnyModel:
    """Load the sets of a folder if ``name`` is its path with a separator, else one set (``load_model``)."""
    return load_personal_sets(name) if os.sep in name and Path(name).is_dir() else load_model(name)


def girdles_of(model: AnyModel, subjects: Sequence[str]) -> Girdle:
    """Stack the girdles of the subjects as numpy arrays ``(3, subjects)``, one per entry of ``subjects``."""
    sets, place = unique_sets([model], subjects)
    return stacked_girdles(sets, place)


def unique_sets(models: Sequence[AnyModel], subjects: Sequence[str]) -> tuple[list[ParameterSet], np.ndarray]:
    """List the distinct sets of all subjects and models, and the index into this list of each (model, subject) pair.

    The subjects vary fastest in the indices.
    """
    sets = [model.of(subject) for model in models for subject in subjects]
    different = list(dict.fromkeys(sets))
    number = {one: k for k, one in enumerate(different)}
    return different, np.array([number[one] for one in sets], int)


def stacked_girdles(sets: Sequence[ParameterSet], place: np.ndarray) -> Girdle:
    """Stack the girdles of the sets, indexed by ``place``, as numpy arrays."""
    return jax.tree.map(lambda *x: np.stack(x, axis=-1)[..., place], *[one.girdle for one in sets])
