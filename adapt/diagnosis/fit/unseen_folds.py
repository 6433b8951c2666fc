"""The folds of a search: kinds of motion unseen by everybody, and kinds of motion together with persons.

Fold (m): kind of motion m unseen by everybody. Fold (p, m): the amplitudes have not seen person p (left and right) nor
the motion m; the adapted parameters of p's shoulders have seen their other motions. Of a single kind of motion every
third posture is held out in its place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

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
    def rows(self) -> Int[np.ndarray, " tested"]:
        """Rows of all folds, one after the other."""
        return np.concatenate([fold.tested for fold in self.each])

    @cached_property
    def fold_of(self) -> Int[np.ndarray, " tested"]:
        """The fold of each of them."""
        return np.repeat(np.arange(len(self.each)), [len(fold.tested) for fold in self.each])

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What is held out: motions alone, or persons too."""
        return tuple(dict.fromkeys(fold.kind for fold in self.each))

    def of_kind(self, kind: str) -> Bool[np.ndarray, " folds"]:
        """Find the folds of a kind."""
        return np.array([fold.kind == kind for fold in self.each])

    def only(self, kind: str) -> "Folds":
        """Take the folds of a kind."""
        return Folds(tuple(fold for fold in self.each if fold.kind == kind), self.label)

    @cached_property
    def subject(self) -> Int[np.ndarray, " parts"]:
        """The subject of each part."""
        return np.array([fold.subject for fold in self.each if fold.kind == MOTION])

    def means(self, values: Float[np.ndarray, "tested ..."]) -> Float[np.ndarray, "folds ..."]:
        """Average the rows of each fold."""
        starts = np.searchsorted(self.fold_of, np.arange(len(self.each)))
        count = np.bincount(self.fold_of).reshape(-1, *(1,) * (values.ndim - 1))
        return np.add.reduceat(values, starts, axis=0) / count

    def measured_means(
        self, values: Float[np.ndarray, "tested 6"], shoulders: Shoulders
    ) -> Float[np.ndarray, "folds 6"]:
        """Average the rows of each fold in which the angle was measured; NaN where it was in none."""
        measured = shoulders.measured[:, self.rows].T
        share = self.means(measured.astype(float))
        return np.where(
            share > 0.0, self.means(np.where(measured, values, 0.0)) / np.where(share > 0.0, share, 1.0), np.nan
        )

    def by_part(self, of_folds: Float[np.ndarray, "folds ..."]) -> Float[np.ndarray, "parts ..."]:
        """Average each part over the kinds of folds."""
        return np.mean([of_folds[self.of_kind(kind)] for kind in self.kinds], axis=0)


def folds_of(shoulders: Shoulders) -> Folds:
    """Hold out every kind of motion, and with it every person where there are several."""
    folds, label = motions_and_persons(shoulders.motions, shoulders.person)
    return Folds(tuple(folds), label)
