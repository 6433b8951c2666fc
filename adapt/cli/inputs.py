"""Input of the commands: motions, parameter sets, and subjects without a set."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from adapt.cli.choices import ANGLE_CHOICES, SIX
from adapt.output.publishing import Inputs
from adapt.output.run_files import inputs_record
from models.person.family import AnyModel, PersonalSets, load_any_model
from motions import InputError, Motions, read_motions
from motions.errors import warn_input
from motions.landmarks.girdle_angles import CLAVICLE_X
from motions.table import FEWEST_ANGLES, warn_of_alike_motions

_MOST_NAMED = 10
"""Largest number of names in a message."""


def read_inputs(motions: list[Path], models: list[str], angles: str = SIX) -> tuple[Motions, list[AnyModel], Inputs]:
    """Read the motions and the models, and return them with the record of their files for run.json.

    ``angles`` is one of ``ANGLE_CHOICES``.
    """
    check_angles(angles)
    record, sets = inputs_record(motions, models), load_models(models)
    table = not_empty(with_angles(read_motions(*motions), angles), angles)
    warn_of_alike_motions(table, "the motions")
    missing = subjects_without_set(sets, table.subjects)
    return without_subjects(table, missing), sets, record


def check_angles(angles: str) -> None:
    """Raise an InputError where ``angles`` is not one of ``ANGLE_CHOICES``."""
    if angles not in ANGLE_CHOICES:
        raise InputError("--angles", None, f"there is no '{angles}'", f"Use one of {', '.join(ANGLE_CHOICES)}")


def not_empty(motions: Motions | None, angles: str) -> Motions:
    """Return the motions; raise an InputError where no posture is left."""
    if motions is None or not len(motions.posture):
        cause = f"no posture has {FEWEST_ANGLES} angles without clavicle_x_deg"
        raise InputError(f"--angles {angles}", None, cause, "Measure more angles, or take six")
    return motions


def with_angles(motions: Motions, angles: str) -> Motions:
    """Return the motions as measured or, with FIVE, without the axial rotation of the clavicle.

    Postures with too few other angles for a fit are left out, and a warning says how many.
    """
    if angles == SIX:
        return motions
    angles_deg = motions.angles_deg.copy()
    angles_deg[:, CLAVICLE_X] = np.nan
    enough = np.isfinite(angles_deg).sum(axis=1) >= FEWEST_ANGLES
    if not enough.all():
        cause = f"{(~enough).sum()} postures have fewer than {FEWEST_ANGLES} angles without clavicle_x_deg"
        warn_input(InputError("--angles five", None, cause, "They are left out: measure more angles, or take six"))
    return replace(motions, angles_deg=angles_deg).select(enough)


def subjects_without_set(models: list[AnyModel], subjects: Sequence[str]) -> dict[str, InputError]:
    """Return an error for each subject without a set in a folder of sets; raise an InputError if no subject has one."""
    errors = {
        subject: InputError(
            model.name, None, f"there is no parameter set of subject {subject!r}", _whose_sets(subject, model)
        )
        for model in models
        if isinstance(model, PersonalSets)
        for subject in subjects
        if subject not in model.by_subject
    }
    if errors and len(errors) == len(subjects):
        raise next(iter(errors.values()))
    return errors


def _whose_sets(subject: str, model: PersonalSets) -> str:
    found = list(model.by_subject)
    listed = ", ".join(found[:_MOST_NAMED]) + (", ..." if len(found) > _MOST_NAMED else "")
    return (
        f"It has sets of {listed}: the line name = ... of a file is the subject. Make one with girdle model --subject "
        f"{subject}, or adapt this subject with --model"
    )


def without_subjects(motions: Motions, missing: dict[str, InputError]) -> Motions:
    """Return the motions of the subjects that have a set; the others are named in ``rejected``."""
    mine = tuple(error for subject, error in missing.items() if subject in motions.subjects)
    if not mine:
        return motions
    kept = motions.select(~np.isin(motions.subject, list(missing)))
    return replace(kept, rejected=(*motions.rejected, *mine))


def load_models(models: list[str]) -> list[AnyModel]:
    """Load parameter sets and folders of sets; raise an InputError if two have the same name."""
    sets = [load_any_model(name) for name in models]
    names = [one.name for one in sets]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        remedy = (
            f'Give each one a name of its own: the line name = "{twice}" of its TOML file, or the name of its folder'
        )
        raise InputError("--model", None, f"two models are called '{twice}'", remedy)
    return sets
