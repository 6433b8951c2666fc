"""Numbers of the answers, and the names of the questions."""

from typing import NamedTuple

from jaxtyping import Float
from numpy import ndarray

from adapt.trust.questions.persons import Interval, Persons

DISTANCE, RHYTHM, ELLIPSOID = "constant_distance", "rhythm_or_measured", "ellipsoid_per_posture"

PERSONS = "persons"
"""Value of ``who`` for a number of all persons, rather than of one group mean."""


class Answer(NamedTuple):
    """A row of ``questions.csv``."""

    question: str
    model: str
    case: str
    quantity: str
    unit: str
    who: str
    """``PERSONS``, or the name of a group mean."""
    value: float
    low: float
    """Lower end of the 95 % interval; NaN without an interval."""
    high: float


COLUMNS = Answer._fields


class Collector:
    """Collector of the numbers of one question and model."""

    def __init__(self, question: str, model: str, persons: Persons) -> None:
        self.answers: list[Answer] = []
        self._head, self._persons = (question, model), persons

    def add(self, case: str, quantity: str, unit: str, of_subjects: Float[ndarray, " subjects"]) -> None:
        """Add the mean over persons with its 95 % interval, and the value of each group mean."""
        self.add_interval(case, quantity, unit, self._persons.interval(of_subjects))
        for name, value in self._persons.means(of_subjects).items():
            self.answers.append(Answer(*self._head, case, quantity, unit, name, value, float("nan"), float("nan")))

    def add_interval(self, case: str, quantity: str, unit: str, of: Interval) -> None:
        """Add a number for all persons with a given interval."""
        self.answers.append(Answer(*self._head, case, quantity, unit, PERSONS, of.value, of.low, of.high))

    def add_number(self, case: str, quantity: str, unit: str, value: float) -> None:
        """Add a number for all persons without an interval."""
        self.add_interval(case, quantity, unit, Interval(value, float("nan"), float("nan")))
