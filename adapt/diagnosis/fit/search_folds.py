"""Folds of a search: kinds of motion held out of all persons, and kinds of motion held out together with persons.

Fold (m): motion m is held out of all persons. Fold (p, m): person p (left and right) and motion m are held out of the
amplitudes, and m is held out of the adapted parameters of p's shoulders. If there is a single kind of motion, every
third posture is held out in its place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Int

from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.tables.folds import MOTION, Fold, Label, motions_and_persons


@dataclass(frozen=True)
class Folds:
    """All folds: of each kind, one per subject and held-out motion (or third)."""

    each: tuple[Fold, ...]
    """Folds; those of every kind are of the same subjects and motions in the same order."""
    label: Label
    """Name of the motion or third with which each row is held out."""

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of folds: motions alone, and motions with persons."""
        return tuple(dict.fromkeys(fold.kind for fold in self.each))

    def only(self, kind: str) -> "Folds":
        """Select the folds of one kind."""
        return Folds(tuple(fold for fold in self.each if fold.kind == kind), self.label)

    @cached_property
    def subject(self) -> Int[np.ndarray, " folds"]:
        """Subject number of each fold of a kind."""
        return np.array([fold.subject for fold in self.each if fold.kind == MOTION])


def folds_of(shoulders: Shoulders) -> Folds:
    """Hold out every kind of motion, alone and, if there are several persons, together with every person."""
    folds, label = motions_and_persons(shoulders.motions, shoulders.person)
    return Folds(tuple(folds), label)
