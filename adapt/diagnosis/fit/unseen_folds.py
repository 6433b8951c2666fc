"""What is held out in turn: kinds of motion for everybody, and kinds of motion together with persons.

Test (m): kind of motion m unseen by everybody. Test (p, m): the amplitudes have not seen person p (left and right) nor
the motion m; the adapted parameters of p's shoulders have seen their other motions. Of a single kind of motion every
third posture is held out in its place.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.tables.held_out import MOTION
from adapt.trust.folds import POSTURE_PARTS

PERSON = "person and motion"
"""What a test has not seen; of MOTION the motion alone."""

_PERSON_FOLDS = 6
"""Persons are held out in so many groups at most: more take longer and tell little more."""


class Test(NamedTuple):
    """The rows of one subject and one kind of motion, and what a prediction of them may know."""

    kind: str
    subject: int
    motion: int
    unseen: Bool[np.ndarray, " subjects"]
    """Shoulders of which the amplitudes have seen nothing."""
    seen_rows: Int[np.ndarray, " some"]
    """Of the subject: what it is adapted to."""
    rows: Int[np.ndarray, " chosen"]


@dataclass(frozen=True)
class Folds:
    """All tests."""

    tests: tuple[Test, ...]
    label: Int[np.ndarray, " rows"]
    """What is held out together: the motion, or the third of it."""

    @cached_property
    def rows(self) -> Int[np.ndarray, " tested"]:
        """Rows of all tests, one after the other."""
        return np.concatenate([test.rows for test in self.tests])

    @cached_property
    def test_of(self) -> Int[np.ndarray, " tested"]:
        """The test of each of them."""
        return np.repeat(np.arange(len(self.tests)), [len(test.rows) for test in self.tests])

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What is held out: motions alone, or persons too."""
        return tuple(dict.fromkeys(test.kind for test in self.tests))

    def of_kind(self, kind: str) -> Bool[np.ndarray, " tests"]:
        """Find the tests of a kind; every kind has the same subjects and motions in the same order."""
        return np.array([test.kind == kind for test in self.tests])

    def only(self, kind: str) -> "Folds":
        """Take the tests of a kind."""
        return Folds(tuple(test for test in self.tests if test.kind == kind), self.label)

    @cached_property
    def subject(self) -> Int[np.ndarray, " folds"]:
        """The subject of each fold: of the tests of one kind."""
        return np.array([test.subject for test in self.tests if test.kind == MOTION])

    def means(self, values: Float[np.ndarray, "tested ..."]) -> Float[np.ndarray, "tests ..."]:
        """Average the rows of each test."""
        starts = np.searchsorted(self.test_of, np.arange(len(self.tests)))
        count = np.bincount(self.test_of).reshape(-1, *(1,) * (values.ndim - 1))
        return np.add.reduceat(values, starts, axis=0) / count

    def measured_means(
        self, values: Float[np.ndarray, "tested 6"], shoulders: Shoulders
    ) -> Float[np.ndarray, "tests 6"]:
        """Average the rows of each test in which the angle was measured; NaN where it was in none."""
        measured = shoulders.measured[:, self.rows].T
        share = self.means(measured.astype(float))
        return np.where(
            share > 0.0, self.means(np.where(measured, values, 0.0)) / np.where(share > 0.0, share, 1.0), np.nan
        )

    def by_fold(self, of_tests: Float[np.ndarray, "tests ..."]) -> Float[np.ndarray, "folds ..."]:
        """Average a fold over the kinds of tests."""
        return np.mean([of_tests[self.of_kind(kind)] for kind in self.kinds], axis=0)


def folds_of(shoulders: Shoulders) -> Folds:
    """Hold out every kind of motion, and with it every person where there are several."""
    label = shoulders.motion if len(shoulders.kinds) > 1 else _third(shoulders)
    tests = []

    def hold_out(kind: str, tested: Int[np.ndarray, " some"], unseen: Bool[np.ndarray, " subjects"]) -> None:
        for subject in tested:
            own = shoulders.rows_of(subject)
            for motion in np.unique(label[own]):
                seen, rows = own[label[own] != motion], own[label[own] == motion]
                if len(seen):
                    tests.append(Test(kind, int(subject), int(motion), unseen, seen, rows))

    everyone = np.arange(len(shoulders.subjects))
    hold_out(MOTION, everyone, np.zeros(len(everyone), bool))
    if shoulders.persons > 1:
        for some in np.array_split(np.arange(shoulders.persons), min(shoulders.persons, _PERSON_FOLDS)):
            unseen = np.isin(shoulders.person, some)
            hold_out(PERSON, np.flatnonzero(unseen), unseen)
    order = {MOTION: 0, PERSON: 1}
    return Folds(tuple(sorted(tests, key=lambda test: (order[test.kind], test.subject, test.motion))), label)


def _third(shoulders: Shoulders) -> Int[np.ndarray, " rows"]:
    third = np.zeros(len(shoulders.subject), int)
    for subject in range(len(shoulders.subjects)):
        rows = shoulders.rows_of(subject)
        third[rows] = np.arange(len(rows)) % POSTURE_PARTS
    return third
