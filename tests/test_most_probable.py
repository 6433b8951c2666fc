"""Hypotheses fitted to all subjects: each as it would be alone, and at no more cost than it needs."""

from itertools import pairwise

import numpy as np
import pytest

from adapt.diagnosis import most_probable
from adapt.diagnosis.misfit import misfit
from adapt.diagnosis.most_probable import fit_hypotheses
from adapt.diagnosis.observed import Noise, observe
from adapt.simulation import simulate_model_subjects
from models import load_model
from models.effects import EFFECTS

SAME_SD = 1e-9
"""In prior standard deviations: the same descent, rounded in another order."""

MODEL = load_model("R2")
SMALL_EFFECTS = tuple(EFFECTS[name] for name in ("scapula_landmark_bias", "conoid_strain", "thorax_asymmetry"))
HYPOTHESES = [(), ("scapula_landmark_bias",), ("conoid_strain", "thorax_asymmetry")]
SUBJECTS = 4


@pytest.fixture(scope="module")
def data():
    return observe(simulate_model_subjects(MODEL, SMALL_EFFECTS[0], SUBJECTS, 1.0, seed=3).motions)


def fitted(data, hypotheses):
    return fit_hypotheses(MODEL.girdle, SMALL_EFFECTS, hypotheses, data, Noise(1.0))


def test_a_hypothesis_is_fitted_alike_in_any_company(data):
    for hypothesis, among in zip(HYPOTHESES, fitted(data, HYPOTHESES), strict=True):
        (alone,) = fitted(data, [hypothesis])
        assert among.hypothesis == hypothesis
        np.testing.assert_allclose(among.u, alone.u, rtol=0.0, atol=SAME_SD)
        np.testing.assert_allclose(among.a / among.scale, alone.a / alone.scale, rtol=0.0, atol=SAME_SD)


def test_lanes_that_have_come_to_rest_are_not_looked_at_again(data, monkeypatch):
    """Descents look at ever fewer of the lanes; each of the three rounds begins with all."""
    lanes = []

    def counted(girdle, effects, seen, *others):
        lanes.append(seen.counted.shape[1])
        return misfit(girdle, effects, seen, *others)

    monkeypatch.setattr(most_probable, "misfit", counted)
    fitted(data, HYPOTHESES)
    all_lanes = len(HYPOTHESES) * SUBJECTS
    assert max(lanes) == all_lanes
    fewer = [now for before, now in pairwise(lanes) if now < before]
    assert len(fewer) >= 3
    assert sum(lanes) < 0.8 * all_lanes * len(lanes)
