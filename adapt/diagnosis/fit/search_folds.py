"""The folds of a search: kinds of motion held out of everybody, and kinds of motion together with persons.

Fold (m): motion m held out of everybody. Fold (p, m): person p (left and right) and motion m held out of the
amplitudes, m of the adapted parameters of p's shoulders. Of a single kind of motion every third posture is held out in
its place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Int

from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.tables.folds import MOTION, Fold, Label, motions_and_persons


@dataclass(frozen=True)
class Folds:
    """All folds; a part is one subject and motion (or third) in them, whatever the kind."""

    each: tuple[Fold, ...]
    """Every kind has the same parts in the same order."""
    label: Label
    """What each row is held out with, by name."""

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What is held out: motions alone, or persons too."""
        return tuple(dict.fromkeys(fold.kind for fold in self.each))

    def only(self, kind: str) -> "Folds":
        """Take the folds of a kind."""
        return Folds(tuple(fold for fold in self.each if fold.kind == kind), self.label)

    @cached_property
    def subject(self) -> Int[np.ndarray, " parts"]:
        """The subject of each part."""
        return np.array([fold.subject for fold in self.each if fold.kind == MOTION])


def folds_of(shoulders: Shoulders) -> Folds:
    """Hold out every kind of motion, and with it every person where there are several."""
    folds, label = motions_and_persons(shoulders.motions, shoulders.person)
    return Folds(tuple(folds), label)
