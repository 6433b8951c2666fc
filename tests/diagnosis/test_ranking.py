"""What makes the best hypothesis hard to believe: by hand."""

from dataclasses import replace
from math import log, sqrt

import numpy as np
import pytest
from test_linear_evidence import linear_of

from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS, LinearisedFit
from adapt.diagnosis.inference.ranking import amplitude_excess
from models.effects import EFFECTS

ASYMMETRY, STRAIN = EFFECTS["thorax_asymmetry"], EFFECTS["conoid_strain"]
"""Of one amplitude, and of three."""

SAME = 1e-12
"""Relative: a few sums."""

SD = sqrt(1.0 + BETWEEN_SUBJECTS**2)
"""Of a subject's amplitude, in units of its scale."""


def fitted(*by_subject: list[float]) -> LinearisedFit:
    """Subjects with these amplitudes in their prior SDs."""
    linear = linear_of(amplitudes=len(by_subject[0]))
    return replace(linear, a=SD * linear.scale * np.array(by_subject))


def test_of_no_effect_nothing_is_too_large():
    assert amplitude_excess(fitted([], [], []), []) == 0.0


def test_what_is_as_large_as_such_effects_are_is_not_too_large():
    assert amplitude_excess(fitted([0.9], [1.1], [-0.9]), [ASYMMETRY]) == 0.0


@pytest.mark.parametrize("signs", [(1.0, 1.0, 1.0), (1.0, -1.0, 1.0)], ids=["alike", "either sign"])
def test_an_amplitude_is_compared_with_its_prior(signs):
    """A mean square of (4 + 9 + 16) / 3, of one amplitude."""
    subjects = fitted(*([sign * size] for sign, size in zip(signs, (2.0, 3.0, 4.0), strict=True)))
    assert amplitude_excess(subjects, [ASYMMETRY]) == pytest.approx(log(29.0 / 3.0) / sqrt(2.0), rel=SAME)


def test_all_amplitudes_of_an_effect_count_together():
    subjects = fitted(*[[3.0, 0.0, 0.0]] * 3)
    assert amplitude_excess(subjects, [STRAIN]) == pytest.approx(log(3.0) / sqrt(2.0 / 3.0), rel=SAME)


def test_of_two_effects_that_most_beyond_counts():
    subjects = fitted(*[[3.0, 0.0, 0.0, 2.0]] * 3)
    each = log(3.0) / sqrt(2.0 / 3.0), log(4.0) / sqrt(2.0)
    assert amplitude_excess(subjects, [STRAIN, ASYMMETRY]) == pytest.approx(max(each), rel=SAME)
