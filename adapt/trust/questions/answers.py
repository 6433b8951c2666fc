"""Answers of measured motions to the questions of chapter 7: numbers with 95 % intervals over persons."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adapt.api import Progress
from adapt.diagnosis.fit.noise import estimate_noise
from adapt.trust.questions.answer import COLUMNS, Answer
from adapt.trust.questions.distance import distance_answers
from adapt.trust.questions.ellipsoids import ellipsoid_answers
from adapt.trust.questions.persons import Persons, adapt_rows, whole
from adapt.trust.questions.rhythm_question import rhythm_answers
from models.person.family import AnyModel
from motions.table import Motions


@dataclass(frozen=True)
class Answers:
    """Numbers of all answers, the number of postures and the noise that they rest on, and the subjects left out."""

    answers: list[Answer]
    postures: int
    noise_deg: float
    """SD of the noise of one angle."""
    noise_source: str
    left_out: dict[str, str]
    """Reason for leaving out each subject without a complete posture, by subject."""


def answered(
    motions: Motions, models: Sequence[AnyModel], means: Sequence[str] = (), progress: Progress = lambda _: None
) -> Answers:
    """Answer the three questions with every model.

    ``means``: subjects that are group means. Postures without six angles or an elevation of the arm are left out.
    Raises InputError where no posture is left.
    """
    known = whole(motions)
    persons = Persons.of(known, [name for name in means if name in known.subjects or name not in motions.subjects])
    noise = estimate_noise(persons.shoulders, known.angles_deg)
    found: list[Answer] = []
    for model in models:
        progress(f"adaptations with {model.name}")
        data = adapt_rows(known, model)
        progress(f"distances with {model.name}")
        found += distance_answers(data, persons, noise.angle_deg)
        progress(f"rhythm with {model.name}")
        found += rhythm_answers(data, persons)
        progress(f"ellipsoids with {model.name}")
        found += ellipsoid_answers(data, persons, noise.angle_deg)
    why = "no posture has six angles and an elevation of the arm"
    left_out = {name: why for name in motions.subjects if name not in known.subjects}
    return Answers(found, len(known.posture), noise.angle_deg, noise.source, left_out)


def answers_table(found: Answers) -> pd.DataFrame:
    """Tabulate ``questions.csv``."""
    return pd.DataFrame(found.answers, columns=list(COLUMNS)).replace({np.nan: None})
