"""What is held out in turn: kinds of motion for everybody, and kinds of motion together with persons.

Fold (m): kind of motion m unseen by everybody. Fold (p, m): the amplitudes have not seen person p (left and right) nor
the motion m; the adapted parameters of p's shoulders have seen their other motions. Of a single kind of motion every
third posture is held out in its place.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.joint_fit import Part, PartArrays, everybody, part_arrays
from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.tables.held_out import MOTION
from adapt.trust.folds import POSTURE_PARTS

PERSON = "person and motion"
"""What a test has not seen; of MOTION the motion alone."""

_PERSON_FOLDS = 6
"""Persons are held out in so many groups at most: more take longer and tell little more."""

_HELD_OUT = 1e-6
"""Importance of a person that is held out: its own parameters are fitted, the amplitudes do not feel it."""


class Test(NamedTuple):
    """The rows of one subject and one kind of motion, and the part whose fit has not seen them."""

    kind: str
    subject: int
    motion: int
    part: int
    rows: Int[np.ndarray, " chosen"]


@dataclass(frozen=True)
class Folds:
    """The parts to fit, the first group with everything in, and the tests."""

    parts: tuple[Part, ...]
    tests: tuple[Test, ...]

    @cached_property
    def arrays(self) -> PartArrays:
        """What the parts are, side by side."""
        return part_arrays(self.parts)

    @cached_property
    def rows(self) -> Int[np.ndarray, " tested"]:
        """Rows of all tests, one after the other."""
        return np.concatenate([test.rows for test in self.tests])

    @cached_property
    def test_of(self) -> Int[np.ndarray, " tested"]:
        """The test of each of them."""
        return np.repeat(np.arange(len(self.tests)), [len(test.rows) for test in self.tests])

    @cached_property
    def part(self) -> Int[np.ndarray, " tests"]:
        """The part of each test."""
        return np.array([test.part for test in self.tests])

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What is held out: motions alone, or persons too."""
        return tuple(dict.fromkeys(test.kind for test in self.tests))

    def of_kind(self, kind: str) -> Bool[np.ndarray, " tests"]:
        """Find the tests of a kind; every kind has the same subjects and motions in the same order."""
        return np.array([test.kind == kind for test in self.tests])

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
        measured = shoulders.sd[:, self.rows].T == 1.0
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
    different = np.unique(label)
    parts, tests = list(everybody(shoulders)), []

    def hold_out(kind: str, tested: Int[np.ndarray, " some"], held_out_persons: Int[np.ndarray, " p"]) -> None:
        for motion in different:
            group = parts[-1].group + 1
            added, found = [], []
            for subject in range(len(shoulders.subjects)):
                own = shoulders.rows_of(subject)
                seen, unseen = own[label[own] != motion], own[label[own] == motion]
                if len(seen):
                    if subject in tested and len(unseen):
                        found.append(Test(kind, subject, int(motion), len(parts) + len(added), unseen))
                    held_out = shoulders.person[subject] in held_out_persons
                    added.append(Part(subject, group, seen, _HELD_OUT if held_out else 1.0))
            if found:
                parts.extend(added)
                tests.extend(found)

    everyone = np.arange(len(shoulders.subjects))
    hold_out(MOTION, everyone, np.zeros(0, int))
    if shoulders.persons > 1:
        for some in np.array_split(np.arange(shoulders.persons), min(shoulders.persons, _PERSON_FOLDS)):
            hold_out(PERSON, np.flatnonzero(np.isin(shoulders.person, some)), some)
    order = {MOTION: 0, PERSON: 1}
    tests.sort(key=lambda test: (order[test.kind], test.subject, test.motion))
    return Folds(tuple(parts), tuple(tests))


def _third(shoulders: Shoulders) -> Int[np.ndarray, " rows"]:
    third = np.zeros(len(shoulders.subject), int)
    for subject in range(len(shoulders.subjects)):
        rows = shoulders.rows_of(subject)
        third[rows] = np.arange(len(rows)) % POSTURE_PARTS
    return third
