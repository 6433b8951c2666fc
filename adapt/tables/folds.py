"""Folds, the postures that are held out in turn: motions, thirds of the postures, and persons.

A fold is of one subject: the postures to which its girdle is adapted, and the postures that are then predicted.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, Shaped

from motions.table import Motions

MOTION, POSTURES, PERSON = "motion", "postures", "person and motion"
"""Kinds of folds: one motion held out; every third posture held out; a motion held out together with persons, whose
data then have no influence on anything that persons share."""

THIRDS = ("third 2", "third 3", "third 1")
"""Names of the thirds to which the postures of a subject belong in turn."""

_PERSON_GROUPS = 6
"""Largest number of groups in which persons are held out: more take longer and add little information."""

Rows = Int[np.ndarray, " some"]
"""Rows of the motions, ascending."""

Label = Shaped[np.ndarray, " rows"]
"""Name of the held-out motion or third of each row."""


@dataclass(frozen=True, eq=False)
class Fold:
    """Postures of one subject, by their rows in the motions."""

    kind: str
    subject: int
    """Number among the subjects of the motions."""
    held_out: str
    """Name of the motion or third."""
    fitted: Rows
    """Rows to which the girdle of the subject is adapted."""
    tested: Rows
    """Rows that are predicted."""
    held_out_subjects: tuple[int, ...] = ()
    """Subjects held out of all that subjects share."""


def motions_and_thirds(motions: Motions) -> list[Fold]:
    """Hold out every motion of every subject with several motions, and every third posture of every subject."""
    found, thirds = [], thirds_of(motions)
    for subject, rows in enumerate(motions.rows_by_subject()):
        found += _leave_out(MOTION, subject, rows, motions.motion, dict.fromkeys(motions.motion[rows].tolist()))
        found += _leave_out(POSTURES, subject, rows, thirds, sorted(THIRDS))
    return found


def motions_or_thirds(motions: Motions) -> list[Fold]:
    """Hold out every motion of a subject with several motions, and every third posture of a subject with one."""
    every = motions_and_thirds(motions)
    several = {fold.subject for fold in every if fold.kind == MOTION}
    return [fold for fold in every if fold.kind == MOTION or fold.subject not in several]


def motions_and_persons(motions: Motions, person: Int[np.ndarray, " subjects"]) -> tuple[list[Fold], Label]:
    """Hold out every kind of motion, alone and, where there are several persons, together with every person.

    With a single kind of motion, thirds of the postures take the place of motions. Return the folds by kind, subject
    and name, and the name of the held-out motion or third of each row.

    ``person``: the number of the person of each subject.
    """
    kinds = sorted(set(motions.motion.tolist()))
    label, names = (motions.motion, kinds) if len(kinds) > 1 else (thirds_of(motions), THIRDS)
    subjects = motions.rows_by_subject()
    found = [fold for s, rows in enumerate(subjects) for fold in _leave_out(MOTION, s, rows, label, names)]
    persons = int(person.max()) + 1
    if persons > 1:
        groups = np.array_split(np.arange(persons), min(persons, _PERSON_GROUPS))
        held_out_subjects = {
            one: tuple(np.flatnonzero(np.isin(person, group)).tolist()) for group in groups for one in group
        }
        for s, rows in enumerate(subjects):
            found += _leave_out(PERSON, s, rows, label, names, held_out_subjects[person[s]])
    return found, label


def _leave_out(
    kind: str, subject: int, rows: Rows, label: Label, names: Iterable[str], held_out_subjects: tuple[int, ...] = ()
) -> Iterator[Fold]:
    """Hold out the rows of each name in turn, where there are such rows and others remain."""
    own = label[rows]
    for name in names:
        fitted, tested = rows[own != name], rows[own == name]
        if len(fitted) and len(tested):
            yield Fold(kind, subject, str(name), fitted, tested, held_out_subjects)


def thirds_of(motions: Motions) -> Label:
    """Name the third to which each posture of a subject belongs."""
    label = np.empty(len(motions.posture), object)
    for rows in motions.rows_by_subject():
        label[rows] = np.resize(np.array(THIRDS, object), len(rows))
    return label
