"""The limit of naming: the sum of squares at the truth, the separation of an effect, and the probability of naming."""

from dataclasses import replace

import numpy as np
import pytest

from models.adapted_parameters import PERSON_SD_MM
from scripts.research.named_causes.blind.cases import Case
from scripts.research.named_causes.study_limit import (
    LEAST,
    could_be_named,
    could_be_named_without_size,
    distance2,
    observed,
    separation2,
)

CASE = Case("two_motions", "thorax_tilt", 51)


def test_with_the_effect_nothing_is_left_but_how_people_differ():
    _, true, change = observed(CASE)
    apart = true.true_mm / PERSON_SD_MM
    h = apart.sum(axis=0) / (len(apart) + 1.0)
    at_the_truth = float(((apart - h) ** 2).sum() + h @ h)
    assert 0.1 * at_the_truth < distance2(true, change) <= at_the_truth


def test_without_it_more_is_left_and_landmarks_show_more_of_it():
    alone, seen = (separation2(replace(CASE, condition=name)) for name in ("two_motions", "landmarks"))
    assert 5.0 < alone < seen


def test_what_could_be_named_goes_from_nothing_to_all():
    assert could_be_named(0.0) == pytest.approx(0.0)
    assert could_be_named(1000.0) == pytest.approx(1.0)
    assert np.all(np.diff([could_be_named(one) for one in (4.0, 9.0, 16.0, 25.0)]) > 0.0)


@pytest.mark.parametrize(("d2", "numbers"), [(9.0, 1), (25.0, 3)])
def test_an_unknown_size_costs_what_a_simulation_says(d2, numbers):
    """Evidence of x ~ N(a, 1) with a ~ N(0, v), against a = 0, for draws about the true a."""
    x = np.random.default_rng(5).standard_normal((200_000, numbers)) + np.sqrt(d2 / numbers)
    spread = 1.0 + d2 / numbers
    log_odds = (-0.5 * np.log(spread) - 0.5 * x**2 / spread + 0.5 * x**2).sum(axis=1)
    found = could_be_named_without_size(d2, numbers)
    assert found == pytest.approx(np.mean(log_odds > LEAST), abs=0.005)
    assert found < could_be_named(d2)
